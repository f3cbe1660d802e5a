"""Energy tanks: the account closes and never goes below zero."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from surgsim.teleop.tank import TankConfig, affordable, budget, exchange, send_surplus, start

CONFIG = TankConfig()


def joules(low, high):
    return st.floats(low, high).map(lambda value: round(value, 9))


FLOWS = st.lists(st.tuples(st.floats(-0.5, 0.5), st.floats(0.0, 0.3)), max_size=60)


@settings(max_examples=80, deadline=None)
@given(flows=FLOWS)
def test_every_joule_is_in_the_tank_or_booked(flows):
    state, outside = start(CONFIG), 0.0
    for work, received in flows:
        state = exchange(state, CONFIG, work, received)
        state, sent = send_surplus(state, CONFIG, 0.001)
        outside += work + sent - received
        assert 0.0 <= state.level_j <= CONFIG.capacity_j + 1e-12
    books = state.level_j + state.overflow_j - state.deficit_j + outside
    assert books == pytest.approx(CONFIG.initial_j, abs=1e-11)


@settings(max_examples=80, deadline=None)
@given(flows=FLOWS)
def test_a_port_that_keeps_to_the_budget_leaves_the_floor_and_makes_no_deficit(flows):
    state = start(CONFIG)
    for work, received in flows:
        state = exchange(state, CONFIG, min(work, budget(state, CONFIG)), received)
        state, _ = send_surplus(state, CONFIG, 0.001)
        assert state.level_j >= CONFIG.floor_j - 1e-12
    assert state.deficit_j == 0.0


def test_level_is_half_the_square_of_the_state():
    state = start(TankConfig(initial_j=0.125, target_j=0.2, floor_j=0.01))
    assert state.x == pytest.approx(0.5)
    assert state.level_j == pytest.approx(0.125)
    assert budget(state, CONFIG) == pytest.approx(0.115)


def test_an_overdraft_is_booked_as_deficit():
    state = exchange(start(CONFIG), CONFIG, 0.5, 0.0)
    assert state.level_j == 0.0
    assert state.deficit_j == pytest.approx(0.3)


def test_only_the_surplus_is_sent_and_no_faster_than_allowed():
    assert send_surplus(start(CONFIG), CONFIG, 0.001)[1] == 0.0
    full = exchange(start(CONFIG), CONFIG, -0.1, 0.0)
    after, sent = send_surplus(full, CONFIG, 0.001)
    assert sent == pytest.approx(0.001 * 0.1 / CONFIG.send_time_s)
    assert after.level_j == pytest.approx(0.3 - sent)
    brim = exchange(start(CONFIG), CONFIG, -5.0, 0.0)
    assert send_surplus(brim, CONFIG, 0.001)[1] == pytest.approx(0.001 * CONFIG.send_limit_w)
    assert send_surplus(full, CONFIG, 10.0)[1] == pytest.approx(0.1)


@settings(max_examples=300, deadline=None)
@given(work=joules(-1.0, 1.0), own=joules(0.0, 1.0), left=joules(-0.5, 0.5))
def test_affordable_is_the_largest_factor_that_pays(work, own, left):
    factor = affordable(work, own, left)
    grid = np.linspace(0.0, 1.0, 2001)
    pays = grid[grid * work + grid**2 * own <= left]
    assert 0.0 <= factor <= 1.0
    if factor > 0.0:
        assert factor * work + factor**2 * own <= left + 1e-9
    if pays.size:
        assert factor >= pays[-1] - 1e-6


@pytest.mark.parametrize("wrong", [{"floor_j": 0.3}, {"target_j": 2.0}, {"floor_j": 0.0}])
def test_levels_out_of_order_are_refused(wrong):
    with pytest.raises(ValidationError):
        TankConfig(**wrong)
