"""Laws of contact that act as a force of their own, not through MuJoCo's solver; and what they may be."""

import mujoco

from surgsim.compiled import compiled
from surgsim.errors import SurgsimError
from surgsim.models.build import Scene
from surgsim.plant.shaft import bend_joints, lateral_masses, piece_lengths

FADE_M = 0.0005
"""d_0: damping fades in over this depth, so that the force is continuous at touch."""
LIGHTEST_TIP_KG = 0.2
"""Least effective mass that the timestep is checked for; the shipped arms' tips have 0.24 kg and more."""


@compiled
def pressure(depth: float, rate: float, stiffness: float, damping: float, ahead_s: float) -> float:
    """Force of a spring and damper that only push, Kelvin-Voigt with a damper that fades in [N].

        f = max(0, k (p + t p') + b min(1, p / d_0) p')   at the depth p > 0,   else 0

    Args:
        depth: p, how deep the tip is [m].
        rate: p' [m/s].
        stiffness: k [N/m].
        damping: b [N s/m].
        ahead_s: t, how far ahead of now the spring is read [s].
    """
    if depth <= 0.0:
        return 0.0
    share = min(1.0, depth / FADE_M)
    return max(0.0, stiffness * (depth + ahead_s * rate) + damping * share * rate)


def needs_instrument(spec: mujoco.MjSpec, part: str) -> None:
    """Refuse a scene without an instrument.

    Args:
        spec: The scene.
        part: What needs it, for the message.

    Raises:
        SurgsimError: Without one.
    """
    if all(body.name != "jaws" for body in spec.bodies):
        raise SurgsimError(f"{part} needs an instrument, and the scenario has none")


def check_step(scene: Scene, part: str, stiffness: float, damping: float, damping_key: str) -> None:
    """Refuse a timestep that a spring and a damper on the tip cannot be stepped with.

    An explicit spring k with damping b on the mass m is stable for k h^2 + 2 b h < 4 m with timestep h; a
    quarter of that is asked for.

    Args:
        scene: The compiled scene.
        part: What presses, for the message.
        stiffness: k [N/m].
        damping: b [N s/m].
        damping_key: Its keys in the scenario, for the message.

    Raises:
        SurgsimError: With what the tip bears.
    """
    h, lightest, hint = float(scene.model.opt.timestep), LIGHTEST_TIP_KG, ""
    if bend_joints(scene):
        hint = "; a shaft that bends with level static bears more with a longer settling_s"
        of_shaft = lateral_masses(scene, piece_lengths(scene).sum(keepdims=True), h)
        lightest = float(1.0 / (1.0 / lightest + 1.0 / of_shaft[0]))
    if stiffness * h**2 + damping * h > lightest:
        raise SurgsimError(
            f"{part}: k h^2 + b h must be at most {lightest:.2g} kg with stiffness_n_per_m k {stiffness:g}, "
            f"{damping_key} b {damping:g} and simulation.timestep_s h {h:g}, not "
            f"{stiffness * h**2 + damping * h:.3g} kg{hint}"
        )
