import math

from surgsim.recording.stored import differences


def test_equal_metrics_have_no_differences() -> None:
    metrics = {"a": 1.0, "b": None, "c": math.nan, "d": 0.0}
    assert differences(metrics, {**metrics, "a": 1.0 + 1e-12}) == []


def test_every_difference_is_said() -> None:
    stored = {"changed": 1.0, "none": None, "small": 1e-12}
    recomputed = {"changed": 1.5, "sparc": 3.0, "none": 0.0, "small": 2e-12}
    assert differences(stored, recomputed) == [
        "changed: stored 1.0, the trace gives 1.5",
        "none: stored none, the trace gives 0.0",
        "small: stored 1e-12, the trace gives 2e-12",
        "sparc: not stored, the trace gives 3.0",
    ]


def test_a_metric_of_a_package_that_is_on_one_side_alone_is_no_difference() -> None:
    assert differences({"a": 1.0, "theirs": 2.0}, {"a": 1.0, "others": 3.0}) == []


def test_a_metric_that_came_after_the_run_is_a_difference_where_the_trace_has_it_alone() -> None:
    assert differences({}, {"sparc": None}) == []
    assert differences({}, {"sparc": 3.0}) == ["sparc: not stored, the trace gives 3.0"]
