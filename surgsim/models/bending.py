"""A shaft that bends: a chain of stiff pieces on springs in place of the instrument's stiff shaft.

The tube is clamped by the adapter at the shaft's entry, and bends as Euler and Bernoulli's beam does:
curvature = moment M / E I. Each half of it, of length p, has hinges across the shaft at the two points of
Gauss's rule, whose weights are p/2:

    x = p (1/2 -+ 1/sqrt(12)),    K = E I / (p/2)                          of each hinge
    w(a) = sum_i (a - x_i)+ M(x_i) / K_i  =  integral of (a - x) M(x) / E I over 0 <= x <= a

So what a force or a moment at the tip does to the tip, deflection and slope, is exact. For forces and points
in between the rule is cut off; `docs/robustness.md` has figures.

MuJoCo takes springs explicitly: v+ = v + h M^-1 f(q), q+ = q + h v+. With the armature h² K / 4 on a hinge
that scheme is the trapezoidal rule,

    M (v+ - v) / h = -K (q_before + 2 q + q+) / 4,    q_before = q - h v,

which is stable for any stiffness and takes no energy out. The armature is of the hinge's own angle: it has no
weight, and no inertia against motions of the arm that leave the shaft straight. The damping is in proportion
to the stiffness, and implicit in MuJoCo's `implicitfast`.

A shaft that is told to settle does not swing: the straight instrument keeps all of the mass, and the hinges
go to their angles of rest under what presses on the shaft now, with two equal time constants T. Inertia K T²
and damping 2 K T on every hinge do that, whatever the others do:

    K (T² q'' + 2 T q' + q) = torque,    with the weights of the pieces beyond it in the torque

The damping is implicit, and the armature K (T - h/2)², so that both poles of a step are real and equal,
(2 T - h) / (2 T + h): without overshoot.

Sources: Timoshenko and Gere, Mechanics of Materials, for the beam; Newmark, J. Eng. Mech. Div. ASCE 85
(1959), with beta = 1/4, for the rule.
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.errors import SurgsimError
from surgsim.models.instrument import two_rods
from surgsim.models.named import Named

HALVES = 2
HINGES = 2 * HALVES
"""Places along the shaft where it bends; each has two joints."""
BEND_JOINTS = tuple(f"bend{k}_{axis}" for k in range(1, HINGES + 1) for axis in "xy")
"""From the entry on; they follow the arm's joints."""
FIRST_MODE = 3.5160153
"""Square of the first root of cos x cosh x = -1."""
_DRAWN, _LIGHTEST_KG, _HIDDEN = "shaft", 1e-3, 4
_WEIGHTLESS = 1e-6
"""Of a piece's mass: MuJoCo takes no body without any."""


@dataclass(frozen=True, kw_only=True)
class ElasticShaft:
    """What bends.

    Attributes:
        rigidity: E I of the tube [N m²].
        damping_ratio: Of its first mode, clamped at the entry and free at the tip.
        settling_s: Time constant T of a shaft that does not swing [s]; None: it swings.
    """

    rigidity: float
    damping_ratio: float
    settling_s: float | None = None


def tube_rigidity(outer_m: float, inner_m: float, young_pa: float) -> float:
    """E I = E pi (D^4 - d^4) / 64 of a tube [N m²]."""
    return young_pa * math.pi * (outer_m**4 - inner_m**4) / 64.0


def piece_end(k: int) -> str:
    """Name of the site where the piece before hinge k = 1, 2, ... ends, z along the shaft."""
    return f"bend{k}"


def hinge_places(length_m: float) -> Array:
    """Distances of the hinges from the shaft's entry (4,) [m]."""
    half = length_m / HALVES
    offsets = half * (0.5 + np.array([-1.0, 1.0]) / math.sqrt(12.0))
    return np.concatenate([k * half + offsets for k in range(HALVES)])


def first_frequency(rigidity: float, mass_kg: float, length_m: float) -> float:
    """Of a cantilever with that mass spread evenly, 3.516 sqrt(E I / m L³) [rad/s]."""
    return FIRST_MODE * math.sqrt(rigidity / (mass_kg * length_m**3))


def bends(model: Named | mujoco.MjSpec) -> int:
    """Number of the shaft's joints: 0 where it is stiff."""
    if isinstance(model, mujoco.MjSpec):
        names = {joint.name for joint in model.joints}
    else:
        names = set(model.joints().values())
    return len(BEND_JOINTS) if BEND_JOINTS[0] in names else 0


def shaft_diameter(spec: mujoco.MjSpec) -> float:
    """Of the instrument's shaft [m].

    Raises:
        SurgsimError: If the instrument is not the shipped one, or there is none.
    """
    if spec.body("instrument") is None:
        raise SurgsimError("disturbance 'bending_shaft' needs an instrument, and the scenario has none")
    drawn = spec.geom(_DRAWN)
    if drawn is None or spec.body("jaws") is None:
        raise SurgsimError(
            "disturbance 'bending_shaft' is for the shipped instrument, not for one from a file"
        )
    return 2.0 * float(drawn.size[0])


def bend_shaft(spec: mujoco.MjSpec, shaft: ElasticShaft) -> tuple[float, Array]:
    """Split the shaft at its hinges; mass, centre of mass and inertia of the straight instrument stay.

    The bodies `shaft1` to `shaft4` follow `instrument`, which keeps the shaft up to the first hinge; the jaws
    and the site `tip` go to the last one.

    Returns:
        Frequency of the first mode [rad/s], and masses of the tube's pieces on the four bodies (4,) [kg].

    Raises:
        SurgsimError: If there is no shaft that could bend, or it does already.
    """
    if bends(spec):
        raise SurgsimError("disturbance 'bending_shaft': the shaft bends already; name it once")
    radius, entry = 0.5 * shaft_diameter(spec), float(spec.site("shaft_entry").pos[2])
    body, length = spec.body("instrument"), float(spec.site("tip").pos[2]) - entry
    mass = two_rods(body.mass, float(body.ipos[2]), entry, length)[1]
    if mass < _LIGHTEST_KG:
        raise SurgsimError(
            f"disturbance 'bending_shaft': instrument.mass_kg {body.mass:g} and com_m {body.ipos[2]:g} leave "
            f"the shaft {1e3 * mass:.3g} g; it must have {1e3 * _LIGHTEST_KG:g} g"
        )
    places = hinge_places(length)
    pieces = [_Piece(a, b, mass * (b - a) / length, radius) for a, b in _spans(places, length)]
    masses = np.array([piece.mass for piece in pieces])
    if shaft.settling_s is not None:
        pieces = [replace(piece, mass=_WEIGHTLESS * piece.mass) for piece in pieces]
    _take_off(body, entry, pieces)
    last = body
    for k, piece in enumerate(pieces, start=1):
        before = -entry if k == 1 else float(places[k - 2])
        last.add_site(name=piece_end(k), pos=[0.0, 0.0, piece.begin - before], group=_HIDDEN)
        last = _add_piece(last, k, piece, piece.begin - before)
        _add_hinges(last, k, shaft, mass, length, float(spec.option.timestep))
    _draw(spec, entry, places)
    _move_end(spec, last, length - float(places[-1]))
    return first_frequency(shaft.rigidity, mass, length), masses


@dataclass(frozen=True)
class _Piece:
    """A uniform rod from `begin` to `end`, from the shaft's entry [m], of that mass [kg] and radius [m]."""

    begin: float
    end: float
    mass: float
    radius: float

    @property
    def inertia(self) -> Array:
        """About its own centre (3,) [kg m²]."""
        across = self.mass * (3.0 * self.radius**2 + (self.end - self.begin) ** 2) / 12.0
        return np.array([across, across, self.mass * self.radius**2 / 2.0])


def _spans(places: Array, length: float) -> list[tuple[float, float]]:
    return list(pairwise([*map(float, places), length]))


def _take_off(body: mujoco.MjsBody, entry: float, pieces: list[_Piece]) -> None:
    """Leave to the instrument's body what the pieces do not have."""
    total, com, inertia = float(body.mass), float(body.ipos[2]), np.array(body.inertia)
    rest = total - sum(piece.mass for piece in pieces)
    middles = [entry + 0.5 * (piece.begin + piece.end) for piece in pieces]
    centre = (total * com - sum(p.mass * z for p, z in zip(pieces, middles, strict=True))) / rest
    across = np.array([1.0, 1.0, 0.0])
    for piece, z in zip(pieces, middles, strict=True):
        inertia = inertia - piece.inertia - piece.mass * (z - com) ** 2 * across
    body.mass, body.ipos = rest, [float(body.ipos[0]), float(body.ipos[1]), centre]
    body.inertia = inertia - rest * (centre - com) ** 2 * across


def _add_piece(parent: mujoco.MjsBody, k: int, piece: _Piece, along: float) -> mujoco.MjsBody:
    return parent.add_body(
        name=f"shaft{k}",
        pos=[0.0, 0.0, along],
        mass=piece.mass,
        ipos=[0.0, 0.0, 0.5 * (piece.end - piece.begin)],
        inertia=piece.inertia,
        explicitinertial=True,
    )


def _add_hinges(
    body: mujoco.MjsBody, k: int, shaft: ElasticShaft, mass: float, length: float, timestep: float
) -> None:
    stiffness = shaft.rigidity / (0.5 * length / HALVES)
    settling = shaft.settling_s or 0.0
    rate = 2.0 * (settling or shaft.damping_ratio / first_frequency(shaft.rigidity, mass, length))
    for name, axis in zip(BEND_JOINTS[2 * k - 2 : 2 * k], np.eye(3)[:2], strict=True):
        joint = body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis)
        joint.stiffness, joint.damping = [stiffness, 0.0, 0.0], [rate * stiffness, 0.0, 0.0]
        lag = settling - 0.5 * timestep if settling else 0.5 * timestep
        joint.armature = lag**2 * stiffness


def _draw(spec: mujoco.MjSpec, entry: float, places: Array) -> None:
    """Cut the drawn shaft, whose last part are the jaws, where the pieces meet."""
    drawn = spec.geom(_DRAWN)
    radius, end = float(drawn.size[0]), float(drawn.pos[2] + drawn.size[1]) - entry
    cuts = [*map(float, places), math.inf]
    for k, (a, b) in enumerate(pairwise(cuts), start=1):
        half = 0.5 * (min(b, end) - a)
        if half > 0.0:
            spec.body(f"shaft{k}").add_geom(
                name=f"{_DRAWN}{k}",
                type=mujoco.mjtGeom.mjGEOM_CYLINDER,
                pos=[0.0, 0.0, half],
                size=[radius, half, 0.0],
                material=drawn.material,
                mass=0.0,
                contype=0,
                conaffinity=0,
                group=2,
            )
    half = 0.5 * min(float(places[0]), end)
    drawn.pos, drawn.size = [0.0, 0.0, entry + half], [radius, half, 0.0]


def _move_end(spec: mujoco.MjSpec, last: mujoco.MjsBody, along: float) -> None:
    """Give the jaws and the site of the tip to the last piece."""
    jaws, tip = spec.body("jaws"), spec.site("tip")
    spec.copy_during_attach = True  # MuJoCo moves no body within a model
    moved = last.add_frame(pos=[0.0, 0.0, along]).attach_body(jaws, "moved/", "")
    spec.delete(jaws)
    moved.name, moved.pos = "jaws", [0.0, 0.0, 0.0]
    spec.delete(tip)
    last.add_site(name="tip", pos=[0.0, 0.0, along], group=_HIDDEN)
