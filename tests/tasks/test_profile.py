import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from surgsim.tasks.profile import Profile

profiles = st.builds(
    lambda hold, duration, ramp, end: Profile(
        hold_start_s=hold, duration_s=duration, ramp_s=ramp * duration, hold_end_s=end
    ),
    st.floats(0.0, 2.0),
    st.floats(0.1, 20.0),
    st.floats(0.01, 0.5),
    st.floats(0.0, 2.0),
)
fractions = st.floats(-0.5, 1.5)


@given(profiles, fractions)
def test_progress_is_between_0_and_1_never_back_and_never_faster_than_its_constant_speed(profile, at):
    s, speed, _ = profile.progress(at * profile.total_s)
    assert 0.0 <= s <= 1.0
    assert 0.0 <= speed <= 1.0 / (profile.duration_s - profile.ramp_s) * (1 + 1e-12)


@given(profiles, st.floats(0.0, 1.0))
def test_progress_is_symmetric_in_time(profile, at):
    start, t = profile.hold_start_s, at * profile.duration_s
    s, v, a = profile.progress(start + t)
    back = profile.progress(start + profile.duration_s - t)
    np.testing.assert_allclose((1 - s, v, -a), back, atol=1e-6 / profile.ramp_s**2)


@given(profiles, st.floats(0.0, 1.0))
def test_rates_are_derivatives(profile, at):
    h = 1e-5 * profile.ramp_s
    t = at * profile.total_s
    before, now, after = (profile.progress(t + dt) for dt in (-h, 0.0, h))
    speed = 1.0 / (profile.duration_s - profile.ramp_s)
    assert (after[0] - before[0]) / (2 * h) == pytest.approx(now[1], abs=1e-5 * speed / profile.ramp_s + 1e-8)
    # the acceleration has corners where a ramp meets rest or constant speed
    assert (after[1] - before[1]) / (2 * h) == pytest.approx(now[2], abs=1e-3 * speed / profile.ramp_s)


@given(profiles)
def test_it_begins_and_ends_at_rest_and_takes_its_time(profile):
    assert profile.total_s == profile.hold_start_s + profile.duration_s + profile.hold_end_s
    assert profile.progress(0.0) == (0.0, 0.0, 0.0)
    assert profile.progress(profile.hold_start_s) == (0.0, 0.0, 0.0)
    np.testing.assert_allclose(profile.progress(profile.total_s), (1.0, 0.0, 0.0), atol=1e-9)
    assert profile.progress(profile.hold_start_s + 0.5 * profile.duration_s)[0] == pytest.approx(0.5)


def test_speed_is_constant_between_the_ramps():
    profile = Profile(hold_start_s=0.5, duration_s=4.0, ramp_s=1.0, hold_end_s=0.0)
    for t in (1.5, 2.0, 3.0, 3.5):
        assert profile.progress(t)[1:] == pytest.approx((1.0 / 3.0, 0.0))
