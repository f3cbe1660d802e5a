"""Axes: ticks that can be read over any range, and a place for zero."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from surgsim.compare.intervals import Interval
from surgsim.report.figures.boxes import Group, box_plot
from surgsim.report.figures.curves import Curve, curve_plot
from surgsim.report.figures.frontier import Track, frontier_plot
from surgsim.report.figures.intervals import interval_plot
from surgsim.report.figures.scale import Scale
from surgsim.report.figures.svg import CHARACTER, margin

START, END = 12.0, 348.0
RATIOS = (1.01, 1.1, 1.5, 2.0, 3.0, 5.0, 9.0, 20.0, 31.0, 100.0, 999.0, 1e4, 1e6, 1e9, 1e12)


@pytest.mark.parametrize(
    ("values", "log", "ticks"),
    [
        ((0.0, 1.0), False, ["0", "0.2", "0.4", "0.6", "0.8", "1"]),
        ((0.402, 0.411), False, ["0.402", "0.404", "0.406", "0.408", "0.41"]),
        ((0.002, 12.0), True, ["0.01", "0.1", "1", "10"]),
        ((1e-9, 10.0), True, ["1e−8", "1e−6", "1e−4", "0.01", "1"]),
        ((3.0, 3.0), False, ["2.9", "3", "3.1"]),
        ((-2.0, 5.0), False, ["−2", "0", "2", "4"]),
        ((2e-13, 9e-13), False, ["2e−13", "4e−13", "6e−13", "8e−13"]),
        ((0.0, 1e-5, 100.0), True, ["0", "1e−4", "0.01", "1", "100"]),
        ((0.0, 0.0), False, ["0", "0.2", "0.4", "0.6", "0.8", "1"]),
        ((float("nan"), float("inf")), False, ["0", "0.2", "0.4", "0.6", "0.8", "1"]),
    ],
)
def test_ticks_are_round_and_few(values, log, ticks):
    scale = Scale.over(values, 0, 100)
    assert scale.log is log
    assert [text for _, text in scale.labels()] == ticks
    assert all(0 <= scale.at(value) <= 100 for value in values if np.isfinite(value))


def check_readable(scale):
    """Three to seven ticks with texts of their own, which do not touch, and no half of the axis bare."""
    places, texts = zip(*scale.labels(), strict=True)
    assert 3 <= len(texts) <= 8
    assert len(set(texts)) == len(texts)
    for (x, left), (y, right) in itertools.pairwise(zip(places, texts, strict=True)):
        assert y - x > 0.5 * CHARACTER * (len(left) + len(right))
    assert max(np.diff([scale.start, *places, scale.end])) <= 0.5 * (scale.end - scale.start)


@pytest.mark.parametrize("ratio", RATIOS)
@pytest.mark.parametrize("low", [1e-12, 3.7e-7, 0.0421, 1.0, 6.66, 98765.0, 2e9])
@pytest.mark.parametrize("log", [True, None])
def test_ticks_of_any_range_can_be_read(low, ratio, log):
    check_readable(Scale.over([low, low * ratio], START, END, log=log))


@given(st.floats(-12.0, 9.0), st.floats(np.log10(1.01), 12.0))
def test_ticks_of_any_logarithmic_range_can_be_read(low, decades):
    check_readable(Scale.over([10.0**low, 10.0 ** (low + decades)], START, END, log=True))


def test_zero_has_a_place_of_its_own_on_a_logarithmic_axis():
    scale = Scale.over([0.0, 1e-3, 10.0], START, END)
    (zero, text), (first, _), *_ = scale.labels()
    assert (scale.log, text, zero) == (True, "0", START)
    assert first - START > 0.05 * (END - START)
    assert scale.at(0.0) == START < scale.at(1e-3) < scale.at(10.0) < END


def test_what_is_below_zero_is_said_to_be_there():
    scale = Scale.over([-3.0, 0.0, 1.0, 1000.0], START, END, log=True)
    assert scale.labels()[0] == (START, "≤ 0")
    assert scale.at(-3.0) == START
    assert Scale.over([-3.0, 0.0], START, END, log=True).log is False  # nothing positive


def test_the_labels_of_a_vertical_axis_have_room():
    for low in (1.001e-9, 1.0, 12345.0):
        scale = Scale.over([low, 1.01 * low], 186, 22)
        assert margin(scale) - 5 >= CHARACTER * max(len(text) for _, text in scale.labels())


@pytest.mark.parametrize(("largest", "log"), [(2.0, False), (2000.0, True)])
def test_a_screen_reader_is_told_of_a_logarithmic_axis_as_the_eye_is(largest, log):
    x = np.array([1.0, 2.0])
    values = np.array([1.0, largest])
    name = "error [mm], log scale" if log else "error [mm]"
    group = Group(name="a", index=0, values=values, runs=2, failed=0)
    track = Track(index=0, x=x, middle=values, low=values, high=values, failed=x.astype(int) * 0, runs=x)
    drawn = {
        f"Box plot of {name}. ": box_plot([group], "error [mm]"),
        f"{name}. a: ": interval_plot([("a", 0, Interval(value=1.0, low=1.0, high=largest))], "error [mm]"),
        f"{name} over time [s], ": curve_plot([Curve(index=0, x=x, middle=values)], "time [s]", "error [mm]"),
        f"{name} against mass, ": frontier_plot([track], "mass", "error [mm]"),
    }
    for said, drawing in drawn.items():
        assert f'aria-label="{said}' in drawing
        assert f">{name}</text>" in drawing
