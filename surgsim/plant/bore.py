"""The shaft in the cannula's bore: contact, funnel and seal friction.

World frame; the shaft's axis runs from the entry E along the unit vector u over the length L to the tip; C is
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
everything else takes energy out. The law is exact on the circle and has no tangential part. A tip that misses
the funnel's mouth stays outside the bore until it is drawn back.

Own modelling; measured ranges of the parameters and their sources are in docs/physical_port.md.
"""

import numpy as np
from numpy.typing import NDArray

from surgsim.compiled import compiled
from surgsim.models.config import WallConfig
from surgsim.spatial import cross as _cross

Array = NDArray[np.float64]
FUNNEL_LENGTH_M = 0.010
"""l_f: over this length behind the tip the shaft finds its way into the bore."""
FUNNEL_SLOPE = 0.3
"""k_f: widening of the bore per length; the mouth is 3 mm wider than the clearance."""
FADE_M = 20e-6
"""p_0: damping fades in over this penetration, so that the force is continuous at touch."""
START_REACH_M = 0.005
"""A shaft that starts this near to the bore is in it."""


cross = compiled(_cross)


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
def act(
    entry: Array,
    tip: Array,
    centre: Array,
    anchors: Array,
    axes: Array,
    slides: Array,
    qvel: Array,
    slide_qvel: Array,
    parameters: Array,
    memory: Array,
    contact_arm: Array,
    contact_cannula: Array,
    seal_arm: Array,
    seal_cannula: Array,
    stored: Array,
) -> Array:
    """Generalized forces of contact and seal, by the Jacobian's transpose.

    Args:
        entry: E (3,) [m].
        tip: Tip (3,) [m].
        centre: C (3,) [m].
        anchors: Points on the arm's axes (7, 3) [m].
        axes: Directions of the arm's axes (7, 3).
        slides: Directions of the cannula's slides (3, 3).
        qvel: Joint velocities (7,) [rad/s].
        slide_qvel: Velocities of the slides (3,) [m/s].
        parameters: From `law`.
        memory: (4,) whether the run has begun, whether the shaft is in the bore, s [m] and z [m]; zeros at
            the start, changed in place.
        contact_arm: Filled with the contact's joint torques (7,) [N m].
        contact_cannula: Filled with its force on the slides (3,) [N].
        seal_arm: Filled with the seal's joint torques (7,) [N m].
        seal_cannula: Filled with its force on the slides (3,) [N].
        stored: Filled with k p²/2 and sigma_0 z²/2 (2,) [J].

    Returns:
        F (3,) [N].
    """
    contact, seal = np.zeros(3), np.zeros(3)
    velocity = _relative_velocity(centre, anchors, axes, qvel, slides, slide_qvel)
    _forces(entry, tip, centre, velocity, parameters, memory, contact, seal, stored)
    _generalized(contact, centre, anchors, axes, slides, contact_arm, contact_cannula)
    _generalized(seal, centre, anchors, axes, slides, seal_arm, seal_cannula)
    return contact + seal


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
    length = np.sqrt(np.dot(along, along))
    if length == 0.0:
        return
    u = along / length
    s = np.dot(u, centre - entry)
    across = centre - entry - s * u
    rho = np.sqrt(np.dot(across, across))
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
    rate = np.dot(direction, velocity)
    contact[:] = -max(0.0, k * p + b * min(1.0, p / FADE_M) * rate) * direction
    stored[0] = 0.5 * k * p * p


@compiled
def _rub(u: Array, velocity: Array, parameters: Array, memory: Array, seal: Array, stored: Array) -> None:
    """Friction of the seal; keeps the bristle's stretch within what its friction holds."""
    limit, stiffness, damping = parameters[3], parameters[4], parameters[5]
    reach = limit / stiffness
    z = min(max(memory[3], -reach), reach)
    memory[3] = z
    pull = stiffness * z + damping * np.dot(u, velocity)
    seal[:] = -min(max(pull, -limit), limit) * u
    stored[1] = 0.5 * stiffness * z * z


@compiled
def _relative_velocity(
    centre: Array, anchors: Array, axes: Array, qvel: Array, slides: Array, slide_qvel: Array
) -> Array:
    """Velocity of the cannula relative to the shaft's point at its centre (3,) [m/s]."""
    v = np.zeros(3)
    for i in range(3):
        v += slide_qvel[i] * slides[i]
    for i in range(len(qvel)):
        v -= qvel[i] * cross(axes[i], centre - anchors[i])
    return v


@compiled
def _generalized(
    force: Array, centre: Array, anchors: Array, axes: Array, slides: Array, arm: Array, cannula: Array
) -> None:
    """Fill `arm` (7,) and `cannula` (3,) with J^T of a force on the cannula and its reaction on the shaft."""
    for i in range(len(arm)):
        arm[i] = -np.dot(cross(axes[i], centre - anchors[i]), force)
    for i in range(3):
        cannula[i] = np.dot(slides[i], force)
