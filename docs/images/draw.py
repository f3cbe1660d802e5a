"""Makes the pictures, tables and pages of the documents again: what `make pictures` does.

The pictures of the scenes need OpenGL; a machine without it makes the rest and says so. Each picture carries
a stamp of what it was made from, and `tests/test_made.py` compares that with what is there now. Scenarios of
the gallery are run and drawn only where picture or result is out of date.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import concepts
import gallery
import numpy as np
import tables
from PIL import Image
from stamps import assets, digest, mark, save, save_again

from surgsim.errors import SurgsimError
from surgsim.models.arm import ArmModel
from surgsim.models.picture import render
from surgsim.protocol.figures import share
from surgsim.report.write import write_report
from surgsim.scenario.arms import drawn_scenes, each_arm
from surgsim.scenario.hashed import hashed
from surgsim.scenario.load import load_experiment, load_scenario
from surgsim.simulate.setup import Setup, beginning, prepare
from surgsim.studies.figure import BLUE, GREEN, ORANGE, PURPLE, VERMILLION, figure, legend_below

HERE = Path(__file__).parent
SCENES = {
    "theatre.png": ("circle_lwr4plus", "overview"),
    "port_closeup.png": ("circle_lwr4plus", "port_closeup"),
    "panda.png": ("circle_panda", "overview"),
    "fr3.png": ("circle_fr3", "overview"),
    "iiwa14.png": ("circle_iiwa14", "overview"),
    "two_ports.png": ("two_ports_panda", "overview"),
}
MOVING = {
    "theatre.gif": ("theatre_panda", "rcm_elastic_dynamics", "overview,inside", "2"),
    "rings.gif": ("peg_and_ring_panda", "passive_convex", "inside,endoscope", "8"),
    "endoscope.gif": ("endoscope_and_tool_panda", "rcm_inverse_dynamics", "overview,lens", "4"),
}
"""Scenario, controller, cameras and speed of each moving picture."""
PATHS = ("circle", "sinusoid", "spiral")
ARMS = {"lwr4plus": BLUE, "panda": VERMILLION}
_POINTS = 400


def scene_stamp(name: str, camera: str) -> str:
    """What a picture of a scene is made from: scene, start, camera and every asset but those of props."""
    each, starts = each_arm(load_experiment(name)), starts_of(name)
    scenes = [json.dumps(hashed(one.scene)) for one in each]  # a key that is added later changes nothing
    told = [*scenes, camera, *map(_rounded, starts)]
    return digest([*told, *(sha for folder, sha in assets() if folder[0] != "props")])


def starts_of(name: str) -> list[np.ndarray]:
    """Where each arm of a scenario starts (n,) [rad]."""
    return [beginning(one, ArmModel(one.scene))[0] for one in each_arm(load_experiment(name))]


def paths_stamp() -> str:
    """What the picture of the paths is made from."""
    return digest(_rounded(path_from_port(name)) for name in path_names())


def path_names() -> list[str]:
    """The scenarios whose paths are drawn."""
    return [f"{shape}_{arm}" for shape in PATHS for arm in ARMS]


def path_from_port(name: str) -> np.ndarray:
    """Commanded tip positions from the port on, at even times of the task (points, 3) [mm]."""
    setup: Setup = prepare(load_scenario(name))
    assert setup.scenario.trocar is not None
    times = np.linspace(0.0, setup.task.duration_s, _POINTS)
    points = np.array([setup.task.command(float(t)).p_WTd for t in times])
    return 1e3 * (points - np.array(setup.scenario.trocar.position_m))


def _rounded(values: np.ndarray) -> str:
    """Values as text, to a tenth of a micrometre or microradian of their unit, without minus zero."""
    return json.dumps((np.round(values, 4) + 0.0).tolist())


def moving_stamp(file: str) -> str:
    """What a moving picture is made from: the scene, the controller's name, the cameras, the speed."""
    name, *others = MOVING[file]
    return digest([*others, scene_stamp(name, "overview")])


def errors_stamp() -> str:
    """What the picture of the theatre's errors is made from."""
    return digest(json.dumps(row) for row in tables.theatre_errors())


def draw_scene(file: str) -> None:
    """Draw a picture of a scene.

    Raises:
        SurgsimError: If this machine cannot draw.
    """
    name, camera = SCENES[file]
    pixels = render(drawn_scenes(load_experiment(name)), starts_of(name), camera)
    save(Image.fromarray(pixels), HERE / file, scene_stamp(name, camera))


def draw_moving(file: str) -> None:
    """Draw a moving picture.

    Raises:
        subprocess.CalledProcessError: If the run fails, or this machine cannot draw.
    """
    name, controller, cameras, speed = MOVING[file]
    path = HERE / file
    with tempfile.TemporaryDirectory() as folder:
        _surgsim("run", name, "--controller", controller, "--out", f"{folder}/run")
        options = ("--camera", cameras, "--speed", speed, "--fps", "8", "--size", "480x480")
        _surgsim("export", f"{folder}/run", "--video", str(path), "--force", *options)
    mark(path, moving_stamp(file))


def _surgsim(*words: str) -> None:
    subprocess.run([sys.executable, "-m", "surgsim", *words], cwd=tables.ROOT, check=True)


def draw_scenes() -> None:
    """Draw all pictures of scenes.

    Raises:
        SurgsimError: If this machine cannot draw.
        subprocess.CalledProcessError: If a run fails.
    """
    for file in SCENES:
        draw_scene(file)
    for file in MOVING:
        draw_moving(file)


def draw_errors() -> None:
    """Draw the RCM error of every run of the theatre: what real drives leave of the controllers."""
    path = HERE / "theatre_errors.png"
    rows = tables.theatre_errors()
    colors = (BLUE, GREEN, PURPLE, ORANGE)
    with figure(
        path, "RCM error in the operating theatre, 20 seeds on each of four arms", size=(9.0, 3.6)
    ) as axes:
        ax = axes[0, 0]
        for place, (_, ended, errors) in enumerate(reversed(rows)):
            for part, (arm, values) in enumerate(errors.items()):
                height = place + 0.24 - 0.16 * part
                label = arm if place == len(rows) - 1 else None
                ax.plot(values, [height] * len(values), "o", color=colors[part], ms=4, alpha=0.6, label=label)
            at = {"transform": ax.get_yaxis_transform(), "va": "center", "fontsize": 10}
            ax.text(1.02, place, ended, **at)
            if not any(errors.values()):
                ax.text(0.02, place, "no run completed: it takes the gears for rigid", **at)
        ax.set_yticks(range(len(rows)), [row[0] for row in reversed(rows)])
        ax.set(xscale="log", xlabel="RMS over the run [mm]", ylim=(-0.5, len(rows) - 0.5))
        legend_below(axes, len(colors))
    save_again(path, errors_stamp())


def draw_peg_and_ring() -> None:
    """Draw success, rings and missed grasps of the suite `peg_and_ring` over the delay."""
    path, rows = HERE / "peg_and_ring.png", tables.peg_and_ring()
    delays = [level for level, _ in rows]
    success = [share([row["transfer_success"] == 1.0 for row in of]) for _, of in rows]
    each = (
        ("rings on their pegs", "rings_transferred", BLUE),
        ("grasps missed", "grasps_missed", ORANGE),
    )
    title = "Three rings within 300 s, 20 seeds at each delay; lines are means"
    with figure(path, title, 1, 3, size=(10.5, 3.4)) as axes:
        shares = np.array([[one.value, one.low, one.high] for one in success], dtype=float)
        bars = np.abs(shares[:, 1:] - shares[:, :1]).T
        axes[0, 0].errorbar(delays, shares[:, 0], yerr=bars, fmt="o-", color=GREEN, capsize=4)
        axes[0, 0].set(ylim=(-0.05, 1.05), ylabel="success (Wilson interval)")
        for ax, (label, metric, color) in zip(axes[0, 1:], each, strict=True):
            for level, of in rows:
                values = [row[metric] for row in of]
                spread = level + np.linspace(-25.0, 25.0, len(values))
                ax.plot(spread, values, "o", color=color, ms=4, alpha=0.5)
            ax.plot(delays, [np.mean([row[metric] for row in of]) for _, of in rows], "-", color=color)
            ax.set(ylabel=label)
        for ax in axes.flat:
            ax.set(xlabel="delay, one way [ms]", xticks=delays)
    save_again(path, peg_and_ring_stamp())


def peg_and_ring_stamp() -> str:
    """What that picture is made from: the rows."""
    return digest([(tables.RESULTS / "peg_and_ring" / "runs.csv.sha256").read_text(encoding="utf-8")])


def draw_paths() -> None:
    """Draw the paths of the shipped scenarios: circle and sinusoid from above, the spiral from the side."""
    path = HERE / "paths.png"
    with figure(path, "Paths of the tip, from the port", 1, len(PATHS), (10.5, 3.9)) as axes:
        for ax, shape in zip(axes.flat, PATHS, strict=True):
            for arm, color in ARMS.items():
                x, y, z = path_from_port(f"{shape}_{arm}").T
                across = z if np.ptp(z) > 1.0 else y
                style = "-" if arm == "lwr4plus" else "--"
                ax.plot(x, across, style, color=color, linewidth=2.0, label=arm)
            deep = f"{-z.max():.0f} to {-z.min():.0f}" if np.ptp(z) > 1.0 else f"{-z.mean():.0f}"
            ax.set(title=f"{shape}, {deep} mm deep", xlabel="x [mm]")
            ax.set(ylabel="z [mm], from the side" if np.ptp(z) > 1.0 else "y [mm], from above")
        axes[0, 0].set(aspect="equal")
        legend_below(axes, len(ARMS))
    save_again(path, paths_stamp())


def main() -> int:
    """Make everything; 1 if the scenes could not be drawn."""
    tables.main()
    draw_paths()
    draw_errors()
    draw_peg_and_ring()
    concepts.main()
    for folder in sorted(path.parent for path in tables.RESULTS.glob("*/runs.csv")):
        print(write_report(folder))
    failed = 0
    for part in (draw_scenes, gallery.main):
        try:
            part()
        except (SurgsimError, subprocess.CalledProcessError) as error:
            print(error, file=sys.stderr)
            failed = 1
    return failed


if __name__ == "__main__":
    sys.exit(main())
