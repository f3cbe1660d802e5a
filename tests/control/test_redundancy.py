"""Parts that need more redundancy than an arm has are refused before the run, with the reason."""

import pytest

from surgsim.control.controller import Controller, ControllerConfig
from surgsim.control.redundancy import check_redundancy, redundancy_needed
from surgsim.control.resolvers.pinv import PinvConfig
from surgsim.control.resolvers.policy import PolicyConfig
from surgsim.control.resolvers.self_motion import SelfMotionConfig
from surgsim.control.torque_laws.joint_impedance import JointImpedanceConfig
from surgsim.errors import SurgsimError
from surgsim.models.arm import ArmModel
from surgsim.models.config import RobotConfig, SceneConfig

REASON = (
    "'self_motion' needs 1 degree of freedom while tip and shaft are held; "
    "an arm of 6 joints has none left, the roll about the shaft not counted"
)


def _arm(joints):
    return ArmModel(SceneConfig(robot=RobotConfig(name=f"test_arm_{joints}")))


def _controller(resolver, arm, has_trocar):
    config = ControllerConfig(name="made", resolver=resolver, torque_law=JointImpedanceConfig())
    return Controller(config, arm, dt_s=0.001, has_trocar=has_trocar, use_torque_law=True)


def test_a_resolver_is_refused_on_an_arm_that_has_too_little():
    with pytest.raises(SurgsimError) as refused:
        _controller(SelfMotionConfig(), _arm(6), True)
    assert str(refused.value) == REASON


def test_it_is_not_where_the_arm_has_enough():
    _controller(SelfMotionConfig(), _arm(6), False)
    _controller(SelfMotionConfig(), _arm(7), True)
    _controller(PinvConfig(), _arm(6), True)


def test_a_policy_for_the_tip_needs_what_the_resolver_below_it_needs():
    policy = PolicyConfig(resolver=SelfMotionConfig())
    assert redundancy_needed(policy) == 1
    assert redundancy_needed(PolicyConfig()) == 0
    assert redundancy_needed(PolicyConfig(action="joint_velocity", resolver=SelfMotionConfig())) == 0
    with pytest.raises(SurgsimError, match=r"^'policy' needs 1 degree of freedom"):
        _controller(policy, _arm(6), True)


def test_what_is_said_of_an_arm_that_has_too_little_for_the_tasks_themselves():
    class Greedy:
        type, needs_redundancy = "greedy", 5

    arm = _arm(8)
    with pytest.raises(
        SurgsimError, match=r"^'greedy' needs 5 degrees of freedom .*; an arm of 8 joints has 3 left$"
    ):
        check_redundancy(Greedy, arm, True)
    check_redundancy(Greedy, arm, False)
    check_redundancy(None, _arm(6), True)
