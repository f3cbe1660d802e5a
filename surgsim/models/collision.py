"""Shapes between which forbidden contacts are looked for: capsules along the arm, patient and table.

They are no geoms of the model: they are seen, exert no force and are not drawn, and they are there whether
the theatre is drawn or not. The robot's folder says where its links' capsules are; the patient is the drawn
abdomen's ellipsoid, the table a box.
"""

from dataclasses import dataclass
from functools import lru_cache

import mujoco
import numpy as np
from numpy.typing import NDArray

from surgsim.array import Array
from surgsim.models.adopted.capsules import capsules_in
from surgsim.models.adopted.collisions import ADAPTER_M, ADAPTER_RADIUS_M
from surgsim.models.adopted.touching import NEXT_THAT_CAN_TOUCH
from surgsim.models.config import InstrumentConfig, SceneConfig
from surgsim.models.graft import asset
from surgsim.models.named import Named
from surgsim.models.robot import joint_names, link_names
from surgsim.models.theatre import patient_place

Ids = NDArray[np.intp]
NEVER_TOUCH = "never_touch"
BENT_PART = "bent part"
_TABLE_CENTRE_M, _TABLE_HALF_M = (0.0, -0.13, -0.223), (0.268, 0.98, 0.054)  # pads and top of the drawn table


@dataclass(frozen=True, kw_only=True, eq=False)
class CollisionShapes:
    """Where forbidden contacts are looked for.

    Attributes:
        names: Of the n capsules, from the base on; with an instrument its adapter and shaft follow, and of
            one with an angled tip its bent part, from the shaft's end to the tip, as thick as the shaft.
        bodies: The body that each is fixed to (n,).
        ends: End points in the body's frame (n, 2, 3) [m].
        radii: (n,) [m].
        pairs: Capsules that can touch each other (m, 2).
        shaft: Row of the shaft, -1 without an instrument; what follows it goes through the port with it.
        patient: Rows: centre of the abdomen from the port, cosine and sine of its turn about the vertical
            and 0, semi-axes, centre of the table in the patient's frame, its half sizes (5, 3) [m]; (0, 3)
            without trocar.
    """

    names: tuple[str, ...]
    bodies: Ids
    ends: Array
    radii: Array
    pairs: Ids
    shaft: int
    patient: Array


def collision_shapes(model: Named, config: SceneConfig) -> CollisionShapes:
    """Shapes of the arm that `config` describes, in the compiled `model`."""
    joints = len(joint_names(model))
    bodies = ("base", *link_names(joints))
    capsules = [(name, name, *capsule) for name in bodies for capsule in _capsules(model, name)]
    if config.instrument is not None:
        capsules += _of_instrument(config.instrument)
    names = tuple(name for name, *_ in capsules)
    return CollisionShapes(
        names=names,
        bodies=np.array([model.body(body).id for _, body, *_ in capsules], dtype=np.intp),
        ends=np.array([[one, other] for *_, one, other, _ in capsules]),
        radii=np.array([radius for *_, radius in capsules]),
        pairs=_pairs(names, (*bodies, "adapter", "shaft"), _left_out(model, config.instrument)),
        shaft=names.index("shaft") if "shaft" in names else -1,
        patient=_patient(config),
    )


def _capsules(model: Named, body: str) -> list[tuple[Array, Array, float]]:
    """End points (3,) [m] in the body's frame and radius [m] of the capsules of an arm's body."""
    if model.find(mujoco.mjtObj.mjOBJ_NUMERIC, f"capsule_{body}") < 0:
        return []
    found = capsules_in(model.numeric(f"capsule_{body}").data)
    return [(*capsule.ends, capsule.radius) for capsule in found]


def _of_instrument(instrument: InstrumentConfig) -> list[tuple[str, str, Array, Array, float]]:
    """Name, body, end points (3,) [m] and radius [m] of the instrument's capsules."""
    entry, tip = instrument.adapter_length_m, instrument.shaft_length_m
    tip += entry
    below = (0.0, 0.0, max(0.0, entry - ADAPTER_RADIUS_M))
    radius = 0.5 * instrument.shaft_diameter_m
    ends = np.array([0.0, 0.0, entry]), np.array([0.0, 0.0, tip - radius])
    found = [
        ("adapter", "instrument", np.zeros(3), np.array(below), ADAPTER_RADIUS_M),
        ("shaft", "instrument", *ends, radius),
    ]
    bent = instrument.p_ST
    length = float(np.linalg.norm(bent))
    if length > 0.0:
        end = np.array([0.0, 0.0, tip])
        round_tip = end + max(0.0, 1.0 - radius / length) * bent
        found.append((BENT_PART, "instrument", end, round_tip, radius))
    return found


def _left_out(model: Named, instrument: InstrumentConfig | None) -> set[tuple[str, str]]:
    """Pairs that the arm's text `never_touch` names; its adapter is a short one on the flange itself."""
    words = (model.text(NEVER_TOUCH) or "").split()
    pairs = {(one, other) for one, _, other in (word.partition("-") for word in words)}
    usual = instrument is not None and not instrument.of_file and instrument.holder is None
    if usual and instrument is not None and instrument.adapter_length_m <= ADAPTER_M:
        return pairs
    return {pair for pair in pairs if "adapter" not in pair}


def _pairs(names: tuple[str, ...], along: tuple[str, ...], left_out: set[tuple[str, str]]) -> Ids:
    """Capsules that are far enough apart along the chain, `along` which the parts stand.

    The bent wrist holds the adapter beside the link above it, the third from the end. The bent part stands
    with the shaft.
    """
    place = {name: i for i, name in enumerate(along)}
    place[BENT_PART] = place["shaft"]
    near = {(along[-5], "adapter")} | left_out
    pairs = [
        (i, j)
        for i, one in enumerate(names)
        for j, other in enumerate(names)
        if place[other] - place[one] >= NEXT_THAT_CAN_TOUCH and (one, other) not in near
    ]
    return np.array(pairs, dtype=np.intp).reshape(-1, 2)


def _patient(config: SceneConfig) -> Array:
    if config.trocar is None:
        return np.zeros((0, 3))
    centre, heading = patient_place(config, config.trocar, abdomen_semi_axes())
    turn = [np.cos(heading), np.sin(heading), 0.0]
    offset = centre - np.array(config.trocar.position_m)
    return np.array([offset, turn, abdomen_semi_axes(), _TABLE_CENTRE_M, _TABLE_HALF_M])


@lru_cache(maxsize=1)
def abdomen_semi_axes() -> Array:
    """Semi-axes (3,) [m] of the drawn abdomen, read-only."""
    size = np.array(asset("theatre/patient.xml").geom("abdomen").size)
    size.flags.writeable = False
    return size
