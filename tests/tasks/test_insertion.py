"""Insertion: along the port's axis, then to the target; the remote centre is shifted while it must be."""

import numpy as np
import pytest

from surgsim.errors import Outcome, SurgsimError, UnreachableError
from surgsim.metrics.catalog import compute_metrics
from surgsim.models.config import TrocarConfig
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import simulate
from surgsim.simulate.setup import prepare
from surgsim.tasks.base import Feedback
from surgsim.tasks.insertion import InsertionConfig

TROCAR = TrocarConfig(position_m=(0.1, 0.5, 0.2), axis=(0.0, -3.0, 4.0))
PORT, AXIS = np.array(TROCAR.position_m), np.array([0.0, -0.6, 0.8])
START = PORT + 0.04 * AXIS
TARGET = (0.03, 0.08, -0.15)


def _task(**keys):
    config = InsertionConfig(depth_m=0.12, target_from_port_m=TARGET, **keys)
    return config.build(START, trocar=TROCAR)


def _commands(task, count=400):
    times = np.linspace(0.0, task.duration_s, count)
    return times, [task.command(float(t)) for t in times]


def test_it_goes_down_the_axis_to_its_depth_and_then_to_the_target():
    task = _task()
    _, commands = _commands(task)
    p = np.array([command.p_WTd for command in commands])
    np.testing.assert_allclose(p[0], START, atol=1e-12)
    np.testing.assert_allclose(p[-1], PORT + np.array(TARGET), atol=1e-12)
    beside = np.linalg.norm(np.cross(p - PORT, AXIS), axis=1)
    turn = int(np.argmin(np.linalg.norm(p - (PORT - 0.12 * AXIS), axis=1)))
    assert beside[:turn].max() < 1e-12
    assert beside[turn + 2 :].min() > 0.0


@pytest.mark.parametrize("t_s", [0.3, 1.0, 2.7, 4.0, 6.0, 8.0, 9.9])
def test_velocity_and_acceleration_are_derivatives_of_what_is_above_them(t_s):
    task, h = _task(), 1e-5
    before, here, after = (task.command(t_s + k * h) for k in (-1, 0, 1))
    np.testing.assert_allclose((after.p_WTd - before.p_WTd) / (2 * h), here.v_WTd, atol=1e-8)
    np.testing.assert_allclose((after.v_WTd - before.v_WTd) / (2 * h), here.a_WTd, atol=1e-7)


def test_the_shaft_is_held_on_the_axis_never_nearer_to_the_tip_than_asked():
    task = _task(held_m=0.07)
    for command in _commands(task)[1]:
        shift = np.zeros(3) if command.rcm_shift is None else command.rcm_shift
        centre = PORT + shift
        assert np.linalg.norm(np.cross(shift, AXIS)) < 1e-12
        assert np.linalg.norm(centre - command.p_WTd) > 0.07 - 1e-9


def test_the_shift_s_rate_is_its_derivative():
    task, h = _task(), 1e-5
    before, here, after = (task.command(2.0 + k * h) for k in (-1, 0, 1))
    np.testing.assert_allclose((after.rcm_shift - before.rcm_shift) / (2 * h), here.rcm_shift_rate, atol=1e-8)


def _seen(p, v):
    return Feedback(p_WT=p, v_WT=v, R_WT=np.eye(3), w_WT=np.zeros(3), f_T=np.zeros(3))


def test_led_by_hand_it_gives_way_along_the_axis_and_holds_it_across():
    task = _task(guidance="hands_on", give_way=0.8)
    assert task.reacts
    aside, speed = np.array([0.003, 0.0, 0.0]), np.array([0.01, 0.0, 0.0])
    command = task.command(1.0, _seen(PORT + 0.01 * AXIS + aside, speed - 0.02 * AXIS))
    np.testing.assert_allclose(command.p_WTd, PORT + 0.01 * AXIS, atol=1e-12)
    np.testing.assert_allclose(command.v_WTd, -0.016 * AXIS, atol=1e-12)


def test_led_by_hand_it_goes_on_to_the_target_once_the_hand_had_time_to_let_go():
    task, inside = _task(guidance="hands_on", let_go_s=1.0), PORT - 0.12 * AXIS
    task.command(3.0, _seen(inside, np.zeros(3)))
    held = task.command(3.9, _seen(inside, np.zeros(3)))
    np.testing.assert_allclose(held.p_WTd, inside, atol=1e-12)
    assert task.values().tolist() == pytest.approx([0.12, 1.0])
    end = task.command(15.0, _seen(inside, np.zeros(3)))
    np.testing.assert_allclose(end.p_WTd, PORT + np.array(TARGET), atol=1e-12)
    assert task.finished(15.0)
    assert not task.finished(4.1)
    task.reset()
    assert not task.finished(15.0)


def test_a_start_beside_the_axis_or_inside_is_refused():
    for start in (START + np.array([0.002, 0.0, 0.0]), PORT - 0.05 * AXIS):
        with pytest.raises(ValueError, match="on the port's axis, outside the patient"):
            InsertionConfig().build(start, trocar=TROCAR)


BENT = np.array([0.0075, 0.002, 0.013])


@pytest.mark.parametrize("guidance", ["planned", "hands_on"])
@pytest.mark.parametrize("t_s", [0.0, 1.7, 4.0, 7.5])
def test_an_angled_tip_is_asked_to_be_where_it_is_with_the_shaft_s_end_on_its_way(guidance, t_s):
    """Against the straight instrument whose tip is the shaft's end, the instrument turning as it does."""
    rng = np.random.default_rng(int(10 * t_s))
    R, w = _turn(rng), rng.normal(size=3)
    r = R @ BENT
    p_WS, v_WS = PORT + 0.01 * AXIS + 1e-3 * rng.normal(size=3), 0.01 * rng.normal(size=3)
    config = InsertionConfig(depth_m=0.12, target_from_port_m=TARGET, guidance=guidance)
    straight = config.build(START, trocar=TROCAR).command(t_s, _seen(p_WS, v_WS))
    task = config.build(START, trocar=TROCAR, p_ST=BENT)
    assert task.reacts
    told = Feedback(p_WT=p_WS + r, v_WT=v_WS + np.cross(w, r), R_WT=R, w_WT=w, f_T=np.zeros(3))
    bent = task.command(t_s, told)
    np.testing.assert_allclose(bent.p_WTd, straight.p_WTd + r, atol=1e-14)
    np.testing.assert_allclose(bent.v_WTd, straight.v_WTd + np.cross(w, r), atol=1e-14)
    np.testing.assert_allclose(bent.a_WTd, straight.a_WTd + np.cross(w, np.cross(w, r)), atol=1e-14)
    np.testing.assert_allclose(bent.rcm_shift, straight.rcm_shift, atol=1e-14)
    np.testing.assert_allclose(bent.p_WTd - told.p_WT, straight.p_WTd - p_WS, atol=1e-14)


def _turn(rng):
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return R * np.sign(np.linalg.det(R))


def test_what_cannot_be_inserted_is_refused_with_the_reason():
    with pytest.raises(SurgsimError, match="task 'insertion' needs a trocar"):
        prepare(load_scenario("insertion_lwr4plus", assignments=["trocar=null"]))
    with pytest.raises(UnreachableError, match=r"outside the patient, 0\.030 m above the port"):
        prepare(load_scenario("insertion_lwr4plus", assignments=["task.start_m=[0.01, 0.55, 0.23]"]))


@pytest.mark.parametrize("robot", [pytest.param("lwr4plus", marks=pytest.mark.slow), "panda"])
@pytest.mark.parametrize("name", ["insertion", "hands_on_insertion"])
def test_the_shipped_insertions_enter_the_patient_with_the_shaft_in_the_port(name, robot):
    trace = simulate(load_scenario(f"{name}_{robot}", assignments=["theatre=false"]))
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    port = trace.block("trocar")[0]
    assert trace.block("tip")[0][2] - port[2] == pytest.approx(0.03, abs=1e-5)
    np.testing.assert_allclose(trace.block("tip")[-1] - port, [0.02, 0.0, -0.18], atol=5e-4)
    assert trace["insertion_phase"][0] == 0.0
    assert set(trace["insertion_phase"]) == {0.0, 1.0, 2.0}
    assert compute_metrics(trace)["rcm_error_max_mm"] < (0.01 if name == "insertion" else 0.25)


def test_without_the_hand_a_hands_on_insertion_stays_where_it_is():
    trace = simulate(
        load_scenario(
            "hands_on_insertion_lwr4plus",
            assignments=["theatre=false", "disturbances=[]", "task.duration_s=2"],
        )
    )
    assert np.ptp(trace.block("tip")[:, 2]) < 1e-3
