"""Draws `theatre.png` and `port_closeup.png`: the start of the circle scenario. Needs OpenGL."""

import sys
from pathlib import Path

from PIL import Image

from surgsim.errors import SurgsimError
from surgsim.models.build import build
from surgsim.models.picture import render
from surgsim.scenario.load import load_scenario
from surgsim.simulate.setup import prepare

PICTURES = {"theatre.png": "overview", "port_closeup.png": "port_closeup"}


def main() -> int:
    """Write the pictures beside this file."""
    scenario = load_scenario("circle_lwr4plus")
    q = prepare(scenario).q_start
    scene = build(scenario.scene)
    for name, camera in PICTURES.items():
        path = Path(__file__).with_name(name)
        try:
            pixels = render(scene, q, camera)
        except SurgsimError as error:
            print(error, file=sys.stderr)
            return 1
        Image.fromarray(pixels).save(path, optimize=True)
        print(path)
    return 0


if __name__ == "__main__":
    sys.exit(main())
