"""Each limit ends a run as its own outcome, and says what was seen."""

import re
from dataclasses import replace

import numpy as np
import pytest

from surgsim.errors import Outcome
from surgsim.plant.truth import Contact, Truth
from surgsim.scenario.load import load_scenario
from surgsim.scenario.schema import SafetyConfig
from surgsim.simulate.loop import Simulation, simulate
from surgsim.simulate.safety import SafetyMonitor
from surgsim.simulate.setup import prepare
from surgsim.tasks.base import TimedTask, TipCommand

SAFE = SafetyConfig(rcm_error_max_m=0.01, tip_error_max_m=0.02, trocar_force_max_n=5.0, tip_force_max_n=2.0)
TIP = np.array([0.0, 0.0, -0.2])
TRUTH = Truth(
    q=np.zeros(7),
    v=np.zeros(7),
    p_WT=TIP,
    p_WS=TIP,
    p_WR=np.array([0.0, 0.0, 0.2]),
    p_WC=np.array([0.006, 0.008, 0.0]),
)
COMMAND = TipCommand(p_WTd=np.array([0.0, 0.02, -0.2]), v_WTd=np.zeros(3), a_WTd=np.zeros(3))


def _joints(**given):
    values = np.zeros(7)
    for joint, value in given.items():
        values[int(joint[1:]) - 1] = value
    return values


def _check(arm, config=SAFE, *, truth=TRUTH, command=COMMAND, has_trocar=True, tear=np.inf, **state):
    monitor = SafetyMonitor(config, arm.limits, has_trocar, tear)
    return monitor.check(1.5, replace(truth, **state), command)


class Lost(TimedTask):
    """From 0.1 s on its command is not a number."""

    duration_s = 1.0

    def command(self, t_s, feedback=None):
        here = np.array([0.0, 0.65, -0.03]) if t_s < 0.1 else np.full(3, np.nan)
        return TipCommand(p_WTd=here, v_WTd=np.zeros(3), a_WTd=np.zeros(3))


def test_a_command_of_nan_ends_the_run_as_diverged():
    for controller in ("pinv", "rcm_inverse_dynamics"):
        setup = prepare(load_scenario("circle_panda", controller=controller))
        ending = Simulation(replace(setup, task=Lost())).run().meta.ending
        assert ending.outcome is Outcome.DIVERGED
        assert ending.t_s == pytest.approx(0.1)


def test_at_the_limits_nothing_happens(arm):
    assert _check(arm, SAFE.model_copy(update={"rcm_error_max_m": 0.01 + 1e-12})) is None
    assert _check(arm, q=arm.limits.q_max, v=-arm.limits.velocity, truth=replace(TRUTH, p_WC=TIP)) is None


CASES = [
    (
        {"q": _joints(j4=2.2, j2=2.0944)},
        Outcome.JOINT_LIMIT,
        "joint 4 at 2.2000 rad, range [-2.0944, 2.0944] rad",
    ),
    ({"q": _joints(j1=-3.0)}, Outcome.JOINT_LIMIT, "joint 1 at -3.0000 rad, range [-2.9671, 2.9671] rad"),
    (
        {"v": _joints(j6=-3.3, j2=1.93)},
        Outcome.VELOCITY_LIMIT,
        "joint 6 at -3.3000 rad/s, limit 3.2114 rad/s",
    ),
    ({"q": _joints(j3=np.nan)}, Outcome.DIVERGED, "joint state is not finite"),
    ({"v": _joints(j3=-np.inf)}, Outcome.DIVERGED, "joint state is not finite"),
    (
        {"truth": replace(TRUTH, p_WC=np.array([0.006, 0.009, 0.1]))},
        Outcome.RCM_LIMIT,
        "shaft 10.82 mm from the trocar, limit 10.00 mm",
    ),
    (
        {"truth": replace(TRUTH, p_WT=np.array([0.0, -0.0005, -0.2]), p_WC=TIP)},
        Outcome.TIP_LIMIT,
        "tip 20.50 mm from its command, limit 20.00 mm",
    ),
    (
        {"contact": Contact(detail="link5 touches the patient, 3.1 mm deep", with_patient=True)},
        Outcome.PATIENT_COLLISION,
        "link5 touches the patient, 3.1 mm deep",
    ),
    (
        {"contact": Contact(detail="link1 touches shaft, 0.2 mm deep", with_patient=False)},
        Outcome.SELF_COLLISION,
        "link1 touches shaft, 0.2 mm deep",
    ),
    (
        {"f_C": np.array([3.0, 4.0, 0.001])},
        Outcome.FORCE_LIMIT,
        "trocar force 5.00 N, limit 5.00 N",
    ),
    ({"f_T": np.array([0.0, 0.0, -2.5])}, Outcome.FORCE_LIMIT, "tip force 2.50 N, limit 2.00 N"),
]


@pytest.mark.parametrize(("changes", "outcome", "detail"), CASES)
def test_a_limit_passed_is_named_with_joint_value_and_limit(arm, changes, outcome, detail):
    ending = _check(arm, **changes)
    assert (ending.outcome, ending.detail, ending.t_s) == (outcome, detail, 1.5)


def test_a_force_past_what_the_incision_bears_is_torn_before_it_is_a_limit(arm):
    ending = _check(arm, tear=5.0, f_C=np.array([0.0, 0.0, -5.5]))
    assert ending.outcome is Outcome.INCISION_TORN
    assert ending.detail == "shaft presses on the wall with 5.50 N, it tears at 5.00 N"


def test_forces_at_their_limits_and_forces_that_are_not_there_are_safe(arm):
    within = SAFE.model_copy(update={"rcm_error_max_m": None})
    force = {"f_C": np.array([3.0, 4.0, 0.0]), "f_T": np.array([2.0, 0.0, 0.0])}
    assert _check(arm, within, tear=5.0, **force) is None
    assert _check(arm, within, tear=5.0) is None


OFF = SafetyConfig(
    rcm_error_max_m=None,
    tip_error_max_m=None,
    stop_at_collision=False,
    stop_at_joint_limit=False,
    stop_at_velocity_limit=False,
)


@pytest.mark.parametrize(("changes", "outcome", "detail"), CASES)
def test_every_limit_but_divergence_can_be_switched_off(arm, changes, outcome, detail):
    ending = _check(arm, OFF, **changes)
    assert (ending is not None) == (outcome is Outcome.DIVERGED)


def test_without_a_trocar_there_is_no_rcm_limit(arm):
    truth = replace(TRUTH, p_WC=np.full(3, np.nan))
    assert _check(arm, truth=truth, has_trocar=False) is None


HEAVY_AND_LIMP = [
    "controller.torque_law.joint_stiffness_nm_per_rad=[0, 0, 0, 0, 0, 0, 0]",
    "controller.torque_law.rcm_stiffness_n_per_m=0",
    "controller.torque_law.rcm_damping_n_s_per_m=0",
    "disturbances=[{type: payload, mass_kg: 10.0}]",
    "safety={rcm_error_max_m: null, stop_at_velocity_limit: false, stop_at_collision: false}",
    "task.duration_s=4",
    "task.hold_start_s=1",
]
RUNS = [
    (["safety.tip_error_max_m=1e-6"], Outcome.TIP_LIMIT, r"tip 0\.\d\d mm from its command, limit 0\.00 mm"),
    (["safety.rcm_error_max_m=1e-4"], Outcome.RCM_LIMIT, r"shaft 0\.1\d mm from the trocar, limit 0\.10 mm"),
    (
        ["task.radius_m=0.02", "task.duration_s=0.04", "task.ramp_s=0.02"],
        Outcome.VELOCITY_LIMIT,
        r"joint \d at -?\d\.\d{4} rad/s, limit \d\.\d{4} rad/s",
    ),
    (
        HEAVY_AND_LIMP,
        Outcome.JOINT_LIMIT,
        r"joint \d at -?\d\.\d{4} rad, range \[-\d\.\d{4}, \d\.\d{4}\] rad",
    ),
]


@pytest.mark.parametrize(("changes", "outcome", "detail"), RUNS, ids=[run[1].name for run in RUNS])
def test_a_scenario_ends_in_each_outcome_within_a_tick(scenario, changes, outcome, detail):
    trace = simulate(scenario(*changes))
    ending = trace.meta.ending
    assert ending.outcome is outcome
    assert re.fullmatch(detail, ending.detail)
    trace = trace.active()
    assert ending.t_s == trace["t_s"][-1] > 0.0
    assert np.isnan(trace.block("qdot_ref")[-1]).all()


def test_a_diverged_plant_stays_diverged(scenario, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes MUJOCO_LOG.TXT where it is
    setup = prepare(scenario("simulation={timestep_s: 0.02, control_period_s: 0.02}"))
    setup.plant.reset(setup.q_start)
    setup.plant._data.qvel[0] = np.nan
    state = setup.plant.step(np.zeros(7), np.zeros(7))
    assert not (np.isfinite(state.q).all() and np.isfinite(state.v).all())
