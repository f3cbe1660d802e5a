"""Makes the pictures, tables and pages of the documents again: what `make pictures` does.

The pictures of the scenes need OpenGL; a machine without it makes the rest and says so. Each picture carries
a stamp of what it was made from, and `tests/test_made.py` compares that with what is there now.
"""

import hashlib
import json
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import tables
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from surgsim.errors import SurgsimError
from surgsim.models.build import build
from surgsim.models.picture import render
from surgsim.report.write import write_report
from surgsim.scenario.load import load_scenario
from surgsim.simulate.setup import Setup, prepare
from surgsim.studies.figure import BLUE, VERMILLION, figure, legend_below

HERE = Path(__file__).parent
SCENES = {
    "theatre.png": ("circle_lwr4plus", "overview"),
    "port_closeup.png": ("circle_lwr4plus", "port_closeup"),
    "panda.png": ("circle_panda", "overview"),
    "fr3.png": ("circle_fr3", "overview"),
    "iiwa14.png": ("circle_iiwa14", "overview"),
}
PATHS = ("circle", "sinusoid", "spiral")
ARMS = {"lwr4plus": BLUE, "panda": VERMILLION}
STAMP = "surgsim"
_POINTS = 400


def scene_stamp(name: str, camera: str) -> str:
    """What a picture of a scene is made from: scene, start, camera and every asset."""
    setup = prepare(load_scenario(name))
    told = [setup.scenario.scene.model_dump_json(), camera, _rounded(setup.q_start)]
    assets = sorted(path for path in (tables.ROOT / "assets").rglob("*") if path.is_file())
    return _digest([*told, *(hashlib.sha256(path.read_bytes()).hexdigest() for path in assets)])


def paths_stamp() -> str:
    """What the picture of the paths is made from."""
    return _digest(_rounded(path_from_port(name)) for name in path_names())


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


def _digest(parts: Iterable[str]) -> str:
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def stamped(path: Path) -> str:
    """The stamp that a picture carries; empty without one."""
    with Image.open(path) as image:
        return str(image.info.get(STAMP, ""))


def _save(image: Image.Image, path: Path, stamp: str) -> None:
    about = PngInfo()
    about.add_text(STAMP, stamp)
    image.save(path, optimize=True, pnginfo=about)
    print(path)


def draw_scene(file: str) -> None:
    """Draw a picture of a scene.

    Raises:
        SurgsimError: If this machine cannot draw.
    """
    name, camera = SCENES[file]
    setup = prepare(load_scenario(name))
    pixels = render(build(setup.scenario.scene), setup.q_start, camera)
    _save(Image.fromarray(pixels), HERE / file, scene_stamp(name, camera))


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
    with Image.open(path) as image:
        image.load()
        _save(image, path, paths_stamp())


def main() -> int:
    """Make everything; 1 if the scenes could not be drawn."""
    tables.main()
    draw_paths()
    for folder in sorted(path.parent for path in tables.RESULTS.glob("*/runs.parquet")):
        print(write_report(folder))
    try:
        for file in SCENES:
            draw_scene(file)
    except SurgsimError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
