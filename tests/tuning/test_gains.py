"""Which gains are searched, the space of the search, and what is written."""

import math

import pytest

from surgsim.control.controller import ControllerConfig
from surgsim.errors import SurgsimError
from surgsim.scenario.load import load_controller, shipped
from surgsim.tuning.gains import RANGE, Gain, gains_of, rounded, with_values

OBSERVER = "torque_law.observer_gain"


def keys(name, **given):
    return [gain.key for gain in gains_of(load_controller(name), 7, **given)]


def test_gains_of_torque_law_and_resolver_are_searched_and_no_times_limits_or_steps():
    assert keys("rcm_inverse_dynamics") == [
        "torque_law.rcm_stiffness_per_s2",
        "torque_law.rcm_damping_ratio",
        "torque_law.tip_stiffness_per_s2",
        "torque_law.tip_damping_ratio",
        "torque_law.joint_stiffness_per_s2",
        "torque_law.joint_damping_ratio",
        OBSERVER,
        "resolver.gain_rad2_per_s",
        "resolver.k_tip",
        "resolver.k_rcm",
    ]
    assert [key for key in keys("rnn") if key.startswith("resolver")] == [
        f"resolver.{name}" for name in ("c0", "c1", "c2", "c3", "k_tip", "k_rcm")
    ]
    assert "resolver.resolver.k_tip" in keys("policy_proportional")
    assert "resolver.tip_speed_max_m_per_s" not in keys("policy_proportional")


@pytest.mark.parametrize("name", shipped("controllers"))
def test_every_shipped_controller_has_gains_whose_start_is_inside(name):
    for gain in gains_of(load_controller(name), 7):
        low, high = gain.positions
        assert -1.0 <= low < 0.0 <= high <= 1.0


def test_what_is_asked_for_by_its_key_is_searched_be_it_a_time():
    asked = ["torque_law.full_gain_delay_s", "port.memory_s", "position_gain_per_s", OBSERVER, OBSERVER]
    assert keys("rcm_inverse_dynamics", keys=asked) == asked[:-1]


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("torque_law.rcm_stifness_per_s2", "Did you mean 'torque_law.rcm_stiffness_per_s2'?"),
        ("", "'' is not a gain of rcm_inverse_dynamics. Known: "),
        ("torque_law.contact", "is not a gain"),
        ("torque_law.most_delay_ticks", "is not a gain"),
        ("torque_law.sensor_delay_s", "torque_law.sensor_delay_s is 0: only positive numbers are searched"),
    ],
)
def test_a_key_that_cannot_be_searched_is_refused(key, said):
    with pytest.raises(SurgsimError, match=r"^--keys: ") as caught:
        keys("rcm_inverse_dynamics", keys=[key])
    assert said in str(caught.value)


def test_a_controller_without_gains_is_refused():
    still = ControllerConfig(name="still", resolver={"type": "pinv", "k_tip": 0.0, "k_rcm": 0.0})
    with pytest.raises(SurgsimError, match="controller 'still' has no gains that can be tuned"):
        gains_of(still, 7)


@pytest.mark.parametrize("joints", [6, 7, 8])
def test_lists_at_null_are_written_out_for_the_arm(joints):
    found = {gain.key: gain for gain in gains_of(load_controller("pinv"), joints)}
    stiffness = found["torque_law.joint_stiffness_nm_per_rad"]
    assert stiffness.listed
    assert len(stiffness.start) == joints


@pytest.mark.parametrize("x", [-1.0, -0.37, 0.0, 0.5, 1.0])
@pytest.mark.parametrize("start", [(20.0,), (3000.0, 30.0, 0.0)])
def test_a_position_is_the_logarithm_of_the_factor(x, start):
    gain = Gain(key="k", start=start, listed=len(start) > 1)
    value = gain.at(x)
    assert gain.position_of(value) == pytest.approx(x, abs=5e-3 / math.log(RANGE))
    numbers = value if gain.listed else (value,)
    factor = math.exp(x * math.log(30.0))
    assert numbers == pytest.approx([factor * number for number in start], rel=5e-3)


@pytest.mark.parametrize("value", [123456.0, 0.00123456, 1.0, 9.996, 2e-9])
def test_three_digits_are_kept(value):
    assert rounded(value) == pytest.approx(value, rel=5e-3)
    assert len(f"{rounded(value):.15e}".split("e")[0].rstrip("0").replace(".", "")) <= 3


def test_the_file_s_own_bounds_hold():
    (gain,) = gains_of(load_controller("rcm_inverse_dynamics"), 7, [OBSERVER])  # at most 1
    low, high = gain.positions
    assert low == -1.0
    assert high == pytest.approx(math.log(1.0 / 0.3) / math.log(30.0))
    assert gain.at(high) == 1.0
    assert gain.scaled(0.9996, 1.0) == 1.0
    assert gain.scaled(0.5, 30.0) == 1.0


def test_the_edge_is_that_of_the_search_and_not_of_the_file():
    free = Gain(key="k", start=(2.0,), listed=False)
    assert [free.is_at_the_edge(free.at(x)) for x in (-1.0, -0.9, 0.9, 1.0)] == [True, False, False, True]
    bounded = Gain(key="k", start=(0.3,), listed=False, high=1.0)
    assert not bounded.is_at_the_edge(1.0)


def test_values_go_where_their_keys_say_and_nothing_else_changes():
    before = load_controller("policy_proportional")
    new = {"torque_law.tip_stiffness_n_per_m": (1.0, 2.0, 3.0), "resolver.resolver.k_tip": 7.5}
    after = with_values(before, new, "other")
    assert after.torque_law.tip_stiffness_n_per_m == (1.0, 2.0, 3.0)
    assert after.resolver.resolver.k_tip == 7.5
    back = with_values(
        after,
        {"torque_law.tip_stiffness_n_per_m": (3000.0,) * 3, "resolver.resolver.k_tip": 5.0},
        before.name,
    )
    assert back == before
