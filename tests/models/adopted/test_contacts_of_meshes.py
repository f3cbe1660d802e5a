"""Fitted capsules find every contact of the shapes that they were fitted to."""

import mujoco
import numpy as np
import pytest

from surgsim.models.adopted.touching import NEXT_THAT_CAN_TOUCH
from surgsim.models.build import Scene, build
from surgsim.models.config import RobotConfig, SceneConfig
from surgsim.models.folders import robot_file
from surgsim.spatial import segment_distance_squared

POSTURES = 150
DEEP_M = 0.01


def _without_capsules(name: str, folder) -> str:
    """The arm's file without what says where its contacts are looked for."""
    spec = mujoco.MjSpec.from_file(str(robot_file(name)))
    for numeric in list(spec.numerics):
        if numeric.name.startswith("capsule_"):
            spec.delete(numeric)
    spec.compile()
    path = folder / f"{name}.xml"
    path.write_text(spec.to_xml())
    return str(path)


def _depth_of_hulls(scene: Scene, data: mujoco.MjData) -> float:
    """How deep the drawn shapes of links that can touch are inside of each other [m]; 0 if none is."""
    model, deepest = scene.model, 0.0
    names = ["base", *(f"link{i}" for i in range(1, len(scene.dof_ids) + 1))]
    geoms = [[g for g in range(model.ngeom) if model.geom_bodyid[g] == model.body(n).id] for n in names]
    for i, ours in enumerate(geoms):
        for theirs in geoms[i + NEXT_THAT_CAN_TOUCH :]:
            for a in ours:
                for b in theirs:
                    far = np.linalg.norm(data.geom_xpos[a] - data.geom_xpos[b])
                    if far < model.geom_rbound[a] + model.geom_rbound[b]:
                        apart = mujoco.mj_geomDistance(model, data, a, b, 0.05, np.zeros(6))
                        deepest = max(deepest, -apart)
    return deepest


def _capsules_touch(scene: Scene, data: mujoco.MjData) -> bool:
    shapes = scene.shapes
    ends = [
        data.xpos[body] + local @ data.xmat[body].reshape(3, 3).T
        for body, local in zip(shapes.bodies, shapes.ends, strict=True)
    ]
    return any(
        segment_distance_squared(*ends[i], *ends[j]) < (shapes.radii[i] + shapes.radii[j]) ** 2
        for i, j in shapes.pairs
    )


@pytest.mark.parametrize("name", ["lwr4plus", "panda"])
def test_no_contact_of_the_shapes_is_missed(name, tmp_path):
    robot = RobotConfig(mjcf=_without_capsules(name, tmp_path))
    scene = build(SceneConfig(robot=robot, theatre=False, instrument=None))
    data = mujoco.MjData(scene.model)
    rng = np.random.default_rng(3)
    touched = false = 0
    for _ in range(POSTURES):
        low, high = scene.limits.q_min, scene.limits.q_max
        q = rng.uniform(low, high)
        folded = rng.random(3) < 0.7  # of the bending joints: there links meet
        q[1::2] = np.where(folded, np.where(rng.random(3) < 0.5, low[1::2], high[1::2]), q[1::2])
        data.qpos[:] = q
        mujoco.mj_kinematics(scene.model, data)
        depth, found = _depth_of_hulls(scene, data), _capsules_touch(scene, data)
        touched += depth > 0.0
        false += found and depth == 0.0
        assert found or depth < DEEP_M
    assert touched > 0
    assert false < 0.1 * POSTURES
