"""The shaft in the cannula's bore: contact, funnel and seal friction.

World frame; the shaft's axis runs from the entry E along the unit vector u over the length L to its end; C is
the cannula's centre:

    s = u . (C - E),   rho n = (I - u u^T) (C - E),   |n| = 1

The bore is a thin ring about C that pivots with the shaft, so it resists only the distance rho. With the
clearance c (half of bore minus shaft diameter) and a funnel that widens it over the shaft's last centimetre:

    p = rho - c - k_f max(0, s - L + l_f)                     penetration
    f = max(0, k p + b min(1, p/p_0) p')  for p > 0           contact
    g = clip(sigma_0 z + sigma_1 s', -F_c, F_c)               seal: an elastic, perfectly plastic bristle
    z' = s', kept within +-F_c / sigma_0
    F = -f (n - p_s u) - g u,  p_s = k_f in the funnel else 0    force of the shaft on the cannula

F and -F act at the same point C, so that p' = (n - p_s u) . v and s' = u . v with the velocity v of the
cannula relative to the shaft's point at C: the elastic parts have the potentials k p²/2 and sigma_0 z²/2, and
everything else takes energy out. Of a shaft that bends, the axis is that of its piece in the bore
(`surgsim.plant.shaft`). The law is exact on the circle and has no tangential part. A tip that misses
the funnel's mouth stays outside the bore until it is drawn back.

Own modelling; measured ranges of the parameters and their sources are in docs/physical_port.md.
"""

from typing import ClassVar

import numpy as np

from surgsim.array import Array
from surgsim.compiled import compiled
from surgsim.models.bending import BEND_JOINTS
from surgsim.models.config import WallConfig
from surgsim.plant.shaft import shaft_line
from surgsim.tick.algebra import cross, dot
from surgsim.tick.arrays import Record, World
from surgsim.tick.scratch import scratch
from surgsim.tick.views import body_place, doubles, vector

FUNNEL_LENGTH_M = 0.010
"""l_f: over this length behind the tip the shaft finds its way into the bore."""
FUNNEL_SLOPE = 0.3
"""k_f: widening of the bore per length; the mouth is 3 mm wider than the clearance."""
FADE_M = 20e-6
"""p_0: damping fades in over this penetration, so that the force is continuous at touch."""
START_REACH_M = 0.005
"""A shaft that starts this near to the bore is in it."""
_BENDS = str(len(BEND_JOINTS))


class Push(Record):
    """Generalized forces of the bore at one instant.

    Attributes:
        contact_arm: Contact's joint torques (n,) [N m].
        contact_shaft: Its torques at the joints of a shaft that bends (8,) [N m].
        contact_cannula: Its force on the cannula's slides (3,) [N].
        seal_arm: Seal's joint torques (n,) [N m].
        seal_shaft: Its torques at the joints of a shaft that bends (8,) [N m].
        seal_cannula: Its force on the slides (3,) [N].
        stored: Elastic energy k p²/2 and sigma_0 z²/2 (2,) [J].
        force: F of the shaft on the cannula (3,) [N].
        memory: Whether the run has begun, whether the shaft is in the bore, s [m] and z [m] (4,).
    """

    SHAPES: ClassVar[dict[str, str]] = {
        "contact_arm": "n",
        "contact_shaft": _BENDS,
        "contact_cannula": "3",
        "seal_arm": "n",
        "seal_shaft": _BENDS,
        "seal_cannula": "3",
        "stored": "2",
        "force": "3",
        "memory": "4",
    }
    contact_arm: Array
    contact_shaft: Array
    contact_cannula: Array
    seal_arm: Array
    seal_shaft: Array
    seal_cannula: Array
    stored: Array
    force: Array
    memory: Array


class Bore(Record):
    """What the law of the bore needs besides the world, and where its forces go.

    Attributes:
        cannula: The cannula's body.
        first_slide: Where the cannula's joints begin.
        first_dof: Where their velocities begin.
        bends: Joints of a shaft that bends, which follow the arm's; 0: it is stiff.
        parameters: From `law` (6,).
        frame: Rotation of the port's frame (3, 3).
        stiffness: Of the cannula's slides (3,) [N/m].
        damping: Of the cannula's slides (3,) [N s/m].
        offset: Displacement of the place of rest in the port's frame (3,) [m].
        velocity: Its velocity (3,) [m/s].
        drive: Force of the wall's motion on the slides (3,) [N].
        acting: What acted at the last `act`.
        trial: What would act at the present state.
    """

    SHAPES: ClassVar[dict[str, str]] = {
        "parameters": "6",
        "frame": "3 3",
        **{name: "3" for name in ("stiffness", "damping", "offset", "velocity", "drive")},
    }
    cannula: int
    first_slide: int
    first_dof: int
    bends: int
    parameters: Array
    frame: Array
    stiffness: Array
    damping: Array
    offset: Array
    velocity: Array
    drive: Array
    acting: Push
    trial: Push


def law(wall: WallConfig, clearance_m: float) -> Array:
    """Parameters of `forces` (6,): c, k, b, F_c, sigma_0, sigma_1."""
    return np.array(
        [
            clearance_m,
            wall.contact_stiffness_n_per_m,
            wall.contact_damping_n_s_per_m,
            wall.seal_friction_n,
            wall.seal_stiffness_n_per_m,
            wall.seal_damping_n_s_per_m,
        ]
    )


@compiled
def drag(bore: Bore, world: World) -> None:
    """Refer the wall's spring and damper to the moved place of rest: K o + D o' on the slides."""
    applied = vector(world.qfrc_applied, world.nv)
    for k in range(3):
        o = v = 0.0
        for i in range(3):
            o += world.port_offset[i] * bore.frame[i, k]
            v += world.port_velocity[i] * bore.frame[i, k]
        bore.offset[k], bore.velocity[k] = o, v
        bore.drive[k] = bore.stiffness[k] * o + bore.damping[k] * v
        applied[bore.first_dof + k] += bore.drive[k]


@compiled
def act(bore: Bore, world: World) -> None:
    """Add contact and seal to the applied forces."""
    push, applied = bore.acting, vector(world.qfrc_applied, world.nv)
    fill_push(bore, world, push)
    for i in range(push.contact_arm.size):
        applied[world.first_dof + i] += push.contact_arm[i]
        applied[world.first_dof + i] += push.seal_arm[i]
    for i in range(bore.bends):
        applied[world.first_dof + world.q.size + i] += push.contact_shaft[i] + push.seal_shaft[i]
    for i in range(3):
        applied[bore.first_dof + i] += push.contact_cannula[i]
        applied[bore.first_dof + i] += push.seal_cannula[i]


@compiled
def wall_force(bore: Bore, world: World, out: Array) -> None:
    """Fill `out` (3,) [N] with the force of the shaft on the cannula now; nothing is remembered."""
    for i in range(4):
        bore.trial.memory[i] = bore.acting.memory[i]
    fill_push(bore, world, bore.trial)
    for i in range(3):
        out[i] = bore.trial.force[i]


@compiled
def fill_push(bore: Bore, world: World, out: Push) -> None:
    """Generalized forces of contact and seal, by the Jacobian's transpose; `out.memory` goes on."""
    contact, seal, velocity = np.zeros(3), np.zeros(3), np.zeros(3)
    centre = body_place(world, bore.cannula)
    entry, tip = scratch(3), scratch(3)
    moved = shaft_line(world, bore.bends, centre, entry, tip)
    _relative_velocity(bore, world, centre, moved, velocity)
    _forces(entry, tip, centre, velocity, bore.parameters, out.memory, contact, seal, out.stored)
    _generalized(contact, bore, world, centre, out.contact_arm, out.contact_cannula)
    _generalized(seal, bore, world, centre, out.seal_arm, out.seal_cannula)
    _bend(contact, world, centre, moved, out.contact_shaft)
    _bend(seal, world, centre, moved, out.seal_shaft)
    for i in range(3):
        out.force[i] = contact[i] + seal[i]


@compiled
def _forces(
    entry: Array,
    tip: Array,
    centre: Array,
    velocity: Array,
    parameters: Array,
    memory: Array,
    contact: Array,
    seal: Array,
    stored: Array,
) -> None:
    """Fill `contact` and `seal` (3,) [N], the parts of F, and `stored` (2,) [J]."""
    contact[:] = 0.0
    seal[:] = 0.0
    stored[:] = 0.0
    along = tip - entry
    length = np.sqrt(dot(along, along))
    if length == 0.0:
        return
    u = along / length
    s = dot(u, centre - entry)
    across = centre - entry - s * u
    rho = np.sqrt(dot(across, across))
    slope = FUNNEL_SLOPE if s > length - FUNNEL_LENGTH_M else 0.0
    gap = parameters[0] + slope * (s - length + FUNNEL_LENGTH_M)
    _enter(s, length, rho - gap, memory)
    if memory[1] == 0.0:
        return
    if rho > gap:
        direction = across / rho - slope * u
        _press(rho - gap, direction, velocity, parameters, contact, stored)
    _rub(u, velocity, parameters, memory, seal, stored)


@compiled
def _enter(s: float, length: float, penetration: float, memory: Array) -> None:
    """Whether the shaft is in the bore, and how far the seal's lip is bent."""
    covered = 0.0 <= s <= length
    if memory[0] == 0.0:
        inside = covered and penetration <= START_REACH_M
        stretch = 0.0
    else:
        came = not 0.0 <= memory[2] <= length
        inside = covered and (memory[1] == 1.0 or (came and penetration <= 0.0))
        stretch = memory[3] + s - memory[2] if inside and memory[1] == 1.0 else 0.0
    memory[0], memory[1], memory[2], memory[3] = 1.0, 1.0 if inside else 0.0, s, stretch


@compiled
def _press(
    p: float, direction: Array, velocity: Array, parameters: Array, contact: Array, stored: Array
) -> None:
    """Contact at penetration p > 0."""
    k, b = parameters[1], parameters[2]
    rate = dot(direction, velocity)
    contact[:] = -max(0.0, k * p + b * min(1.0, p / FADE_M) * rate) * direction
    stored[0] = 0.5 * k * p * p


@compiled
def _rub(u: Array, velocity: Array, parameters: Array, memory: Array, seal: Array, stored: Array) -> None:
    """Friction of the seal; keeps the bristle's stretch within what its friction holds."""
    limit, stiffness, damping = parameters[3], parameters[4], parameters[5]
    reach = limit / stiffness
    z = min(max(memory[3], -reach), reach)
    memory[3] = z
    pull = stiffness * z + damping * dot(u, velocity)
    seal[:] = -min(max(pull, -limit), limit) * u
    stored[1] = 0.5 * stiffness * z * z


@compiled
def _relative_velocity(bore: Bore, world: World, centre: Array, moved: int, v: Array) -> None:
    """Velocity of the cannula relative to the shaft's point at its centre (3,) [m/s].

    That point is moved by the arm's joints and the first `moved` of the shaft's.
    """
    axes, anchors = doubles(world.xaxis, world.njnt, 3), doubles(world.xanchor, world.njnt, 3)
    qvel, arm, turned = vector(world.qvel, world.nv), scratch(3), scratch(3)
    for i in range(3):
        for k in range(3):
            v[k] += qvel[bore.first_dof + i] * axes[bore.first_slide + i, k]
    for i in range(world.q.size + moved):
        for k in range(3):
            arm[k] = centre[k] - anchors[world.first_joint + i, k]
        cross(axes[world.first_joint + i], arm, turned)
        for k in range(3):
            v[k] -= qvel[world.first_dof + i] * turned[k]


@compiled
def _generalized(force: Array, bore: Bore, world: World, centre: Array, arm: Array, cannula: Array) -> None:
    """Fill `arm` (n,) and `cannula` (3,) with J^T of a force on the cannula and its reaction on the shaft."""
    axes, anchors = doubles(world.xaxis, world.njnt, 3), doubles(world.xanchor, world.njnt, 3)
    lever, turned = scratch(3), scratch(3)
    for i in range(arm.size):
        for k in range(3):
            lever[k] = centre[k] - anchors[world.first_joint + i, k]
        cross(axes[world.first_joint + i], lever, turned)
        arm[i] = -dot(turned, force)
    for i in range(3):
        cannula[i] = dot(axes[bore.first_slide + i], force)


@compiled
def _bend(force: Array, world: World, centre: Array, moved: int, shaft: Array) -> None:
    """Fill `shaft` (8,) with J^T of the reaction on the shaft; only its first `moved` joints feel it."""
    axes, anchors = doubles(world.xaxis, world.njnt, 3), doubles(world.xanchor, world.njnt, 3)
    lever, turned = scratch(3), scratch(3)
    for i in range(shaft.size):
        shaft[i] = 0.0
    for i in range(moved):
        joint = world.first_joint + world.q.size + i
        for k in range(3):
            lever[k] = centre[k] - anchors[joint, k]
        cross(axes[joint], lever, turned)
        shaft[i] = -dot(turned, force)
