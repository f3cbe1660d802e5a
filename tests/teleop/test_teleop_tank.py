"""Energy tanks: the account closes and never goes below zero."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from surgsim.teleop.tank import (
    Tank,
    TankConfig,
    TankLaw,
    affordable,
    budget,
    exchange,
    fill_tank,
    level,
    send_surplus,
)
from surgsim.tick.arrays import new
from surgsim.tick.overlay import take

CONFIG = TankConfig()


def full(config=CONFIG, gained=0.0):
    """Numbers and state of a tank at its initial level, and what it has gained since."""
    law, tank = new(TankLaw, 0), new(Tank, 0)
    take(law, config)
    fill_tank(law, tank)
    exchange(law, tank, -gained, 0.0)
    return law, tank


def joules(low, high):
    return st.floats(low, high).map(lambda value: round(value, 9))


FLOWS = st.lists(st.tuples(st.floats(-0.5, 0.5), st.floats(0.0, 0.3)), max_size=60)


@settings(max_examples=80, deadline=None)
@given(flows=FLOWS)
def test_every_joule_is_in_the_tank_or_booked(flows):
    (law, tank), outside = full(), 0.0
    for work, received in flows:
        exchange(law, tank, work, received)
        sent = send_surplus(law, tank, 0.001)
        outside += work + sent - received
        assert 0.0 <= level(tank) <= CONFIG.capacity_j + 1e-12
    books = level(tank) + tank.overflow_j - tank.deficit_j + outside
    assert books == pytest.approx(CONFIG.initial_j, abs=1e-11)


@settings(max_examples=80, deadline=None)
@given(flows=FLOWS)
def test_a_port_that_keeps_to_the_budget_leaves_the_floor_and_makes_no_deficit(flows):
    law, tank = full()
    for work, received in flows:
        exchange(law, tank, min(work, budget(law, tank)), received)
        send_surplus(law, tank, 0.001)
        assert level(tank) >= CONFIG.floor_j - 1e-12
    assert tank.deficit_j == 0.0


def test_level_is_half_the_square_of_the_state():
    law, tank = full(TankConfig(initial_j=0.125, target_j=0.2, floor_j=0.01))
    assert tank.x == pytest.approx(0.5)
    assert level(tank) == pytest.approx(0.125)
    assert budget(law, tank) == pytest.approx(0.115)


def test_an_overdraft_is_booked_as_deficit():
    _, tank = full(gained=-0.5)
    assert level(tank) == 0.0
    assert tank.deficit_j == pytest.approx(0.3)


def test_only_the_surplus_is_sent_and_no_faster_than_allowed():
    assert send_surplus(*full(), 0.001) == 0.0
    law, tank = full(gained=0.1)
    sent = send_surplus(law, tank, 0.001)
    assert sent == pytest.approx(0.001 * 0.1 / CONFIG.send_time_s)
    assert level(tank) == pytest.approx(0.3 - sent)
    assert tank.sent_j == sent
    assert send_surplus(*full(gained=5.0), 0.001) == pytest.approx(0.001 * CONFIG.send_limit_w)
    assert send_surplus(*full(gained=0.1), 10.0) == pytest.approx(0.1)


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
