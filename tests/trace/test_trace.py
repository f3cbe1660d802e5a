"""Column names are a contract with tools outside; the data cannot be changed."""

import json
import re

import numpy as np
import pytest

from surgsim.columns import joints, scalar, vector
from surgsim.errors import Outcome
from surgsim.plant.props.peg_board import PegBoardConfig
from surgsim.trace.trace import Ending, Trace, TraceMeta, base_blocks

AXES = ("x", "y", "z")
CONTRACT = (
    "t_s",
    *(f"q{i}_rad" for i in range(1, 8)),
    *(f"v{i}_rad_per_s" for i in range(1, 8)),
    *(f"tau{i}_nm" for i in range(1, 8)),
    *(f"qdot_ref{i}_rad_per_s" for i in range(1, 8)),
    *(f"{point}_{axis}_m" for point in ("tip", "tip_ref", "wrist", "trocar") for axis in AXES),
    "tip_error_m",
    "rcm_error_m",
    "manipulability",
    "control_time_s",
)
META = TraceMeta(
    scenario={"name": "made", "seed": 3, "task": {"radius_m": 0.1}},
    control_period_s=0.001,
    limits={"q_min": (-1.0,) * 7, "q_max": (1.5,) * 7},
    ending=Ending(outcome=Outcome.RCM_LIMIT, t_s=0.1 + 0.2, detail="shaft 60.00 mm from the trocar"),
)


def test_the_base_blocks_give_the_columns_that_outside_tools_rely_on():
    columns = [column for block in base_blocks(7) for column in block.columns]
    assert set(CONTRACT) <= set(columns)
    assert len(set(columns)) == len(columns)
    assert columns[0] == "t_s"


@pytest.mark.parametrize(
    ("block", "first", "last"),
    [
        (joints("tau_tip_", "nm", 7), "tau_tip_1_nm", "tau_tip_7_nm"),
        (vector("tip", "m"), "tip_x_m", "tip_z_m"),
        (vector("force", "n"), "force_x_n", "force_z_n"),
        (scalar("manipulability"), "manipulability", "manipulability"),
        (scalar("t", "s"), "t_s", "t_s"),
    ],
)
def test_block_columns(block, first, last):
    assert (block.columns[0], block.columns[-1]) == (first, last)


def _small(data):
    return Trace(data, (scalar("t", "s"), vector("tip", "m"), joints("q", "rad", 7)), META)


def test_columns_and_blocks_are_found_by_name():
    data = np.arange(22.0).reshape(2, 11)
    trace = _small(data)
    assert len(trace) == 2
    np.testing.assert_array_equal(trace["tip_y_m"], [2.0, 13.0])
    np.testing.assert_array_equal(trace.block("tip"), data[:, 1:4])
    np.testing.assert_array_equal(trace.block("q"), data[:, 4:])
    assert [block.name for block in trace.blocks] == ["t", "tip", "q"]
    with pytest.raises(KeyError):
        trace["tip_w_m"]


def test_data_cannot_be_changed_from_inside_or_outside():
    data = np.zeros((2, 11))
    trace = _small(data)
    data[0, 0] = 5.0
    assert trace["t_s"][0] == 0.0
    for view in (trace.data, trace["t_s"], trace.block("q")):
        with pytest.raises(ValueError, match="read-only"):
            view[0] = 1.0


@pytest.mark.parametrize("shape", [(2, 10), (2, 12), (11,), (2, 11, 1)])
def test_data_of_another_shape_is_refused(shape):
    with pytest.raises(ValueError, match=re.escape(f"{shape} data for 11 columns")):
        _small(np.zeros(shape))


def test_equal_traces_are_bit_for_bit_equal_but_for_machine_time(trace_of):
    q = np.random.default_rng(0).standard_normal((3, 7))
    trace = trace_of(3, q=q, control_time=1e-4)
    assert trace.equals(trace_of(3, q=q, control_time=2e-4))  # other columns are NaN in both
    changed = q.copy()
    changed[1, 2] = np.nextafter(q[1, 2], 1e9)
    assert not trace.equals(trace_of(3, q=changed, control_time=1e-4))
    assert not trace.equals(trace_of(2, q=q[:2]))
    assert not trace.equals(_small(np.zeros((3, 11))))


def test_meta_data_survives_json():
    back = TraceMeta.from_json(META.to_json())
    assert back.to_json() == META.to_json()
    assert back.ending == META.ending
    assert back.scenario == META.scenario
    assert back.limits == {"q_min": [-1.0] * 7, "q_max": [1.5] * 7}


def _damaged(**changes):
    return json.dumps({**json.loads(META.to_json()), **changes})


ENDING = {"outcome": "completed", "t_s": 1.0, "detail": ""}


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "null",
        "{}",
        _damaged(limits=None),
        _damaged(limits={"q_min": ["a"]}),
        _damaged(ending=None),
        _damaged(ending={**ENDING, "outcome": "won"}),
        _damaged(ending={**ENDING, "outcome": 1}),
        _damaged(ending={**ENDING, "t_s": None}),
        _damaged(control_period_s="fast"),
        _damaged(control_period_s=None),
    ],
)
def test_damaged_meta_data_is_a_value_error(text):
    with pytest.raises(ValueError):  # noqa: PT011 - JSON's own is a ValueError too
        TraceMeta.from_json(text)


@pytest.mark.parametrize("rings", [1, 6, 7, 8])
def test_what_is_numbered_and_no_joint_has_the_same_columns_however_many_there_are(rings):
    pegs = [(0.03 * i - 0.1, y) for y in (-0.05, 0.05) for i in range(rings)]
    config = PegBoardConfig(source_m=tuple(pegs[:rings]), target_m=tuple(pegs[rings:]))
    first = config.build(np.random.default_rng(0)).columns[0]
    assert first.columns == tuple(f"ring_state_{i}" for i in range(1, rings + 1))
    assert joints("q", "rad", rings).columns == tuple(f"q{i}_rad" for i in range(1, rings + 1))
