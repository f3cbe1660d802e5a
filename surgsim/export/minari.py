"""Data sets in Minari's layout: episodes with states, actions and rewards, as Parquet.

The layout is that of `minari` 0.5 with `data_format` parquet: data/metadata.json, and for each episode a
folder data/N with metadata.json and part-0.parquet, which has one row more than there are steps. Spaces are
boxes, in Minari's JSON. Pictures are left out.
"""

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from surgsim.array import Array
from surgsim.control.resolvers.policy import PolicyConfig
from surgsim.errors import Outcome, SurgsimError
from surgsim.export.episodes import Action, Episode, check_alike, episode_of, origin_of, runs_of
from surgsim.export.subjects import Subject
from surgsim.recording.files import write_file
from surgsim.runs.folder import whole_folder

VERSION = "0.5.4"
META = "data/metadata.json"
_ID = re.compile(r"[-\w]+-v\d+")
_LIMITS: dict[Action, str] = {"joint_velocity": "velocity", "torque": "torque"}


def check_minari(folder: Path, *, force: bool) -> None:
    """Refuse a folder that must not be written, or whose name is no data set's.

    Raises:
        SurgsimError: If its name is not one, it is there and not to be replaced, or is no data set.
    """
    if not _ID.fullmatch(folder.name):
        raise SurgsimError(f"--minari {folder}: a data set is named NAME-vN, such as circle-v0")
    if not folder.exists():
        return
    if not force:
        raise SurgsimError(f"--minari {folder}: is there already; --force replaces it")
    if not (folder / META).is_file():
        raise SurgsimError(f"--minari {folder}: is no Minari data set, and is not replaced")


def write_minari(
    folder: Path,
    subjects: Sequence[Subject],
    *,
    action: Action = "tip_velocity",
    rate_hz: float | None = None,
) -> None:
    """Write an episode for each run.

    Args:
        folder: The data set; replaced if it is there. Its name is the data set's.
        subjects: Runs and batches.
        action: What is taken for the action.
        rate_hz: Steps a second; None: the policy's own, see `episode_of`.

    Raises:
        SurgsimError: If the runs do not go together, one was not recorded, or the disk refuses.
    """
    episodes = [episode_of(run, action, rate_hz) for run in runs_of(subjects)]
    check_alike(episodes)
    with whole_folder(folder) as draft:
        for index, episode in enumerate(episodes):
            place = draft / "data" / str(index)
            place.mkdir(parents=True)
            write_file(place / "part-0.parquet", _steps(episode))
            about = {"id": index, "total_steps": len(episode), "seed": episode.run.named[2]}
            write_file(place / "metadata.json", json.dumps({**about, "surgsim": origin_of(episode)}))
        size = sum(file.stat().st_size for file in draft.rglob("*") if file.is_file())
        write_file(draft / META, json.dumps(_about(folder.name, episodes, action, size), indent=2))


def _steps(episode: Episode) -> bytes:
    """An episode's rows; the last one has the state that the last step reaches, and nothing else."""
    last = np.arange(len(episode)) == len(episode) - 1
    completed = episode.run.outcome == Outcome.COMPLETED.name.lower()
    table = pa.table(
        {
            "observations": _vectors(episode.state),
            "actions": _vectors(np.vstack([episode.action, np.zeros_like(episode.action[:1])])),
            "rewards": pa.array(np.append(episode.reward, 0.0)),
            "terminations": pa.array(np.append(last & (not completed), False)),
            "truncations": pa.array(np.append(last & completed, False)),
        }
    )
    content = pa.BufferOutputStream()
    pq.write_table(table, content)
    return bytes(content.getvalue())


def _vectors(values: Array) -> pa.Array:
    flat = pa.array(np.ascontiguousarray(values, dtype=np.float32).ravel())
    return pa.FixedSizeListArray.from_arrays(flat, values.shape[1])


def _about(name: str, episodes: Sequence[Episode], action: Action, size: int) -> dict[str, Any]:
    """What `data/metadata.json` holds."""
    first = episodes[0]
    return {
        "dataset_id": name,
        "minari_version": VERSION,
        "data_format": "parquet",
        "jpeg_encoding": False,
        "total_episodes": len(episodes),
        "total_steps": sum(map(len, episodes)),
        "dataset_size": round(size / 1e6, 1),
        "observation_space": _box(np.full(first.state.shape[1], np.inf)),
        "action_space": _box(_bounds(episodes, action)),
        "description": "; ".join(dict.fromkeys(episode.task for episode in episodes)),
        "algorithm_name": ", ".join(dict.fromkeys(episode.run.named[1] for episode in episodes)),
        "surgsim": {
            "robot": first.robot,
            "rate_hz": first.rate_hz,
            "observations": list(first.state_names),
            "actions": list(first.action_names),
        },
    }


def _bounds(episodes: Sequence[Episode], action: Action) -> Array:
    """Bounds of an action: the arm's limits, or an environment's of a tip velocity; more if there is more."""
    width = episodes[0].action.shape[1]
    limits = episodes[0].run.trace.meta.limits
    known = limits[_LIMITS[action]] if action in _LIMITS else np.full(width, _TIP_SPEED_M_PER_S)
    largest: Array = np.maximum(
        known, np.max([np.abs(episode.action).max(axis=0) for episode in episodes], axis=0)
    )
    return largest


def _box(high: Array) -> str:
    """Minari's text of a box from -high to high, in single precision."""
    bound = np.nextafter(high.astype(np.float32), np.float32(np.inf)).astype(np.float64)
    box = {
        "type": "Box",
        "dtype": "float32",
        "shape": [len(bound)],
        "low": (-bound).tolist(),
        "high": bound.tolist(),
    }
    return json.dumps(box)


_TIP_SPEED_M_PER_S: float = PolicyConfig().tip_speed_max_m_per_s
