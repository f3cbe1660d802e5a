"""Minari's layout 0.5, checked against what its library reads."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from surgsim.export.episodes import episode_of


def test_the_layout_and_what_is_in_it(run, run_folder, told, tmp_path):
    folder = tmp_path / "circle-v0"
    assert told(run_folder, run_folder, "--minari", folder, "--action", "joint_velocity")[0] == 0
    about = json.loads((folder / "data" / "metadata.json").read_text(encoding="utf-8"))
    wanted = episode_of(run, "joint_velocity")
    assert (about["dataset_id"], about["data_format"]) == ("circle-v0", "parquet")
    assert (about["total_episodes"], about["total_steps"]) == (2, 2 * len(wanted))
    spaces = {name: json.loads(about[f"{name}_space"]) for name in ("observation", "action")}
    for space, width in zip(spaces.values(), (wanted.state.shape[1], 7), strict=True):
        assert (space["type"], space["dtype"], space["shape"]) == ("Box", "float32", [width])
        assert len(space["low"]) == len(space["high"]) == width
    limits = run.trace.meta.limits["velocity"]
    assert spaces["action"]["high"] == pytest.approx(limits, rel=1e-6)
    assert np.less_equal(limits, spaces["action"]["high"]).all()
    assert sorted(path.name for path in (folder / "data").iterdir()) == ["0", "1", "metadata.json"]
    for index in (0, 1):
        place = folder / "data" / str(index)
        told_of = json.loads((place / "metadata.json").read_text(encoding="utf-8"))
        assert (told_of["id"], told_of["total_steps"], told_of["seed"]) == (index, len(wanted), 3)
        table = pq.read_table(place / "part-0.parquet")
        assert table.num_rows == len(wanted) + 1
        assert table.schema.field("observations").type == pa.list_(pa.float32(), wanted.state.shape[1])
        assert table.schema.field("actions").type == pa.list_(pa.float32(), 7)
        assert np.array(table["observations"].to_pylist()) == pytest.approx(wanted.state, abs=1e-5)
        assert np.array(table["actions"].to_pylist())[:-1] == pytest.approx(wanted.action, abs=1e-6)
        assert table["rewards"].to_pylist()[:-1] == wanted.reward.tolist()
        assert table["terminations"].to_pylist() == [False] * (len(wanted) + 1)
        assert table["truncations"].to_pylist() == [False] * (len(wanted) - 1) + [True, False]


def test_folders_that_are_refused(run_folder, told, tmp_path):
    plain, there = tmp_path / "circle", tmp_path / "circle-v0"
    assert told(run_folder, "--minari", plain) == (
        2,
        f"surgsim: --minari {plain}: a data set is named NAME-vN, such as circle-v0\n",
    )
    there.mkdir()
    assert told(run_folder, "--minari", there)[1].endswith("is there already; --force replaces it\n")
    assert "is no Minari data set" in told(run_folder, "--minari", there, "--force")[1]
    assert list(there.iterdir()) == []
