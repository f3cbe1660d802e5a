"""The drawn rows show the signal: within the tolerance where it is smooth, its extremes where it is noise."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from surgsim.recording.polyline import MOST_ROWS, TOLERANCE, drawn_rows

T = np.linspace(0.0, 20.0, 20_001)


def largest_gap(values: np.ndarray, rows: np.ndarray) -> float:
    """Largest distance of the drawn lines from the samples, as a share of each signal's range."""
    index = np.arange(len(values))
    drawn = np.stack([np.interp(index, rows, column[rows]) for column in values.T], axis=1)
    return float((np.abs(drawn - values) / np.maximum(np.ptp(values, axis=0), 1e-300)).max())


def test_a_smooth_signal_needs_few_rows() -> None:
    values = np.stack([np.sin(T), 0.1 * np.cos(2 * T)], axis=1)
    rows = drawn_rows(values)
    assert largest_gap(values, rows) <= TOLERANCE * (1 + 1e-9)
    assert len(rows) < 1000


@given(arrays(np.float64, array_shapes(min_dims=2, max_dims=2, max_side=60), elements=st.floats(-1e3, 1e3)))
@settings(max_examples=200, deadline=None)
def test_no_row_that_is_left_out_is_far_from_the_line(values: np.ndarray) -> None:
    rows = drawn_rows(values)
    assert rows[0] == 0
    assert rows[-1] == len(values) - 1
    index = np.arange(len(values))
    widest = np.ptp(values, axis=0).max()
    for column in values.T:
        gap = np.abs(np.interp(index, rows, column[rows]) - column).max()
        assert gap <= TOLERANCE * max(np.ptp(column), 0.05 * widest) * (1 + 1e-9) + 1e-9


def test_one_tick_alone_is_drawn() -> None:
    values = np.zeros((20_001, 1))
    values[7777] = 1.0
    assert {7776, 7777, 7778} <= {*drawn_rows(values).tolist()}


@pytest.mark.parametrize("signals", [1, 7])
def test_noise_keeps_its_extremes(signals: int) -> None:
    values = np.random.default_rng(0).normal(size=(20_001, signals))
    rows = drawn_rows(values)
    assert len(rows) <= MOST_ROWS + 2
    assert np.array_equal(values[rows].max(axis=0), values.max(axis=0))
    assert np.array_equal(values[rows].min(axis=0), values.min(axis=0))


@pytest.mark.parametrize("missing", [np.nan, np.inf, -np.inf])
def test_where_a_signal_ends_and_begins_is_drawn(missing: float) -> None:
    values = np.stack([np.sin(T), np.cos(T)], axis=1)
    values[5000:6000, 1] = missing
    rows = drawn_rows(values)
    assert {4999, 5000, 5999, 6000} <= {*rows.tolist()}
    assert len(rows) < 1000


@pytest.mark.parametrize("value", [np.nan, 0.0, 3.0])
@pytest.mark.parametrize("count", [1, 2, 500])
def test_a_constant_is_two_points(value: float, count: int) -> None:
    rows = drawn_rows(np.full((count, 3), value))
    assert rows.tolist() == sorted({0, count - 1})


def test_noise_with_gaps_is_drawn() -> None:
    values = np.random.default_rng(0).normal(size=(20_001, 2))
    values[3000:9000] = np.nan
    rows = drawn_rows(values)
    assert len(rows) <= MOST_ROWS + 2
    assert np.nanmax(values[rows, 0]) == np.nanmax(values[:, 0])
