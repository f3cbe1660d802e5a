"""Wave variables: what goes through the channel is a wave, which carries its own energy."""

import math
from typing import ClassVar, Literal

from pydantic import NonNegativeFloat, PositiveFloat

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.teleop.bilateral.base import BilateralScheme, End, numbers
from surgsim.teleop.bilateral.follower import Follower, FollowerConfig, FollowerLaw, drive
from surgsim.teleop.messages import FORCE, POSITION, VELOCITY
from surgsim.tick.algebra import dot
from surgsim.tick.arrays import Record
from surgsim.tick.overlay import overlay
from surgsim.tick.scratch import scratch
from surgsim.tick.status import GOES_ON


class WaveVariablesConfig(PartConfig):
    """Wave variables: integrals of waves are sent, and made waves again as far as their energy came.

    Attributes:
        impedance_ns_per_m: b of the waves, in the tip's scale [N s/m].
        stiffness_n_per_m: K of the remote coupling, in the tip's scale [N/m].
        damping_ns_per_m: B of it [N s/m].
        catch_up_s: tau, the time constant with which waves are made of what came; a period: at once [s].
        follower: What the remote force drives; its damper, near b, keeps waves from being reflected.
    """

    type: Literal["wave_variables"] = "wave_variables"
    impedance_ns_per_m: PositiveFloat = 30.0
    stiffness_n_per_m: NonNegativeFloat = 500.0
    damping_ns_per_m: NonNegativeFloat = 40.0
    catch_up_s: PositiveFloat = 0.01
    follower: FollowerConfig = FollowerConfig(damping_ns_per_m=20.0)

    def build(self, period_s: float, round_trip_s: float) -> BilateralScheme:
        """The scheme; it does not depend on the delay."""
        gains = numbers(WaveLaw, self)
        return BilateralScheme(feel=feel, tell=tell, follow=follow, gains=gains, memory_size=MEMORY_SIZE)


class WaveLaw(Record):
    """Numbers, as in `WaveVariablesConfig`."""

    impedance_ns_per_m: float
    stiffness_n_per_m: float
    damping_ns_per_m: float
    catch_up_s: float
    follower: FollowerLaw


class WaveMemory(Record):
    """What an end remembers.

    Attributes:
        begun: Whether `reference` is set.
        stock_j: Energy of waves that came and was not used [J].
        debt_j: What the last periods gave out too much, to be made up for [J].
        gone: Integral of the waves that were made of what came (3,) [m (N s/m)^0.5].
        sent: Integral of the waves that were sent (3,).
        wave: The wave of this period, from the channel (3,) [W^0.5].
        before: Position before the handle moved (3,) [m].
        reference: Integral of the commanded velocity (3,) [m].
        follower: The follower.
    """

    SHAPES: ClassVar[dict[str, str]] = {name: "3" for name in ("gone", "sent", "wave", "before", "reference")}
    begun: int
    stock_j: float
    debt_j: float
    gone: Array
    sent: Array
    wave: Array
    before: Array
    reference: Array
    follower: Follower


LAW, LAW_SIZE = overlay(WaveLaw)
MEMORY, MEMORY_SIZE = overlay(WaveMemory)


@compiled
def reconstruct(law: WaveLaw, known: WaveMemory, end: End) -> None:
    """The wave w of this period, of the received integral U and the energy that came with it.

        w = (U - U_gone) / max(tau, h),   |w|^2 h / 2 <= stock

    With tau = h, a constant delay and no loss, w is what was sent. A longer tau smooths what jitter has
    bunched, and fills the stock meanwhile, from which the gap of a lost packet is paid; never more than came.

    Source: Niemeyer, Slotine, Int. J. Robot. Res. 23(9), 2004, on variable delays; ICRA 1998.
    """
    known.stock_j += end.received_j
    tau, limit = max(law.catch_up_s, end.period_s), 2.0 * known.stock_j / end.period_s
    for i in range(3):
        known.wave[i] = (end.received[VELOCITY + i] - known.gone[i]) / tau if end.known != 0 else 0.0
    square = dot(known.wave, known.wave)
    if square > limit:
        for i in range(3):
            known.wave[i] *= math.sqrt(limit / square)
        square = limit
    for i in range(3):
        known.gone[i] += end.period_s * known.wave[i]
    known.stock_j = max(known.stock_j - 0.5 * end.period_s * square, 0.0)


@compiled
def _send(known: WaveMemory, end: End) -> None:
    """The message: position, and the integral of the waves."""
    for i in range(3):
        end.content[POSITION + i] = end.position[i]
        end.content[VELOCITY + i] = known.sent[i]
        end.content[FORCE + i] = end.force[i]
    end.stored_j = end.observed_j = known.stock_j
    end.deficit_j = max(end.deficit_j, known.debt_j)


@compiled
def feel(gains: Array, end: End, memory: Array) -> int:
    """f_m = sqrt(2 b) w - b v_m, with the wave w that comes from the tip.

    The port sees an impedance b: w = 0 is a damper b on the handle.

    Source: Anderson, Spong, IEEE Trans. Autom. Control 34(5), 1989; Niemeyer, Slotine, IEEE J. Ocean. Eng.
    16(1), 1991: u = (b v + f) / sqrt(2 b), w = (b v - f) / sqrt(2 b), f the force into the channel.
    """
    law, known = gains[:LAW_SIZE].view(LAW)[0], memory[:MEMORY_SIZE].view(MEMORY)[0]
    reconstruct(law, known, end)
    b = law.impedance_ns_per_m
    for i in range(3):
        known.before[i] = end.position[i]
        end.command[i] = math.sqrt(2.0 * b) * known.wave[i] - b * end.velocity[i]
    return GOES_ON


@compiled
def tell(gains: Array, end: End, memory: Array) -> int:
    """The wave u = sqrt(2 b) v_m - w, with the way of the handle for v_m h, and the energy that entered.

        |u|^2 h / 2 = |w|^2 h / 2 - W

    W is the work that the rendered force gave the hand: sampling gives no energy to the wave.
    """
    law, known = gains[:LAW_SIZE].view(LAW)[0], memory[:MEMORY_SIZE].view(MEMORY)[0]
    period = end.period_s
    for i in range(3):
        way = end.position[i] - known.before[i]
        known.sent[i] += math.sqrt(2.0 * law.impedance_ns_per_m) * way - period * known.wave[i]
    energy = 0.5 * period * dot(known.wave, known.wave) - end.work_j - known.debt_j
    end.energy_j, known.debt_j = max(energy, 0.0), max(-energy, 0.0)
    _send(known, end)
    return GOES_ON


@compiled
def follow(gains: Array, end: End, memory: Array) -> int:
    """v_d = (sqrt(2 b) u + B v_s - K (x_d - x_s)) / (b + B): a wave becomes a velocity, and a force f_s.

        f_s = K (x_d - x_s) + B (v_d - v_s),   w = u - sqrt(2 / b) f_s,   x_d the integral of v_d

    f_s drives the follower. The energy |u|^2 / 2 - |w|^2 / 2 = f_s . v_d stays at this end.

    Source: as of `feel`; f_s from the coupling, so that the algebraic loop is solved.
    """
    law, known = gains[:LAW_SIZE].view(LAW)[0], memory[:MEMORY_SIZE].view(MEMORY)[0]
    if known.begun == 0:
        known.begun = 1
        for i in range(3):
            known.reference[i] = end.position[i]
    reconstruct(law, known, end)
    b, period, force = law.impedance_ns_per_m, end.period_s, scratch(3)
    back = 0.0
    for i in range(3):
        gap = known.reference[i] - end.position[i]
        pulled = law.damping_ns_per_m * end.velocity[i] - law.stiffness_n_per_m * gap
        v = (math.sqrt(2.0 * b) * known.wave[i] + pulled) / (b + law.damping_ns_per_m)
        force[i] = law.damping_ns_per_m * v - pulled
        wave = known.wave[i] - math.sqrt(2.0 / b) * force[i]
        known.reference[i] += period * v
        known.sent[i] += period * wave
        back += 0.5 * period * wave * wave
    end.energy_j = back
    drive(law.follower, known.follower, end, force)
    _send(known, end)
    return GOES_ON
