"""Metrics of a transfer against formulas written another way, on a made trace."""

import itertools
import math

import numpy as np
import pytest

from surgsim.columns import Block, scalar, vector
from surgsim.errors import Outcome
from surgsim.metrics.catalog import METRICS
from surgsim.metrics.transfers import grasps_missed, shortest_way
from surgsim.trace.trace import Ending, Trace, TraceMeta

ROWS = 400


def made(jaw=None, states=None, outcome=Outcome.COMPLETED, tip=None):
    """A trace of two rings: the second is brought before the first."""
    t = np.arange(ROWS) * 0.01
    jaw = np.zeros(ROWS) if jaw is None else np.asarray(jaw, float)
    if states is None:
        states = np.zeros((ROWS, 2))
        states[50:100, 1], states[100:, 1] = 1.0, 2.0
        states[200:300, 0], states[300:, 0] = 1.0, 2.0
    rings = np.zeros((ROWS, 6))
    rings[:, :3], rings[:, 3:] = [0.01, 0.0, 0.0], [0.03, 0.0, 0.0]
    rings[300:, :3], rings[100:, 3:] = [0.01, 0.04, 0.0], [0.03, 0.05, 0.0]
    if tip is None:
        angle = 2 * np.pi * t / t[-1]
        tip = np.column_stack([0.1 * np.cos(angle), 0.1 * np.sin(angle), 0.02 * t])
    blocks = (
        scalar("t", "s"),
        vector("tip", "m"),
        vector("ring1", "m"),
        vector("ring2", "m"),
        Block("ring_state", ("1", "2"), ""),
        scalar("jaw"),
        scalar("shaft_load", "n"),
    )
    data = np.column_stack([t, tip, rings, states, jaw, np.linspace(0.0, 2.5, ROWS)])
    meta = TraceMeta(
        scenario={"props": [{"type": "peg_board", "close_at": 0.5, "open_at": 0.3}]},
        control_period_s=0.01,
        limits={},
        ending=Ending(outcome=outcome, t_s=float(t[-1])),
    )
    return Trace(data, blocks, meta)


def value(name, trace):
    return METRICS[name].compute(trace)


def test_the_way_of_a_helix_is_its_arc_length():
    length = math.hypot(2 * math.pi * 0.1, 0.02 * (ROWS - 1) * 0.01)
    assert value("tip_path_length_m", made()) == pytest.approx(length, rel=1e-4)


def test_the_shortest_way_visits_the_rings_in_the_order_in_which_they_came_to_rest():
    stops = [(0.1, 0.0, 0.0), (0.03, 0.0, 0.0), (0.03, 0.05, 0.0), (0.01, 0.0, 0.0), (0.01, 0.04, 0.0)]
    straight = sum(math.dist(a, b) for a, b in itertools.pairwise(stops))
    assert shortest_way(made()) == pytest.approx(straight)
    assert value("economy_of_motion", made()) == pytest.approx(straight / value("tip_path_length_m", made()))


def test_a_tip_that_goes_the_shortest_way_has_an_economy_of_one():
    stops = np.array(
        [(0.05, 0.02, 0.0), (0.03, 0.0, 0.0), (0.03, 0.05, 0.0), (0.01, 0.0, 0.0), (0.01, 0.04, 0.0)]
    )
    at = np.sort(np.concatenate([np.linspace(0.0, 4.0, ROWS - 2), [1.0, 2.0]]))
    tip = np.column_stack([np.interp(at, np.arange(5.0), stops[:, i]) for i in range(3)])
    assert value("economy_of_motion", made(tip=tip)) == pytest.approx(1.0, abs=2e-3)


def test_nothing_is_economical_about_no_ring():
    none = made(states=np.zeros((ROWS, 2)))
    assert math.isnan(shortest_way(none))
    assert math.isnan(value("economy_of_motion", none))


def test_success_needs_every_ring_and_an_end_in_time():
    half = np.zeros((ROWS, 2))
    half[300:, 0] = 2.0
    assert value("transfer_success", made()) == 1.0
    assert value("transfer_success", made(outcome=Outcome.TIME_LIMIT)) == 0.0
    assert value("transfer_success", made(states=half)) == 0.0
    assert value("run_time_s", made()) == pytest.approx((ROWS - 1) * 0.01)
    assert value("shaft_contact_force_max_n", made()) == 2.5


@pytest.mark.parametrize(
    ("closed", "held", "missed"),
    [
        ([(10, 40), (60, 90)], [(20, 35)], 1),
        ([(10, 40), (60, 90)], [(20, 35), (85, 90)], 0),
        ([(10, 40), (60, 90), (300, 400)], [], 3),
        ([], [], 0),
    ],
)
def test_missed_grasps_are_the_closures_without_a_ring(closed, held, missed):
    jaw, states = np.zeros(ROWS), np.zeros((ROWS, 2))
    for begin, end in closed:
        jaw[begin:end] = 1.0
        jaw[end : end + 3] = 0.4  # still between the two thresholds: one closure
    for begin, end in held:
        states[begin:end, 1] = 1.0
    told = [any(states[begin : end + 3, 1]) for begin, end in closed]
    assert grasps_missed(made(jaw, states)) == missed == told.count(False)


def test_half_closed_jaws_are_no_grasp():
    assert grasps_missed(made(np.full(ROWS, 0.45))) == 0.0
