"""What disturbances draw for each joint, and where they act, on arms of 6, 7 and 8 joints."""

import numpy as np
import pytest

from surgsim.models.build import build
from surgsim.models.config import RobotConfig, SceneConfig
from surgsim.plant.disturbances.inertia_error import InertiaErrorConfig
from surgsim.plant.disturbances.joint_friction import JointFrictionConfig
from surgsim.plant.disturbances.push import BODY, PushConfig
from surgsim.plant.disturbances.torque_bias import TorqueBiasConfig

SEED = 5
arms = pytest.mark.parametrize("joints", [6, 7, 8])


def scene_of(joints, *parts):
    config = SceneConfig(robot=RobotConfig(name=f"test_arm_{joints}"), theatre=False)
    return build(config, parts)


def drawn(joints):
    """What the first draw of a part's generator gives, from -1 to 1."""
    return np.random.default_rng(SEED).uniform(-1.0, 1.0, joints)


@arms
def test_friction_is_drawn_for_each_joint(joints):
    config = JointFrictionConfig(coulomb_nm=0.5, viscous_nm_s_per_rad=2.0, spread=0.3)
    part = config.build(np.random.default_rng(SEED))
    models = [scene_of(joints, part).model for _ in range(2)]  # a second model has the same joints
    for model in models:
        np.testing.assert_array_equal(model.dof_frictionloss, (1.0 + 0.3 * drawn(joints)) * 0.5)
        added = model.dof_damping - scene_of(joints).model.dof_damping
        np.testing.assert_allclose(added, (1.0 + 0.3 * drawn(joints)) * 2.0, rtol=1e-12)


@arms
def test_inertia_is_drawn_for_each_link(joints):
    part = InertiaErrorConfig(factor=1.2, spread=0.5).build(np.random.default_rng(SEED))
    names = [f"link{i}" for i in range(1, joints + 1)]
    heavy, plain = (
        [model.body(name).mass[0] for name in names]
        for model in (scene_of(joints, part).model, scene_of(joints).model)
    )
    np.testing.assert_allclose(np.divide(heavy, plain), 1.0 + 0.2 * (1.0 + 0.5 * drawn(joints)), rtol=1e-12)


@arms
def test_a_torque_bias_is_drawn_for_each_joint_and_then_its_sign(joints):
    config = TorqueBiasConfig(bias_nm=0.4, of="drive", signs="random", spread=0.5)
    part, rng = config.build(np.random.default_rng(SEED)), np.random.default_rng(SEED)
    size = 0.4 * (1.0 + 0.5 * rng.uniform(-1.0, 1.0, joints))
    wanted = size * rng.choice([-1.0, 1.0], joints)
    for _ in range(2):
        part.attach(scene_of(joints), 0.001)
        np.testing.assert_array_equal(part.gains[:joints], wanted)


@pytest.mark.parametrize(
    ("joints", "elbow", "wrist"), [(6, "link3", "link5"), (7, "link4", "link6"), (8, "link4", "link7")]
)
def test_a_push_acts_on_the_middle_link_or_the_last_but_one(joints, elbow, wrist):
    scene = scene_of(joints)
    for at, name in (("elbow", elbow), ("wrist", wrist)):
        part = PushConfig(at=at).build(np.random.default_rng(0))
        part.attach(scene, 0.001)
        assert part.gains[BODY] == scene.model.body(name).id
