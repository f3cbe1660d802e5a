"""The speed measurement: a row for every shipped controller; how fast is not a test's matter."""

import math

from surgsim.runs.bench import OTHERS, bench
from surgsim.scenario.load import shipped


def test_every_shipped_controller_is_measured():
    rows = bench(1.0, 1)
    assert [row["run"] for row in rows] == [*(f"circle, {name}" for name in shipped("controllers")), *OTHERS]
    figures = [value for row in rows for name, value in row.items() if name != "run"]
    assert all(math.isfinite(value) and value > 0.0 for value in figures)
