"""The laws for elastic drives against their formulas, their limits, and what they promise."""

import math
from dataclasses import replace

import numpy as np
import pytest

import surgsim
from surgsim.contract.problems import torque_problem
from surgsim.control.elastic_observer import DRY, ROWS, ElasticObserverConfig
from surgsim.control.torque_laws.joint_elastic_dynamics import JointElasticDynamicsConfig
from surgsim.control.torque_laws.rcm_elastic_dynamics import RcmElasticDynamicsConfig
from surgsim.control.torque_laws.rcm_inverse_dynamics import RcmInverseDynamicsConfig
from surgsim.errors import Outcome
from surgsim.models.arm import ArmModel
from surgsim.models.config import RobotConfig, SceneConfig
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import prepare

REAL = {"robot.drive": "real"}


@pytest.fixture(scope="module")
def on_drives():
    return ArmModel(SceneConfig(robot=RobotConfig(name="panda", drive="real")))


@pytest.mark.parametrize("seed", range(3))
def test_at_rest_it_asks_for_the_accelerations_of_the_rigid_law(on_drives, seed):
    """At first sight, when nothing is observed yet and the arm is at rest, with the same bandwidths."""
    problem = torque_problem(on_drives, seed)
    still = np.zeros_like(problem.q)
    problem = replace(problem, v=still, dyn=on_drives.dynamics(problem.q, still))
    elastic = RcmElasticDynamicsConfig(
        bandwidth_share=40.0 / on_drives.locked_frequency,
        tip_bandwidth_ratio=0.5,
        damping_ratio=0.9,
        delay_ticks=0,
    )
    rigid = RcmInverseDynamicsConfig(
        rcm_stiffness_per_s2=1600.0,
        rcm_damping_ratio=0.9,
        tip_stiffness_per_s2=400.0,
        tip_damping_ratio=0.9,
        observer_gain=0.0,
        most_delay_ticks=0,
    )
    ours, _ = elastic.build(on_drives).torque(problem, None)
    theirs, _ = rigid.build(on_drives).torque(problem, None)
    assert ours[:3] == pytest.approx(theirs[:3], rel=1e-9, abs=1e-9)
    assert ours.sum(axis=0) == pytest.approx(
        problem.tau_measured + np.clip(ours[:-1].sum(axis=0) - problem.tau_measured, -1.0, 1.0)
    )


def test_the_bandwidth_follows_the_drives_up_to_its_bound(on_drives):
    free = on_drives.locked_frequency
    drive = on_drives.drive
    assert free == pytest.approx(min(np.sqrt(drive.stiffness / drive.apparent_inertia)))
    for share, most, wanted in ((0.1, 1000.0, 0.1 * free), (10.0, 60.0, 60.0)):
        law = RcmElasticDynamicsConfig(bandwidth_share=share, most_bandwidth_rad_per_s=most).build(on_drives)
        assert law.gains[0] == pytest.approx(wanted**2)
    ideal = ArmModel(SceneConfig(robot=RobotConfig(name="panda")))
    assert ideal.locked_frequency == math.inf
    assert RcmElasticDynamicsConfig().build(ideal).gains[0] == pytest.approx(85.0**2)


@pytest.mark.parametrize("law", ["rcm_elastic_dynamics", "joint_elastic_dynamics"])
def test_its_command_never_changes_faster_than_the_interface_takes(law):
    settings = {"robot.drive.torque_rate_nm_per_s": 150.0, "task.duration_s": 3.0}
    trace = surgsim.run("circle_panda", controller=law, settings=settings).trace
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    assert np.abs(np.diff(trace.block("tau"), axis=0))[:-1].max() <= 0.15 * (1.0 + 1e-9)
    terms = sum(trace.block(f"tau_{term}_") for term in _terms(law))
    assert terms[:-1] == pytest.approx(trace.block("tau")[:-1], abs=1e-9)


def _terms(law):
    config = RcmElasticDynamicsConfig if law.startswith("rcm") else JointElasticDynamicsConfig
    return config().build(ArmModel(SceneConfig(robot=RobotConfig(name="panda")))).terms


def test_without_errors_it_follows_to_micrometres():
    """On elastic drives without friction, at twice the speed of the shipped circle."""
    settings = {"robot.drive.coulomb_nm": 0.0, "task.duration_s": 5.0}
    run = surgsim.run("circle_panda", controller="rcm_elastic_dynamics", settings=settings)
    assert run.metrics["tip_error_max_mm"] < 0.05
    assert run.metrics["rcm_error_max_mm"] < 0.03


def test_a_law_for_rigid_arms_dies_on_them():
    run = surgsim.run("circle_panda", controller="rcm_inverse_dynamics", settings=REAL)
    assert run.trace.meta.ending.outcome is not Outcome.COMPLETED
    assert run.trace.meta.ending.t_s < 1.0


@pytest.mark.parametrize(
    "wrong",
    [
        {"stiffness_factor": 0.5},
        {"stiffness_factor": 2.0},
        {"inertia_factor": 0.5},
        {"inertia_factor": 2.0},
        {"delay_ticks": 0},
        {"delay_ticks": 3},
    ],
    ids=str,
)
def test_it_bears_a_wrong_idea_of_the_drives(wrong):
    settings = {**REAL, "task.duration_s": 3.0, "task.ramp_s": 0.5}
    settings |= {f"controller.torque_law.{key}": value for key, value in wrong.items()}
    run = surgsim.run("circle_fr3", controller="rcm_elastic_dynamics", settings=settings)
    assert run.trace.meta.ending.outcome is Outcome.COMPLETED
    assert run.metrics["rcm_error_rms_mm"] < 0.1


def test_friction_is_learnt_where_the_joint_moves():
    """After a circle the law knows the motors' dry friction behind the torque loop within a fifth."""
    settings = {"robot.drive.coulomb_nm": 2.0, "task.duration_s": 6.0, "task.hold_end_s": 0.0}
    scenario = surgsim.load("circle_fr3", controller="rcm_elastic_dynamics", settings=settings)
    setup = prepare(scenario)
    Simulation(setup).run()
    learnt = setup.controller.arrays["law_memory"][: ROWS * 7].reshape(ROWS, 7)[DRY]
    moving = np.array([1, 3, 5])  # joints whose speed is far past the band for most of the way
    assert learnt[moving] == pytest.approx(2.0 / 4.0, rel=0.2)


def test_keys_of_the_observer_are_those_of_both_laws():
    shared = set(ElasticObserverConfig.model_fields)
    assert shared < set(RcmElasticDynamicsConfig.model_fields)
    assert shared < set(JointElasticDynamicsConfig.model_fields)


def test_encoders_on_the_motors_cost_it_little():
    """The gears' deflection, up to 4 mrad, is known from their torques."""
    settings = {"robot.drive.encoder": "motor", "task.duration_s": 4.0}
    run = surgsim.run("circle_fr3", controller="rcm_elastic_dynamics", settings=settings)
    assert run.trace.meta.ending.outcome is Outcome.COMPLETED
    assert run.metrics["rcm_error_rms_mm"] < 0.1
    assert run.metrics["tip_error_rms_mm"] < 0.15
