"""An arm from a file, in the form that the package's own arms have."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import mujoco
import numpy as np

from surgsim.array import Array
from surgsim.models.adopted.card import Card, card_of
from surgsim.models.adopted.collisions import find_capsules, pairs_left_out, points_of, surfaces_of
from surgsim.models.adopted.config import ArmFileConfig
from surgsim.models.adopted.findings import Findings, read_arm
from surgsim.models.adopted.form import add_text, draw, mechanics_of, write_capsules
from surgsim.models.adopted.problem import AdoptionError
from surgsim.models.adopted.surface import Surface, coarser
from surgsim.models.adopted.written import mesh_name

_MOST_DRAWN, _FEWEST_DRAWN = 6000, 200
"""Triangles: of a link, and of each of its meshes."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Adopted:
    """An arm from a file.

    Attributes:
        mechanics: The arm in the package's form, without what is only looked at. Not to be changed.
        surfaces: What is drawn, for `base` and each link.
        card: What was found, assumed and left out.
    """

    mechanics: mujoco.MjSpec
    surfaces: dict[str, list[Surface]]
    card: Card

    @cached_property
    def drawn(self) -> dict[str, list[Surface]]:
        """The surfaces as they are drawn: fine ones coarser."""
        found = {}
        for body, surfaces in self.surfaces.items():
            total = sum(len(surface.faces) for surface in surfaces)
            share = min(1.0, _MOST_DRAWN / max(total, 1))
            found[body] = [coarser(s, max(_FEWEST_DRAWN, int(share * len(s.faces)))) for s in surfaces]
        return found

    def spec(self, *, drawn: bool) -> mujoco.MjSpec:
        """A copy of the arm to be changed, with what is looked at if `drawn`."""
        spec = self.mechanics.copy()
        for body, surfaces in self.drawn.items() if drawn else ():
            for i, surface in enumerate(surfaces):
                draw(spec, body, mesh_name(body, i), surface)
        return spec


def adopted(robot: ArmFileConfig) -> Adopted:
    """The arm of the file that `robot` names; read once a process.

    Raises:
        AdoptionError: If the file or the keys of `robot` make no arm.
    """
    keys = ArmFileConfig.model_fields  # not where a scenario puts the arm
    return _adopted(ArmFileConfig.model_construct(**{key: getattr(robot, key) for key in keys}))


@lru_cache(maxsize=32)
def _adopted(robot: ArmFileConfig) -> Adopted:
    found = read_arm(robot)
    home, remark = _home(found, robot)
    spec = mechanics_of(found, home)
    drawn, solid = surfaces_of(found)
    points = {name: points_of(surfaces) for name, surfaces in solid.items()}
    capsules = find_capsules(found, points, robot)
    write_capsules(spec, capsules)
    apart, joined = pairs_left_out(spec, capsules, points, found.limits, home)
    if pairs := (*apart, *joined):
        add_text(spec, "never_touch", " ".join(f"{one}-{other}" for one, other in pairs))
    card = card_of(found, capsules, solid, joined, remark)
    add_text(spec, "description", _described(found.file.path, card))
    return Adopted(mechanics=spec, surfaces=drawn, card=card)


def _home(found: Findings, robot: ArmFileConfig) -> tuple[Array | None, str | None]:
    """The home posture (n,) [rad] that the scenario or the file's keyframe `home` gives, and a remark."""
    model, joints = found.model, found.chain.joints
    low, high = found.limits.position.T
    if robot.home_rad is not None:
        home = np.array(robot.home_rad)
        if len(home) != len(joints):
            reason = f"home_rad has {len(home)} numbers; the arm has {len(joints)} joints"
            raise AdoptionError(reason, "home_rad")
        outside = np.flatnonzero((home < low) | (home > high))
        if outside.size:
            i = int(outside[0])
            raise AdoptionError(
                f"home_rad: joint {i + 1} at {home[i]:g} rad is outside [{low[i]:.4f}, {high[i]:.4f}] rad",
                "home_rad",
            )
        return home, None
    key = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_KEY, "home")
    if key < 0:
        return None, None
    home = np.array([model.key_qpos[key][model.jnt_qposadr[j]] for j in joints])
    if np.any((home < low) | (home > high)):
        return None, "keyframe 'home', which is outside the joints' ranges"
    return home, None


def _described(path: Path, card: Card) -> str:
    return f"From {path.name}: {len(card.joints)} joints, {card.mass_kg:.1f} kg, reach {card.reach_m:.2f} m"
