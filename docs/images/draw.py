"""Draws `theatre.png`, `port_closeup.png` and `panda.png`: starts of the circle scenarios. Needs OpenGL."""

import sys
from pathlib import Path

from PIL import Image

from surgsim.errors import SurgsimError
from surgsim.models.build import build
from surgsim.models.picture import render
from surgsim.scenario.load import load_scenario
from surgsim.simulate.setup import prepare

PICTURES = {
    "theatre.png": ("circle_lwr4plus", "overview"),
    "port_closeup.png": ("circle_lwr4plus", "port_closeup"),
    "panda.png": ("circle_panda", "overview"),
}


def main() -> int:
    """Write the pictures beside this file."""
    for name, (scenario_name, camera) in PICTURES.items():
        scenario = load_scenario(scenario_name)
        q = prepare(scenario).q_start
        path = Path(__file__).with_name(name)
        try:
            pixels = render(build(scenario.scene), q, camera)
        except SurgsimError as error:
            print(error, file=sys.stderr)
            return 1
        Image.fromarray(pixels).save(path, optimize=True)
        print(path)
    return 0


if __name__ == "__main__":
    sys.exit(main())
