"""What every disturbance, prop and plant promises."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from surgsim.array import Array
from surgsim.contract.arms import arm_of, on_every_arm
from surgsim.contract.check import Check, require
from surgsim.contract.problems import DT, random_q
from surgsim.models.build import Scene, build
from surgsim.models.config import SceneConfig
from surgsim.plant import PLANTS
from surgsim.plant.base import Plant


def _part(config: Any) -> Any:
    return config().build(np.random.default_rng(0))


def _plant(scene: SceneConfig, part: Any) -> Any:
    return PLANTS.config("dynamic")().build(build(scene, [part]), DT, [part], np.random.SeedSequence(3))  # type: ignore[attr-defined]


def _rows(states: Sequence[Any]) -> Array:
    return np.array([np.concatenate([s.q, s.v, s.tau, s.p_WC]) for s in states])


def _fall(plant: Any, q: Array, steps: int = 60) -> Array:
    """States under a torque that swings."""
    states = [plant.reset(q)]
    states += [plant.step(np.full_like(q, 2.0 * np.sin(0.3 * k)), np.zeros_like(q)) for k in range(steps)]
    return _rows(states)


def _same(a: ArrayLike, b: ArrayLike) -> bool:
    return bool(np.array_equal(a, b))


@on_every_arm
def deterministic(config: Any, scene: SceneConfig) -> None:
    """A plant with the part is finite, repeats itself under a seed, and starts afresh."""
    q = random_q(arm_of(scene), np.random.default_rng(0))
    plant = _plant(scene, _part(config))
    first = _fall(plant, q)
    require(np.isfinite(first).all(), "a state is not finite")
    require(_same(_fall(plant, q), first), "after a reset the plant moves otherwise")
    again = _fall(_plant(scene, _part(config)), q)
    require(_same(again, first), "with the same seed a new plant moves otherwise")
    plant.reset(q)
    require(_same(plant.truth().q, q), "after a reset the arm is not where it was put")


def _left(config: Any, scene: SceneConfig) -> Scene:
    """The scene with the part, if the arm keeps its joints, motors and limits."""
    limits, built = arm_of(scene).limits, build(scene, [_part(config)])
    n = limits.q_max.size
    require(built.model.nu == n, f"the scene has {built.model.nu} motors, not {n}")
    require(len(built.qpos_ids) == n, f"the arm has {len(built.qpos_ids)} joints, not {n}")
    require(_same(built.limits.q_max, limits.q_max), "the joint limits have changed")
    return built


@on_every_arm
def leaves_the_arm(config: Any, scene: SceneConfig) -> None:
    """The arm keeps its motors and its limits: what the controller knows stays true."""
    _left(config, scene)


@on_every_arm
def leaves_the_joints(config: Any, scene: SceneConfig) -> None:
    """A disturbance adds no joints but those that it tells of: the controller's model has the others."""
    built = _left(config, scene)
    free, wanted = built.model.nv, len(built.qpos_ids) + _part(config).adds_joints
    require(free == wanted, f"the scene has {free} degrees of freedom, not {wanted}")


@on_every_arm
def has_what_is_used(config: Any, scene: SceneConfig) -> None:
    """The plant has all that the loop and what stands around it use, see `surgsim.plant.base.Plant`."""
    plant = config().build(build(scene), DT, (), np.random.SeedSequence(0))
    missing = [name for name in vars(Plant) if not name.startswith("_") and not hasattr(plant, name)]
    require(not missing, f"the plant has no {', '.join(missing)}")


@on_every_arm
def plant_starts_afresh(config: Any, scene: SceneConfig) -> None:
    """States begin at zero time where the arm was put, move, repeat themselves, and are the reader's own."""
    q = random_q(arm_of(scene), np.random.default_rng(1))
    n, plant = q.size, config().build(build(scene), DT, (), np.random.SeedSequence(0))

    def run() -> list[Any]:
        return [plant.reset(q)] + [plant.step(np.full(n, 1.0), np.full(n, 0.1)) for _ in range(5)]

    states = run()
    first = _rows(states)
    require(states[0].t_s == 0.0, f"the first state is at {states[0].t_s} s")
    require(abs(states[-1].t_s - 5 * DT) < 1e-9, f"after five periods it is {states[-1].t_s} s")
    require(_same(first[0, : 2 * n], [*q, *np.zeros(n)]), "the arm does not begin at rest where it was put")
    require(np.abs(first[-1, :n] - q).max() > 1e-6, "the arm does not move")
    require(_same(_rows(run()), first), "after a reset the plant moves otherwise")
    require(_same(_rows(states), first), "states of an earlier run have changed")
    trocar = scene.trocar
    seen = trocar is not None and np.allclose(states[-1].p_WC, trocar.position_m)
    require(seen, f"the trocar is seen at {states[-1].p_WC}")


_STEADY = Check(name="is deterministic under a seed and starts afresh", run=deterministic)
_KNOWN = "leaves the arm as the controller knows it"
DISTURBANCE_CHECKS = (_STEADY, Check(name=_KNOWN, run=leaves_the_joints))
PROP_CHECKS = (_STEADY, Check(name=_KNOWN, run=leaves_the_arm))
PLANT_CHECKS = (
    Check(name="has all that a run uses", run=has_what_is_used),
    Check(name="resets cleanly, and its states are the reader's own", run=plant_starts_afresh),
)
