"""LeRobot's layout v3.0, checked against what its library reads, and the steps against the trace."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from surgsim.errors import SurgsimError
from surgsim.export.episodes import _asked_every, check_alike, episode_of
from surgsim.export.feature_stats import PictureStats, vector_stats
from surgsim.export.lerobot import write_lerobot

ARROW = {"float32": pa.float32(), "int64": pa.int64(), "bool": pa.bool_()}
STATISTICS = {"min", "max", "mean", "std", "count", "q01", "q10", "q50", "q90", "q99"}


@pytest.fixture(scope="module")
def plain(run, tmp_path_factory):
    """Two episodes without pictures."""
    folder = tmp_path_factory.mktemp("lerobot") / "set"
    write_lerobot(folder, [run, run])
    return folder


def info_of(folder):
    return json.loads((folder / "meta" / "info.json").read_text(encoding="utf-8"))


def data_of(folder):
    info, episodes = info_of(folder), pq.read_table(folder / "meta/episodes/chunk-000/file-000.parquet")
    tables = []
    for row in episodes.to_pylist():
        path = info["data_path"].format(
            chunk_index=row["data/chunk_index"], file_index=row["data/file_index"]
        )
        tables.append(pq.read_table(folder / path))
    return info, episodes.to_pylist(), tables


def test_info_has_what_the_library_asks_for(plain, run):
    info = info_of(plain)
    assert info["codebase_version"] == "v3.0"
    assert (info["total_episodes"], info["total_tasks"], info["fps"]) == (2, 1, 50)
    assert info["splits"] == {"train": "0:2"}
    assert info["chunks_size"] == 1000
    assert info["video_path"] is None
    assert {"timestamp", "frame_index", "episode_index", "index", "task_index", "action"} <= set(
        info["features"]
    )
    for name, feature in info["features"].items():
        assert set(feature) == {"dtype", "shape", "names"}
        assert "/" not in name
        assert feature["names"] is None or len(feature["names"]) == feature["shape"][0]


def test_columns_are_of_their_features_types_and_indices_go_on(plain):
    info, episodes, tables = data_of(plain)
    begin = 0
    for index, (row, table) in enumerate(zip(episodes, tables, strict=True)):
        assert set(table.column_names) == set(info["features"])
        for name, feature in info["features"].items():
            (width,), kind = feature["shape"], ARROW[feature["dtype"]]
            assert table.schema.field(name).type == (kind if width == 1 else pa.list_(kind, width)), name
        count = table.num_rows
        assert row["length"] == count
        assert (row["dataset_from_index"], row["dataset_to_index"]) == (begin, begin + count)
        assert table["index"].to_pylist() == list(range(begin, begin + count))
        assert table["frame_index"].to_pylist() == list(range(count))
        assert set(table["episode_index"].to_pylist()) == {index} == {row["episode_index"]}
        times = np.array(table["timestamp"].to_pylist())
        assert times == pytest.approx(np.arange(count) / info["fps"], abs=1e-4)
        assert table["next.done"].to_pylist() == [False] * (count - 1) + [True]
        assert table["next.success"].to_pylist()[:-1] == [False] * (count - 1)
        begin += count
    assert info["total_frames"] == begin


def test_tasks_are_looked_up_by_their_words(plain, run):
    tasks = pd.read_parquet(plain / "meta" / "tasks.parquet")
    described = run.trace.meta.scenario["description"]
    assert tasks.index.tolist() == [described]
    assert tasks.loc[described].task_index == 0
    assert tasks.iloc[0].name == described
    _, episodes, _ = data_of(plain)
    assert [row["tasks"] for row in episodes] == [[described]] * 2


def test_statistics_of_every_feature(plain):
    info, episodes, tables = data_of(plain)
    whole = json.loads((plain / "meta" / "stats.json").read_text(encoding="utf-8"))
    assert set(whole) == set(info["features"])
    actions = np.concatenate([np.array(table["action"].to_pylist()) for table in tables])
    assert whole["action"]["mean"] == pytest.approx(actions.mean(axis=0).tolist())
    assert whole["action"]["q50"] == pytest.approx(np.median(actions, axis=0).tolist())
    assert whole["action"]["count"] == [len(actions)]
    for name, feature in info["features"].items():
        assert set(whole[name]) == STATISTICS
        assert all(len(value) == feature["shape"][0] for key, value in whole[name].items() if key != "count")
        assert {key for key in episodes[0] if key.startswith(f"stats/{name}/")} == {
            f"stats/{name}/{key}" for key in STATISTICS
        }


def test_where_it_comes_from(plain):
    told = json.loads((plain / "meta" / "surgsim.json").read_text(encoding="utf-8"))["episodes"]
    assert [(one["controller"], one["seed"], one["outcome"]) for one in told] == [
        ("pinv", 3, "completed")
    ] * 2


def test_states_actions_and_rewards_are_those_of_the_trace(run):
    trace, steps = run.trace, episode_of(run)
    assert steps.rows.tolist() == list(range(0, len(trace) - len(trace) % 20 + 1, 20))[: len(steps) + 1]
    for name, column in zip(steps.state_names, steps.state.T, strict=True):
        assert np.array_equal(column, trace[name][steps.rows])
    p_ref = trace.block("tip_ref")
    assert p_ref[0] + np.cumsum(steps.action, axis=0) / 50 == pytest.approx(p_ref[steps.rows[1:]], abs=1e-12)
    ended = steps.rows[1:]
    tip, rcm = 1e3 * trace["tip_error_m"][ended], 1e3 * trace["rcm_error_m"][ended]
    assert steps.reward == pytest.approx(0.5 / (1.0 + tip) + 0.5 / (1.0 + rcm / 5.0))


@pytest.mark.parametrize(("action", "block"), [("joint_velocity", "qdot_ref"), ("torque", "tau")])
def test_actions_are_means_over_the_ticks_of_a_step(run, action, block):
    steps = episode_of(run, action, 100.0)
    assert (steps.rate_hz, len(steps)) == (100, (len(run.trace) - 1) // 10)
    values = run.trace.block(block)
    for k in (0, len(steps) - 1):
        assert steps.action[k] == pytest.approx(sum(values[10 * k + i] for i in range(10)) / 10)


def test_the_rate_of_a_policy():
    policy = {"type": "policy", "decimation": 5}
    assert _asked_every({"controller": {"resolver": policy, "torque_law": {"type": "x"}}}) == 5
    assert _asked_every({"controller": {"resolver": {"type": "pinv"}, "torque_law": policy}}) == 5
    assert _asked_every({"controller": {"resolver": {"type": "pinv"}, "torque_law": None}}) == 20


@pytest.mark.parametrize("rate", [30.0, 2000.0, 0.4])
def test_a_rate_that_is_no_whole_share_of_the_loops(run, rate):
    with pytest.raises(SurgsimError, match=r"--rate: .* Hz is not allowed"):
        episode_of(run, rate_hz=rate)


def test_runs_that_make_no_data_set(run, run_folder, unrecorded, told, tmp_path):
    with pytest.raises(SurgsimError, match="'velocity' is not a kind of action"):
        episode_of(run, "velocity")
    one = episode_of(run)
    with pytest.raises(SurgsimError, match="differ in their arm: a data set has one"):
        check_alike([one, replace(one, robot="panda")])
    out, none = tmp_path / "set", ("--camera", "none")
    assert "a run without recording" in told(unrecorded, "--lerobot", out, *none)[1]
    assert list(tmp_path.iterdir()) == []
    out.mkdir()
    (out / "precious").write_text("")
    assert told(run_folder, "--lerobot", out, *none)[1].endswith("is there already; --force replaces it\n")
    assert "is no LeRobot data set" in told(run_folder, "--lerobot", out, *none, "--force")[1]
    assert [path.name for path in out.iterdir()] == ["precious"]


def test_statistics_of_pictures_against_numpy():
    rng = np.random.default_rng(0)
    shown = [rng.integers(0, 256, (6, 8, 3), dtype=np.uint8) for _ in range(3)]
    one, two = PictureStats(), PictureStats()
    one.add(shown[0])
    two.add(shown[1])
    two.add(shown[2])
    found = (one + two).stats()
    values = np.array(shown).reshape(-1, 3) / 255.0
    wanted = vector_stats(values)
    for name in ("min", "max", "mean", "std"):
        assert found[name].shape == (3, 1, 1)
        assert found[name].ravel() == pytest.approx(wanted[name])
    for name, share in (("q10", 0.1), ("q50", 0.5), ("q99", 0.99)):
        exact = np.quantile(values, share, axis=0, method="inverted_cdf")
        assert found[name].ravel() == pytest.approx(exact)
    assert found["count"].tolist() == [3]


@pytest.mark.needs("video")
def test_pictures_of_every_step(run, blind, tmp_path):
    import av

    counts = []
    write_lerobot(
        tmp_path / "set",
        [run, run],
        rate_hz=10.0,
        cameras=("inside",),
        size=(64, 48),
        progress=lambda *count: counts.append(count),
    )
    info, episodes, tables = data_of(tmp_path / "set")
    key = "observation.images.inside"
    assert info["features"][key]["shape"] == [48, 64, 3]
    assert counts[-1] == (info["total_frames"],) * 2
    shown = iter(range(1, 100))
    for row, table in zip(episodes, tables, strict=True):
        place = {name: row[f"videos/{key}/{name}"] for name in ("chunk_index", "file_index")}
        with av.open(str(tmp_path / "set" / info["video_path"].format(video_key=key, **place))) as container:
            stream = container.streams.video[0]
            frames = list(container.decode(stream))
            assert (stream.average_rate, stream.codec_context.pix_fmt) == (info["fps"], "yuv420p")
            assert (stream.codec_context.name, stream.width, stream.height) == ("h264", 64, 48)
        assert len(frames) == table.num_rows
        assert [frame.time for frame in frames] == pytest.approx(table["timestamp"].to_pylist(), abs=1e-4)
        assert row[f"videos/{key}/to_timestamp"] == pytest.approx(row["length"] / info["fps"])
        for frame in frames:
            level = frame.to_ndarray(format="rgb24").mean()
            assert level == pytest.approx(40 * next(shown) % 256, abs=6.0)
        assert np.shape(row[f"stats/{key}/mean"]) == (3, 1, 1)
    assert all(before == drawn for *_, before, drawn in blind)  # no path is drawn
