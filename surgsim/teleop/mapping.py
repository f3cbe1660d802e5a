"""Alignment of the console with the remote world, and the force law written in it."""

import math
from itertools import pairwise
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import NonNegativeFloat, PositiveFloat, model_validator

from surgsim.array import Array
from surgsim.catalog import PartConfig
from surgsim.compiled import compiled
from surgsim.tick.arrays import Record


class ScaleChangeConfig(PartConfig):
    """From `at_s` on the motion scaling goes to `scale`."""

    at_s: NonNegativeFloat
    scale: PositiveFloat


class MappingConfig(PartConfig):
    """Motion scaling and rotation between console and remote world.

    `scale` is remote motion over handle motion; `rotation_wxyz` turns console axes O into world axes W.
    `scale_changes` change it during a run, each within `scale_ramp_s`. `clutch_fade_s` is how long the clutch
    takes to open or close. Both keep the command free of steps, and are assumptions.
    """

    scale: PositiveFloat = 0.5
    rotation_wxyz: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    clutch_fade_s: PositiveFloat = 0.1
    scale_changes: tuple[ScaleChangeConfig, ...] = ()
    scale_ramp_s: PositiveFloat = 0.5

    @model_validator(mode="after")
    def _quaternion_is_unit(self) -> Self:
        norm = float(np.linalg.norm(self.rotation_wxyz))
        if abs(norm - 1.0) > 1e-6:
            raise ValueError(f"rotation_wxyz must have norm 1, not {norm:g}")
        return self

    @model_validator(mode="after")
    def _changes_are_in_order(self) -> Self:
        times = [change.at_s for change in self.scale_changes]
        for before, after in pairwise(times):
            if after <= before:
                raise ValueError(f"scale_changes must be in order of time, not at_s {before:g}, {after:g}")
        return self

    def change_rows(self) -> Array:
        """When each change begins [s] and where it leads to (k, 2)."""
        return np.array([(change.at_s, change.scale) for change in self.scale_changes]).reshape(-1, 2)


def rotation_matrix(wxyz: ArrayLike) -> Array:
    """Rotation matrix (3, 3) of a unit quaternion (w, x, y, z)."""
    w, x, y, z = (float(value) for value in np.asarray(wxyz))
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


class MappingLaw(Record):
    """Numbers of the mapping.

    Attributes:
        fade_step: Share of the clutch's way from open to closed that it makes in a period.
        scale: Motion scaling at first.
        ramp_s: How long a change of it takes [s].
        changes: Where the rows of its changes begin in the gains.
        change_count: How many there are.
    """

    fade_step: float
    scale: float
    ramp_s: float
    changes: int
    change_count: int


class Mapping(Record):
    """p_W = home_W + e s R_WO (p_O - home_O).

    With the clutch open e is 0: the handle moves and the tip that it stands for stays.

    Attributes:
        scale: s, remote motion over handle motion.
        closed: How far the clutch is on its way from open, 0, to closed, 1.
        engaged: e = (1 - cos(pi closed)) / 2, share of the handle's motion that is passed on.
        R_WO: Console axes in the world (3, 3).
        home_O: Handle position that belongs to `home_W` (3,) [m].
        home_W: Remote tip position that belongs to `home_O` (3,) [m].
    """

    SHAPES: ClassVar[dict[str, str]] = {"R_WO": "3 3", "home_O": "3", "home_W": "3"}
    scale: float
    closed: float
    engaged: float
    R_WO: Array
    home_O: Array
    home_W: Array


def align(mapping: Mapping, config: MappingConfig, home_O: ArrayLike, home_W: ArrayLike) -> None:
    """Let the handle at `home_O` (3,) [m] stand for the tip at `home_W` (3,) [m]."""
    mapping.scale, mapping.R_WO[:] = config.scale, rotation_matrix(config.rotation_wxyz)
    mapping.closed = mapping.engaged = 1.0
    mapping.home_O[:], mapping.home_W[:] = home_O, home_W


def describe_mapping(law: MappingLaw, config: MappingConfig, period_s: float) -> None:
    """Fill the numbers for a control period [s], but for where the changes are."""
    law.fade_step = period_s / config.clutch_fade_s
    law.scale, law.ramp_s, law.change_count = config.scale, config.scale_ramp_s, len(config.scale_changes)


@compiled
def scale_at(law: MappingLaw, gains: Array, t_s: float) -> float:
    """Motion scaling at a time [s]: half a cosine from one scale to the next, continuous if they overlap."""
    scale = law.scale
    for k in range(law.change_count):
        begin_s, wanted = gains[law.changes + 2 * k], gains[law.changes + 2 * k + 1]
        gone = (t_s - begin_s) / law.ramp_s
        if gone >= 1.0:
            scale = wanted
        elif gone > 0.0:
            scale += 0.5 * (1.0 - math.cos(math.pi * gone)) * (wanted - scale)
    return scale


@compiled
def remap(law: MappingLaw, gains: Array, mapping: Mapping, t_s: float, p_O: Array, opens: int) -> None:
    """Let clutch and scale go on, for the period that begins at `t_s` [s] with the handle at `p_O` (3,) [m].

    The gain g = e s holds for a period, and the mapping gets a new offset with every new g, so that the tip
    it stands for moves by g R_WO dp_O and never steps. Forces are passed on by the same g: a transformer of
    changing ratio, which makes and takes no energy at any g.
    """
    closed = min(max(mapping.closed + (-law.fade_step if opens else law.fade_step), 0.0), 1.0)
    scale = scale_at(law, gains, t_s)
    if closed == mapping.closed and scale == mapping.scale:
        return
    told = np.empty(3)
    to_remote(mapping, p_O, told)
    for i in range(3):
        mapping.home_O[i], mapping.home_W[i] = p_O[i], told[i]
    mapping.scale, mapping.closed = scale, closed
    mapping.engaged = 0.5 * (1.0 - math.cos(math.pi * closed))


@compiled
def to_remote(mapping: Mapping, p_O: Array, out: Array) -> None:
    """Tip position (3,) for a handle position (3,)."""
    gain = mapping.engaged * mapping.scale
    for i in range(3):
        turned = 0.0
        for k in range(3):
            turned += mapping.R_WO[i, k] * (p_O[k] - mapping.home_O[k])
        out[i] = mapping.home_W[i] + gain * turned


@compiled
def to_console(mapping: Mapping, p_W: Array, out: Array) -> None:
    """Handle position (3,) for a tip position (3,), as with the clutch closed."""
    for i in range(3):
        turned = 0.0
        for k in range(3):
            turned += (p_W[k] - mapping.home_W[k]) * mapping.R_WO[k, i]
        out[i] = mapping.home_O[i] + turned / mapping.scale


@compiled
def motion_to_remote(mapping: Mapping, v_O: Array, out: Array) -> None:
    """Remote displacement or velocity e s R_WO v_O (3,); not in place."""
    gain = mapping.engaged * mapping.scale
    for i in range(3):
        turned = 0.0
        for k in range(3):
            turned += mapping.R_WO[i, k] * v_O[k]
        out[i] = gain * turned


@compiled
def motion_to_console(mapping: Mapping, v_W: Array, out: Array) -> None:
    """Handle displacement or velocity R_OW v_W / s (3,), as with the clutch closed; not in place."""
    for i in range(3):
        turned = 0.0
        for k in range(3):
            turned += v_W[k] * mapping.R_WO[k, i]
        out[i] = turned / mapping.scale


@compiled
def force_to_remote(mapping: Mapping, f_O: Array, out: Array) -> None:
    """Force e R_WO f_O / s (3,) at the tip; not in place.

    With the clutch closed it has the power of f_O at the handle; with an open one nothing gets there.
    """
    for i in range(3):
        turned = 0.0
        for k in range(3):
            turned += mapping.R_WO[i, k] * f_O[k]
        out[i] = mapping.engaged * (turned / mapping.scale)


@compiled
def force_to_console(mapping: Mapping, f_W: Array, out: Array) -> None:
    """Force e s R_OW f_W (3,) at the handle that has the power of f_W at the tip; not in place."""
    gain = mapping.engaged * mapping.scale
    for i in range(3):
        turned = 0.0
        for k in range(3):
            turned += f_W[k] * mapping.R_WO[k, i]
        out[i] = gain * turned


@compiled
def feedback_force(
    mapping: Mapping, p_handle_O: Array, p_tip_W: Array, stiffness_n_per_m: float, out: Array
) -> None:
    """Force on the handle in console axes (3,) [N]: F = e K_v (x_r(t - delta) - x_o(t)).

    Args:
        mapping: Brings the tip into the console.
        p_handle_O: Handle position x_o (3,) [m].
        p_tip_W: Remote tip position as last received, x_r(t - delta) (3,) [m].
        stiffness_n_per_m: K_v, per metre of handle motion.
        out: Filled with the force.

    Source:
        Section 2.2 of the passive teleoperation paper (10.1002/rnc.7613), which has no clutch (e = 1); the
        joint torques follow as J^T F.
    """
    to_console(mapping, p_tip_W, out)
    for i in range(3):
        out[i] = mapping.engaged * (stiffness_n_per_m * (out[i] - p_handle_O[i]))
