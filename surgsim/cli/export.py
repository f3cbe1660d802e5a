"""`surgsim export`."""

import argparse
import ctypes.util
import json
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from surgsim.cli.paths import path_argument

if TYPE_CHECKING:
    from surgsim.export.subjects import Subject

_EPISODE_SIZE = (320, 240)
_LEAST, _MOST = 0.01, 1000.0  # of --speed and --fps
HELP = "take data, tables, figures, videos and episodes out of runs"
EXAMPLES = """RUN, BATCH and STUDY are paths, or names below runs/, runs/suites/ and results/. What is written
follows from the file's suffix; several files can be written in one call.

examples:
  surgsim export circle_lwr4plus/vprnn-seed0 --data run.mat
  surgsim export runs/quick --data runs.parquet --table controllers.tex
  surgsim export runs/one runs/other --figure errors.pdf --width page
  surgsim export runs/one --video run.mp4 --camera overview,inside,endoscope
  surgsim export runs/one runs/other --video both.gif --speed 2
  surgsim export runs/quick --lerobot episodes --camera endoscope,inside
  surgsim export runs/quick --minari quick-v0 --action torque
  surgsim export runs/quick --table forces.md --metric trocar_force_max_n
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("names", nargs="+", metavar="RUN|BATCH|STUDY", help="what is exported")
    parser.add_argument("--run", action="append", default=[], metavar="RUN_ID", help="a run of the batch")
    _add_files(parser, "--data", "FILE.mat|.npz|.parquet", "every tick of a run, every run of a batch")
    _add_files(parser, "--table", "FILE.tex|.md|.csv", "controllers of a batch, or runs, with their metrics")
    _add_files(
        parser,
        "--figure",
        "FILE.pdf|.svg|.png",
        "errors of runs over time, controllers of a batch, rows of a study",
    )
    parser.add_argument(
        "--metric", default="", metavar="A,B", help="metrics of table and figure; of a study columns"
    )
    parser.add_argument(
        "--width", choices=("column", "page"), default="column", help="of a figure: 3.5 or 7.2 inch"
    )
    _add_files(parser, "--video", "FILE.mp4|.gif", "runs side by side, in step")
    parser.add_argument(
        "--camera",
        default="overview",
        metavar="A,B",
        help="of videos and episodes: overview, port_closeup, inside, endoscope; default: overview",
    )
    parser.add_argument(
        "--speed", type=float, default=1.0, metavar="X", help="of a video: 2 is twice as fast"
    )
    parser.add_argument("--fps", type=float, metavar="N", help="pictures a second; default: 25, of a GIF 10")
    parser.add_argument(
        "--size",
        metavar="WxH",
        help="of the pictures; default: 1280x720, of a GIF 480x270, of episodes 320x240",
    )
    parser.add_argument("--lerobot", type=path_argument, metavar="DIR", help="runs as episodes to learn from")
    parser.add_argument("--minari", type=path_argument, metavar="NAME-vN", help="the same for Minari")
    parser.add_argument(
        "--action",
        choices=("tip_velocity", "joint_velocity", "torque"),
        default="tip_velocity",
        help="what an episode's action is",
    )
    parser.add_argument(
        "--rate", type=float, metavar="HZ", help="steps a second; default: the policy's, or 50"
    )
    parser.add_argument("--study-table", metavar="NAME", help="which table of a study; default: its main one")
    parser.add_argument("--force", action="store_true", help="replace files that are there")
    parser.add_argument("--json", action="store_true", help="print JSON")


def _add_files(parser: argparse.ArgumentParser, option: str, metavar: str, text: str) -> None:
    parser.add_argument(option, type=path_argument, action="append", default=[], metavar=metavar, help=text)


def execute(options: argparse.Namespace) -> int:
    """Write every file that is asked for and print where it is."""
    if options.video or options.lerobot:
        draw_without_display()  # before anything imports MuJoCo
    from surgsim.errors import SurgsimError
    from surgsim.export.subjects import chosen, find
    from surgsim.packages import ENVIRONMENT, RECORDING, require

    for option, modules in (
        ("figure", ("matplotlib",)),
        ("video", (*RECORDING, "PIL", "OpenGL")),
        ("lerobot", (*RECORDING, *ENVIRONMENT, "PIL")),
        ("minari", (*RECORDING, *ENVIRONMENT)),
    ):
        if getattr(options, option):
            require(f"--{option} needs", *modules)
    jobs = _jobs(options)
    if not jobs:
        raise SurgsimError(
            "export: nothing to write: give --data, --table, --figure, --video, --lerobot or --minari"
        )
    subjects = chosen([find(name) for name in options.names], options.run)
    written = []
    for path, write in jobs:
        write(path, subjects)
        size = _size(path)
        written.append({"file": str(path), "bytes": size})
        if not options.json:
            print(f"{path}  {size / 1024:.0f} KiB", flush=True)
    if options.json:
        print(json.dumps(written, indent=2))
    return 0


def _size(path: Path) -> int:
    """Bytes of a file, or of all files in a folder."""
    files = [path] if path.is_file() else [file for file in path.rglob("*") if file.is_file()]
    return sum(file.stat().st_size for file in files)


Job = tuple[Path, Callable[[Path, Sequence["Subject"]], None]]


def _jobs(options: argparse.Namespace) -> list[Job]:
    """What is to be written, each file checked."""
    from surgsim.export import data, figure, table
    from surgsim.export.target import check_target

    jobs: list[Job] = []
    for path in options.data:
        check_target("--data", path, data.SUFFIXES, force=options.force)
        jobs.append((path, lambda path, subjects: data.write_data(path, subjects, options.study_table)))
    metrics = [name.strip() for name in options.metric.split(",") if name.strip()]
    for path in options.table:
        check_target("--table", path, table.SUFFIXES, force=options.force)
        jobs.append(
            (path, lambda path, subjects: table.write_table(path, subjects, metrics, options.study_table))
        )
    for path in options.figure:
        check_target("--figure", path, figure.SUFFIXES, force=options.force)
        jobs.append(
            (
                path,
                lambda path, subjects: figure.write_figure(
                    path, subjects, metrics, options.width, options.study_table
                ),
            )
        )
    for path in options.video:
        jobs.append((path, _video_job(path, options)))
    if options.lerobot:
        jobs.append((options.lerobot, _lerobot_job(options.lerobot, options)))
    if options.minari:
        jobs.append((options.minari, _minari_job(options)))
    return jobs


def _video_job(path: Path, options: argparse.Namespace) -> Callable[[Path, Sequence["Subject"]], None]:
    """What writes a video, with what it needs checked."""
    from surgsim.cli.output import show_count
    from surgsim.errors import SurgsimError
    from surgsim.export.moving import SUFFIXES, check_encoder
    from surgsim.export.target import check_target
    from surgsim.export.video import VideoSettings, parse_size, write_video

    check_target("--video", path, SUFFIXES, force=options.force)
    if path.suffix.lower() == ".mp4":
        check_encoder("--video FILE.mp4")
    cameras = _cameras(options)
    if not cameras:
        raise SurgsimError("--video needs a --camera")
    for option, value in (("--speed", options.speed), ("--fps", options.fps)):
        if value is not None and not _LEAST <= value <= _MOST:
            raise SurgsimError(f"{option}: {value:g} is not allowed: from {_LEAST:g} to {_MOST:g}")
    size = parse_size(options.size) if options.size else None
    settings = VideoSettings(cameras=cameras, speed=options.speed, fps=options.fps, size=size)

    def write(path: Path, subjects: Sequence["Subject"]) -> None:
        with show_count(f"drawing {path.name}", "pictures", quiet=options.json) as progress:
            write_video(path, subjects, settings, progress)

    return write


def _lerobot_job(path: Path, options: argparse.Namespace) -> Callable[[Path, Sequence["Subject"]], None]:
    """What writes a data set, with what it needs checked."""
    from surgsim.cli.output import show_count
    from surgsim.export.lerobot import check_lerobot, write_lerobot
    from surgsim.export.moving import check_encoder
    from surgsim.export.video import parse_size

    check_lerobot(path, force=options.force)
    cameras = _cameras(options)
    if cameras:
        check_encoder("--lerobot with pictures (--camera none leaves them out)")
    size = parse_size(options.size) if options.size else _EPISODE_SIZE

    def write(path: Path, subjects: Sequence["Subject"]) -> None:
        with show_count(f"drawing {path.name}", "pictures", quiet=options.json or not cameras) as progress:
            write_lerobot(
                path,
                subjects,
                action=options.action,
                rate_hz=options.rate,
                cameras=cameras,
                size=size,
                progress=progress,
            )

    return write


def _minari_job(options: argparse.Namespace) -> Callable[[Path, Sequence["Subject"]], None]:
    """What writes a data set for Minari, with its folder checked."""
    from surgsim.export.minari import check_minari, write_minari

    check_minari(options.minari, force=options.force)
    return lambda path, subjects: write_minari(path, subjects, action=options.action, rate_hz=options.rate)


def _cameras(options: argparse.Namespace) -> tuple[str, ...]:
    """The cameras that are named; `none` is none."""
    from surgsim.export.replayed import check_cameras

    cameras = tuple(name.strip() for name in options.camera.split(","))
    if cameras == ("none",):
        return ()
    check_cameras(cameras)
    return cameras


def draw_without_display() -> None:
    """Have MuJoCo draw by EGL or OSMesa where there is no display, unless the user says how it is to draw.

    It looks at the variable when it is imported.
    """
    if "MUJOCO_GL" in os.environ or "DISPLAY" in os.environ:
        return
    for library, value in (("EGL", "egl"), ("OSMesa", "osmesa")):
        if ctypes.util.find_library(library):
            os.environ["MUJOCO_GL"] = value
            return
