"""What every disturbance, prop and plant promises."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surgsim.contract.check import Check, require
from surgsim.contract.problems import DT, arm, random_q
from surgsim.models.build import Scene, build
from surgsim.models.config import RobotConfig, SceneConfig, TrocarConfig
from surgsim.plant import PLANTS

Array = NDArray[np.float64]
SCENE = SceneConfig(
    robot=RobotConfig(name="lwr4plus"), trocar=TrocarConfig(position_m=(0.0, 0.55, 0.2)), theatre=False
)


def _part(config: Any) -> Any:
    return config().build(np.random.default_rng(0))


def _plant(part: Any) -> Any:
    return PLANTS.config("dynamic")().build(build(SCENE, [part]), DT, [part], np.random.SeedSequence(3))  # type: ignore[attr-defined]


def _rows(states: Sequence[Any]) -> Array:
    return np.array([np.concatenate([s.q, s.v, s.tau, s.p_WC]) for s in states])


def _fall(plant: Any, q: Array, steps: int = 60) -> Array:
    """States under a torque that swings."""
    states = [plant.reset(q)]
    states += [plant.step(np.full(7, 2.0 * np.sin(0.3 * k)), np.zeros(7)) for k in range(steps)]
    return _rows(states)


def _same(a: ArrayLike, b: ArrayLike) -> bool:
    return bool(np.array_equal(a, b))


def deterministic(config: Any) -> None:
    """A plant with the part is finite, repeats itself under a seed, and starts afresh."""
    q = random_q(np.random.default_rng(0))
    plant = _plant(_part(config))
    first = _fall(plant, q)
    require(np.isfinite(first).all(), "a state is not finite")
    require(_same(_fall(plant, q), first), "after a reset the plant moves otherwise")
    require(_same(_fall(_plant(_part(config)), q), first), "with the same seed a new plant moves otherwise")
    plant.reset(q)
    require(_same(plant.truth().q, q), "after a reset the arm is not where it was put")


def leaves_the_arm(config: Any) -> None:
    """The arm keeps its seven motors and its limits: what the controller knows stays true."""
    scene: Scene = build(SCENE, [_part(config)])
    require(scene.model.nu == 7, f"the scene has {scene.model.nu} motors, not 7")
    require(len(scene.qpos_ids) == 7, "the arm has not its seven joints")
    require(_same(scene.limits.q_max, arm().limits.q_max), "the joint limits have changed")


def leaves_the_joints(config: Any) -> None:
    """A disturbance adds no joints: the controller's model has as many as the plant's."""
    leaves_the_arm(config)
    joints = build(SCENE, [_part(config)]).model.nv
    require(joints == 7, f"the scene has {joints} degrees of freedom, not 7")


def plant_starts_afresh(config: Any) -> None:
    """States begin at zero time where the arm was put, move, repeat themselves, and are the reader's own."""
    q = random_q(np.random.default_rng(1))
    plant = config().build(build(SCENE), DT, (), np.random.SeedSequence(0))

    def run() -> list[Any]:
        return [plant.reset(q)] + [plant.step(np.full(7, 1.0), np.full(7, 0.1)) for _ in range(5)]

    states = run()
    first = _rows(states)
    require(states[0].t_s == 0.0, f"the first state is at {states[0].t_s} s")
    require(abs(states[-1].t_s - 5 * DT) < 1e-9, f"after five periods it is {states[-1].t_s} s")
    require(_same(first[0, :14], [*q, *np.zeros(7)]), "the arm does not begin at rest where it was put")
    require(np.abs(first[-1, :7] - q).max() > 1e-6, "the arm does not move")
    require(_same(_rows(run()), first), "after a reset the plant moves otherwise")
    require(_same(_rows(states), first), "states of an earlier run have changed")
    trocar = SCENE.trocar
    seen = trocar is not None and np.allclose(states[-1].p_WC, trocar.position_m)
    require(seen, f"the trocar is seen at {states[-1].p_WC}")


_STEADY = Check(name="is deterministic under a seed and starts afresh", run=deterministic)
_KNOWN = "leaves the arm as the controller knows it"
DISTURBANCE_CHECKS = (_STEADY, Check(name=_KNOWN, run=leaves_the_joints))
PROP_CHECKS = (_STEADY, Check(name=_KNOWN, run=leaves_the_arm))
PLANT_CHECKS = (Check(name="resets cleanly, and its states are the reader's own", run=plant_starts_afresh),)
