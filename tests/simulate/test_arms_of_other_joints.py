"""Whole runs through a trocar on arms of 6 and 8 joints, with every shipped controller that can."""

import numpy as np
import pytest

from surgsim.bench.cases import NEEDS
from surgsim.control.rcm import rcm_kinematics
from surgsim.control.resolvers import RESOLVERS
from surgsim.env.environment import load as load_environment
from surgsim.errors import Outcome, SurgsimError
from surgsim.metrics.catalog import compute_metrics
from surgsim.recording.read import read_recording
from surgsim.recording.write import write_recording
from surgsim.scenario.load import load_scenario, shipped
from surgsim.simulate.loop import simulate
from surgsim.simulate.setup import prepare

POSTURES = {
    6: "[1.5708, -0.5236, 1.5708, 0.0, -1.0472, 0.0]",
    8: "[1.5708, -0.6, 0.0, 1.0, 0.0, -1.0, 0.0, 0.9]",
}
SHORT = ("duration_s=0.3", "ramp_s=0.1", "hold_start_s=0", "hold_end_s=0", "radius_m=0.002")
OF_THE_PAPER = ("stiffness_nm_per_rad", "damping_nm_s_per_rad")  # seven gains, of the paper's arm
arms = pytest.mark.parametrize("joints", [6, 8])


def made(joints, controller, *assignments):
    """The shipped circle, cut down to a small, short one, on another arm."""
    changes = [f"robot.name=test_arm_{joints}", f"start.posture_rad={POSTURES[joints]}", "theatre=false"]
    changes += [f"task.{change}" for change in SHORT]
    if controller == "vprnn":
        changes += [f"controller.torque_law.joint_{key}=null" for key in OF_THE_PAPER]
    return load_scenario("circle_lwr4plus", controller=controller, assignments=[*changes, *assignments])


@arms
@pytest.mark.parametrize("controller", sorted(shipped("controllers")))
def test_every_shipped_controller_completes_or_is_refused(joints, controller):
    wall = NEEDS.get(controller, ())
    scenario = made(joints, controller, *wall)
    if (joints, controller) == (6, "self_motion"):
        with pytest.raises(
            SurgsimError, match=r"^'self_motion' needs 1 degree of freedom while tip and shaft"
        ):
            simulate(scenario)
        return
    trace = simulate(scenario)
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    assert trace.columns_of("q")[-1] == f"q{joints}_rad"
    assert trace.block("tau").shape == (len(trace), joints)
    assert np.isfinite(trace.block("tau")[:-1]).all()
    assert trace["tip_error_m"].max() < 0.01
    assert trace["rcm_error_m"].max() < 0.01


@arms
def test_a_run_is_recorded_and_read_back(joints, tmp_path):
    trace = simulate(made(joints, "pinv", "theatre=true"))
    write_recording(tmp_path / "recording.rrd", trace, {})
    assert read_recording(tmp_path / "recording.rrd").trace.equals(trace)


@arms
@pytest.mark.parametrize("action", ["tip_velocity", "joint_velocity", "torque"])
def test_an_agent_acts_on_as_many_joints(joints, action):
    environment = load_environment(made(joints, "pinv"), action=action)
    assert environment.action_spec().shape == (3 if action == "tip_velocity" else joints,)
    seen = environment.reset().observation
    assert seen["joint_position"].shape == (joints,)
    assert environment.step(np.zeros(environment.action_spec().shape)).reward is not None


@arms
def test_self_motion_is_compared_with_what_the_arm_can_reach(joints):
    """With the shaft held, six joints leave nothing but the roll, which does not change mu."""
    share = compute_metrics(simulate(made(joints, "pinv")))["manipulability_optimality"]
    assert share == pytest.approx(1.0, abs=1e-9) if joints == 6 else 0.9 < share < 1.0


def beside(scenario, offset_m):
    """Start configuration with the tip where the path begins and the shaft `offset_m` from the trocar."""
    setup = prepare(scenario)
    arm, q, p_WC = setup.arm, setup.q_start, np.array(scenario.trocar.position_m)
    p_WT = arm.kinematics(q).p_WT
    wanted = np.array([0.0, 0.0, 0.0, offset_m, 0.0])
    for _ in range(10):
        kin = arm.kinematics(q)
        rcm = rcm_kinematics(kin, p_WC, np.zeros(3))
        rows = np.vstack([kin.Jv_WT, rcm.jacobian])
        q = q + np.linalg.pinv(rows) @ (wanted - np.concatenate([kin.p_WT - p_WT, rcm.error]))
    return f"start.q_rad={q.tolist()}"


@arms
@pytest.mark.parametrize("resolver", ["pinv", "gradient", "qp", "mink"])
def test_the_rcm_error_falls_at_the_rate_of_the_resolver_s_gain(joints, resolver):
    """On the kinematic plant e' = -k e a period T at a time: e(t) = e0 (1 - k T)^(t / T), k = 5 1/s."""
    assert resolver in RESOLVERS.names()
    scenario = made(joints, resolver, "plant={type: kinematic}", "controller.torque_law=null")
    start = beside(scenario, 5e-4)
    more = ["task.radius_m=1e-6"]  # the tip rests: what its motion adds, to second order, is not asked here
    scenario = made(joints, resolver, "plant={type: kinematic}", "controller.torque_law=null", start, *more)
    trace = simulate(scenario)
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    wanted = 5e-4 * (1.0 - 5.0 * 0.001) ** np.arange(len(trace))
    np.testing.assert_allclose(trace["rcm_error_m"], wanted, rtol=5e-3)


@arms
def test_under_torques_the_rcm_error_falls_as_a_critically_damped_one(joints):
    """Inverse dynamics: e'' = -w^2 e - 2 w e' from rest, so e = e0 (1 + w t) exp(-w t), w^2 = 1e4 1/s^2."""
    gains = "controller.torque_law={type: rcm_inverse_dynamics, rcm_stiffness_per_s2: 1.0e4}"
    scenario = made(joints, "rcm_inverse_dynamics", gains, "task.radius_m=1e-6")
    trace = simulate(
        made(joints, "rcm_inverse_dynamics", gains, "task.radius_m=1e-6", beside(scenario, 1e-4))
    )
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    wt = 100.0 * trace["t_s"]
    np.testing.assert_allclose(trace["rcm_error_m"], 1e-4 * (1.0 + wt) * np.exp(-wt), atol=5e-6)
