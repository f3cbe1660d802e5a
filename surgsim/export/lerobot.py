"""Data sets in LeRobot's layout, version 3.0: episodes with states, actions, rewards and camera pictures.

Written with pyarrow and PyAV alone; one file of data, and one of each camera, for each episode. The layout is
that of `lerobot` 0.4: meta/info.json, meta/stats.json, meta/tasks.parquet, meta/episodes, data, videos.
"""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from surgsim.errors import SurgsimError
from surgsim.export.episodes import Action, Episode, check_alike, episode_of, origin_of, runs_of
from surgsim.export.feature_stats import PictureStats, Stats, vector_stats
from surgsim.export.moving import mp4
from surgsim.export.replayed import replayed
from surgsim.export.subjects import Subject
from surgsim.recording.files import write_file
from surgsim.runs.folder import whole_folder

VERSION = "v3.0"
INFO = "meta/info.json"
DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
EPISODES = "meta/episodes/chunk-000/file-000.parquet"

_FILES_OF_A_CHUNK = 1000
_QUALITY = {"crf": "23", "preset": "medium", "g": "2", "bf": "0"}  # pictures are read in any order
_INDICES = ("timestamp", "frame_index", "episode_index", "index", "task_index")
Progress = Callable[[int, int], None]
Table = dict[str, pa.Array]


def check_lerobot(folder: Path, *, force: bool) -> None:
    """Refuse a folder that must not be written.

    Raises:
        SurgsimError: If it is there and not to be replaced, or is no data set.
    """
    if not folder.exists():
        return
    if not force:
        raise SurgsimError(f"--lerobot {folder}: is there already; --force replaces it")
    if not (folder / INFO).is_file():
        raise SurgsimError(f"--lerobot {folder}: is no LeRobot data set, and is not replaced")


def write_lerobot(
    folder: Path,
    subjects: Sequence[Subject],
    *,
    action: Action = "tip_velocity",
    rate_hz: float | None = None,
    cameras: Sequence[str] = (),
    size: tuple[int, int] = (320, 240),
    progress: Progress | None = None,
) -> None:
    """Write an episode for each run.

    Args:
        folder: The data set; replaced if it is there.
        subjects: Runs and batches.
        action: What is taken for the action.
        rate_hz: Steps a second; None: the policy's own, see `episode_of`.
        cameras: Names of cameras; none: no pictures.
        size: Width and height of a picture [pixels].
        progress: Told of every picture.

    Raises:
        SurgsimError: If the runs do not go together, one was not recorded, or the disk refuses.
    """
    episodes = [episode_of(run, action, rate_hz) for run in runs_of(subjects)]
    check_alike(episodes)
    with whole_folder(folder) as draft:
        _write(draft, episodes, cameras, size, progress)


def _write(
    root: Path,
    episodes: Sequence[Episode],
    cameras: Sequence[str],
    size: tuple[int, int],
    progress: Progress | None,
) -> None:
    tasks = list(dict.fromkeys(episode.task for episode in episodes))
    total = sum(map(len, episodes)) * len(cameras)
    pictures: dict[str, PictureStats] = {key_of(camera): PictureStats() for camera in cameras}
    rows, start, drawn = [], 0, 0
    for index, episode in enumerate(episodes):
        data = _data(episode, index, start, tasks.index(episode.task))
        _write_table(root / DATA.format(**_place(index)), data)
        stats = {name: vector_stats(_values(column)) for name, column in data.items()}
        if cameras:
            seen = _film(root, episode, index, cameras, size, _counting(progress, drawn, total))
            stats |= {key: found.stats() for key, found in seen.items()}
            pictures = {key: pictures[key] + found for key, found in seen.items()}
        rows.append(_about(episode, index, start, stats, cameras))
        start, drawn = start + len(episode), drawn + len(episode) * len(cameras)
    _write_meta(root, episodes, tasks, rows, pictures, size)


def key_of(camera: str) -> str:
    """What LeRobot calls the pictures of a camera."""
    return f"observation.images.{camera}"


def _place(index: int) -> dict[str, int]:
    """Chunk and file of an episode."""
    return {"chunk_index": index // _FILES_OF_A_CHUNK, "file_index": index % _FILES_OF_A_CHUNK}


def _data(episode: Episode, index: int, start: int, task: int) -> Table:
    """Columns of an episode, a row for each step."""
    count = len(episode)
    frames = np.arange(count, dtype=np.int64)
    last = frames == count - 1
    return {
        "observation.state": _vectors(episode.state[:-1]),
        "action": _vectors(episode.action),
        "next.reward": pa.array(episode.reward.astype(np.float32)),
        "next.done": pa.array(last),
        "next.success": pa.array(last & (episode.success is True)),
        "timestamp": pa.array((frames / episode.rate_hz).astype(np.float32)),
        "frame_index": pa.array(frames),
        "episode_index": pa.array(np.full(count, index, dtype=np.int64)),
        "index": pa.array(start + frames),
        "task_index": pa.array(np.full(count, task, dtype=np.int64)),
    }


def _vectors(values: np.ndarray[Any, Any]) -> pa.Array:
    """Vectors (rows, width) as lists of a fixed size, in single precision."""
    flat = pa.array(np.ascontiguousarray(values, dtype=np.float32).ravel())
    return pa.FixedSizeListArray.from_arrays(flat, values.shape[1])


def _values(column: pa.Array) -> np.ndarray[Any, Any]:
    """The values of a column (rows, width) in double precision."""
    flat = column.values if pa.types.is_fixed_size_list(column.type) else column
    numbers = np.array(flat.to_numpy(zero_copy_only=False), dtype=np.float64)
    return numbers.reshape(len(column), -1)


def _film(
    root: Path,
    episode: Episode,
    index: int,
    cameras: Sequence[str],
    size: tuple[int, int],
    tell: Callable[[], None],
) -> dict[str, PictureStats]:
    """Draw what each camera saw at the beginning of every step, without any path, into a file each."""
    found = {}
    with replayed(episode.run.trace, *size) as look:
        for camera in cameras:
            file = root / VIDEO.format(video_key=key_of(camera), **_place(index))
            file.parent.mkdir(parents=True, exist_ok=True)
            found[key_of(camera)] = seen = PictureStats()
            with mp4(file, 1.0 / episode.rate_hz, size, _QUALITY) as film:
                for row in episode.rows[:-1]:
                    picture = look.picture(int(row), camera, paths=False)
                    seen.add(picture)
                    film.add(picture)
                    tell()
    return found


def _counting(progress: Progress | None, done: int, total: int) -> Callable[[], None]:
    """What is called after every picture."""
    count = done

    def tell() -> None:
        nonlocal count
        count += 1
        if progress:
            progress(count, total)

    return tell


def _about(
    episode: Episode, index: int, start: int, stats: dict[str, Stats], cameras: Sequence[str]
) -> dict[str, Any]:
    """The row of an episode: where its data are, and their statistics."""
    place = _place(index)
    row: dict[str, Any] = {
        "episode_index": index,
        "tasks": [episode.task],
        "length": len(episode),
        **{f"data/{name}": value for name, value in place.items()},
        "dataset_from_index": start,
        "dataset_to_index": start + len(episode),
    }
    for camera in cameras:
        key = f"videos/{key_of(camera)}"
        row |= {f"{key}/{name}": value for name, value in place.items()}
        row |= {f"{key}/from_timestamp": 0.0, f"{key}/to_timestamp": len(episode) / episode.rate_hz}
    row |= {
        f"stats/{name}/{key}": value.tolist() for name, one in stats.items() for key, value in one.items()
    }
    return row | {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}


def _write_meta(
    root: Path,
    episodes: Sequence[Episode],
    tasks: Sequence[str],
    rows: Sequence[dict[str, Any]],
    pictures: dict[str, PictureStats],
    size: tuple[int, int],
) -> None:
    table = pa.Table.from_pylist(list(rows))
    _write_table(root / EPISODES, {name: table[name].combine_chunks() for name in table.column_names})
    _write_tasks(root / "meta" / "tasks.parquet", tasks)
    whole: dict[str, Stats] = {key: found.stats() for key, found in pictures.items()}
    data = [pq.read_table(root / DATA.format(**_place(index))) for index in range(len(episodes))]
    columns = pa.concat_tables(data)
    whole |= {name: vector_stats(_values(columns[name].combine_chunks())) for name in columns.column_names}
    stats = {name: {key: value.tolist() for key, value in one.items()} for name, one in whole.items()}
    _write_json(root / "meta" / "stats.json", stats)
    _write_json(root / INFO, info_of(episodes, len(tasks), list(pictures), size))
    told = [origin_of(episode) for episode in episodes]
    _write_json(root / "meta" / "surgsim.json", {"episodes": told})


def info_of(
    episodes: Sequence[Episode], tasks: int, video_keys: Sequence[str], size: tuple[int, int]
) -> dict[str, Any]:
    """What `meta/info.json` holds."""
    first = episodes[0]
    return {
        "codebase_version": VERSION,
        "robot_type": first.robot,
        "total_episodes": len(episodes),
        "total_frames": sum(map(len, episodes)),
        "total_tasks": tasks,
        "chunks_size": _FILES_OF_A_CHUNK,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": first.rate_hz,
        "splits": {"train": f"0:{len(episodes)}"},
        "data_path": DATA,
        "video_path": VIDEO if video_keys else None,
        "features": {
            "observation.state": _feature("float32", first.state_names),
            "action": _feature("float32", first.action_names),
            "next.reward": _feature("float32"),
            "next.done": _feature("bool"),
            "next.success": _feature("bool"),
            **{key: _video_feature(first.rate_hz, size) for key in video_keys},
            **{name: _feature("float32" if name == "timestamp" else "int64") for name in _INDICES},
        },
    }


def _feature(dtype: str, names: Sequence[str] | None = None) -> dict[str, Any]:
    return {"dtype": dtype, "shape": [len(names) if names else 1], "names": list(names) if names else None}


def _video_feature(rate_hz: int, size: tuple[int, int]) -> dict[str, Any]:
    width, height = size
    return {
        "dtype": "video",
        "shape": [height, width, 3],
        "names": ["height", "width", "channels"],
        "info": {
            "video.height": height,
            "video.width": width,
            "video.codec": "h264",
            "video.pix_fmt": "yuv420p",
            "video.is_depth_map": False,
            "video.fps": rate_hz,
            "video.channels": 3,
            "has_audio": False,
        },
    }


def _write_tasks(path: Path, tasks: Sequence[str]) -> None:
    """The tasks as pandas writes them: their words are the index, which LeRobot looks them up by."""
    index = "__index_level_0__"
    kinds = (("task_index", "task_index", "int64", "int64"), (None, index, "unicode", "object"))
    told = {
        "index_columns": [index],
        "column_indexes": [],
        "columns": [
            {"name": name, "field_name": field, "pandas_type": kind, "numpy_type": numpy, "metadata": None}
            for name, field, kind, numpy in kinds
        ],
        "creator": {"library": "pyarrow", "version": pa.__version__},
        "pandas_version": None,
    }
    columns = {
        "task_index": pa.array(range(len(tasks)), pa.int64()),
        index: pa.array(list(tasks), pa.string()),
    }
    _write_table(path, columns, {"pandas": json.dumps(told)})


def _write_table(path: Path, columns: Table, metadata: dict[str, str] | None = None) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    table, content = pa.table(columns).replace_schema_metadata(metadata), pa.BufferOutputStream()
    pq.write_table(table, content, compression="snappy")
    write_file(path, content.getvalue().to_pybytes())


def _write_json(path: Path, content: dict[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    write_file(path, json.dumps(content, indent=4, ensure_ascii=False) + "\n")
