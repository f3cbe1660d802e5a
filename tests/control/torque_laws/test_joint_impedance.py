"""Joint impedance against its formula."""

from dataclasses import replace

import numpy as np
import pytest
from usual_arm import usual_arm

from surgsim.control.torque_laws.joint_impedance import JointImpedanceConfig
from surgsim.errors import Outcome
from surgsim.simulate.loop import simulate

K = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0)
D = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0)


@pytest.mark.parametrize(("seed", "trocar"), [(0, True), (1, False)])
def test_terms_are_those_of_the_formula(torque_problem, seed, trocar):
    p = torque_problem(seed, trocar=trocar)
    law = JointImpedanceConfig(stiffness_nm_per_rad=K, damping_nm_s_per_rad=D).build(usual_arm())
    terms, _ = law.torque(p, law.start(p))
    spring = np.diag(K) @ (p.q_ref - p.q)
    damper = np.diag(D) @ (p.resolution.qdot - p.v)
    np.testing.assert_allclose(terms, [spring + damper, p.dyn.bias], atol=1e-12)
    assert law.terms == ("joint", "bias")


def test_neither_tip_nor_trocar_matter(torque_problem):
    p = torque_problem(0)
    law = JointImpedanceConfig().build(usual_arm())
    other = replace(p, rcm=None, command=replace(p.command, p_WTd=p.command.p_WTd + 1.0))
    np.testing.assert_array_equal(law.torque(p, None)[0], law.torque(other, None)[0])


def test_the_default_gains_on_seven_joints_are_within_what_the_arm_offers():
    gains = JointImpedanceConfig().build(usual_arm()).gains
    stiffness, damping = gains[:7], gains[7:]
    np.testing.assert_array_equal(stiffness, (2000.0, 2000.0, 2000.0, 2000.0, 1000.0, 500.0, 200.0))
    np.testing.assert_array_equal(damping, (60.0, 60.0, 40.0, 40.0, 15.0, 10.0, 6.0))
    assert max(stiffness) <= 5000.0


def test_a_run_follows_the_path_as_a_position_controlled_arm_does(scenario):
    trace = simulate(scenario("task.duration_s=1.5", "task.ramp_s=0.5", controller="joint_impedance"))
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    late = trace["t_s"] > 0.1
    assert trace["tip_error_m"][late].max() < 1e-3
    np.testing.assert_allclose(trace.block("q")[late], trace.block("q_ref")[late], atol=1e-3)
