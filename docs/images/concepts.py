"""Draws the diagrams of the concepts: remote centre of motion, tick of control, drive, energy tank."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image
from stamps import digest, save

from surgsim.studies.figure import BLACK, BLUE, GREEN, ORANGE, VERMILLION

HERE = Path(__file__).parent / "concepts"
Point = tuple[float, float]
_TEXT: dict[str, Any] = {"fontsize": 12, "ha": "center", "va": "center"}


def stamp() -> str:
    """What the diagrams are made from: this script."""
    return digest([Path(__file__).read_text(encoding="utf-8")])


def _canvas(size: tuple[float, float], x: tuple[float, float], y: tuple[float, float]) -> tuple[Figure, Any]:
    drawing = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(drawing)
    ax = drawing.subplots()
    ax.set(xlim=x, ylim=y, aspect="equal")
    ax.axis("off")
    return drawing, ax


def _arrow(ax: Any, start: Point, end: Point, color: str = BLACK) -> None:
    style = {"arrowstyle": "-|>", "color": color, "lw": 1.6, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", end, start, arrowprops=style)


def _box(ax: Any, at: tuple[float, float], text: str, color: str) -> None:
    ax.text(*at, text, bbox={"boxstyle": "round,pad=0.5", "fc": "white", "ec": color, "lw": 2}, **_TEXT)


def rcm() -> Figure:
    """Side view: skin, trocar, shaft and both errors."""
    drawing, ax = _canvas((6.2, 4.5), (-6.2, 7.6), (-6.2, 4.2))
    x = np.linspace(-6, 6, 100)
    skin = -0.012 * x**2
    ax.fill_between(x, skin, -6.2, color=ORANGE, alpha=0.15, lw=0)
    ax.plot(x, skin, color=ORANGE, lw=3)
    ax.text(-5.9, -1.3, "abdominal wall", fontsize=12, color=BLACK)
    trocar, top, tip = np.array([0.0, 0.0]), np.array([-1.2, 4.0]), np.array([2.6, -4.6])
    ax.plot(*np.transpose([top, tip]), color=BLACK, lw=5, solid_capstyle="round")
    axis = (tip - top) / np.linalg.norm(tip - top)
    foot = top + axis * (axis @ (trocar - top))
    ax.plot(*np.transpose([trocar, foot]), color=VERMILLION, lw=3)
    ax.plot(*trocar, "o", color=BLUE, ms=11, zorder=5)
    ax.text(-0.25, -0.55, "trocar", fontsize=12, color=BLUE, ha="right", va="top")
    ax.annotate(
        "RCM error: distance of the\ntrocar from the shaft's axis",
        (trocar + foot) / 2,
        (1.6, 2.2),
        fontsize=12,
        color=VERMILLION,
        arrowprops={"arrowstyle": "-", "color": VERMILLION},
    )
    wanted = tip + np.array([1.3, 0.35])
    angle = np.linspace(0, 2 * np.pi, 100)
    ax.plot(wanted[0] - 2.0 + 2.0 * np.cos(angle), wanted[1] + 0.6 * np.sin(angle), "--", color=BLUE, lw=1.6)
    ax.plot(*wanted, "o", color=BLUE, ms=8)
    ax.plot(*np.transpose([tip, wanted]), color=GREEN, lw=3)
    ax.text(4.3, -4.3, "where the tip\nshould be now", fontsize=12, color=BLUE, va="center")
    ax.text(2.7, -5.7, "tip error", fontsize=12, color=GREEN)
    ax.text(-1.5, 3.9, "shaft, held by the arm", fontsize=12, ha="right", va="top")
    return drawing


def tick() -> Figure:
    """One tick of control: who gives what to whom."""
    drawing, ax = _canvas((6.6, 2.4), (-0.6, 14.6), (-3.1, 2.2))
    boxes = {
        0.6: ("task", BLUE),
        4.0: ("resolver", GREEN),
        7.6: ("torque\nlaw", GREEN),
        10.7: ("drives", ORANGE),
    }
    for place, (text, color) in {**boxes, 13.4: ("arm and\npatient", BLACK)}.items():
        _box(ax, (place, 0), text, color)
    words = {
        (1.3, 2.9): "tip\ncommand",
        (5.0, 6.7): "joint\nvelocities",
        (8.5, 9.8): "torques",
        (11.5, 12.3): "",
    }
    for (start, end), text in words.items():
        _arrow(ax, (start, 0), (end, 0))
        ax.text((start + end) / 2, 0.75, text, **{**_TEXT, "fontsize": 10.5})
    ax.plot([13.4, 13.4, 4.0], [-0.85, -2.2, -2.2], color=BLACK, lw=1.6)
    for place in (4.0, 7.6):
        _arrow(ax, (place, -2.2), (place, -0.6 if place == 4.0 else -0.85))
    ax.text(10.5, -2.55, "measured joints, and the port as it is known", **{**_TEXT, "fontsize": 10.5})
    ax.text(5.8, 1.7, "controller", **{**_TEXT, "color": GREEN})
    return drawing


def drive() -> Figure:
    """A drive: torque loop, motor, gear as a spring, link."""
    drawing, ax = _canvas((6.6, 2.1), (-1.2, 12.8), (-1.9, 2.1))
    for place, text, color in ((0.8, "torque\nloop", GREEN), (4.0, "motor", ORANGE), (10.6, "link", BLUE)):
        _box(ax, (place, 0), text, color)
    _arrow(ax, (1.9, 0), (3.0, 0))
    x = np.linspace(5.1, 9.7, 300)
    ax.plot(x, 0.35 * np.sin((x - 5.1) / 4.6 * 12 * np.pi), color=BLACK, lw=1.8)
    ax.text(7.4, 0.85, "gear: a spring, with the torque sensor", **{**_TEXT, "fontsize": 10.5})
    ax.text(4.0, -1.1, "rotor's inertia,\nfriction", **{**_TEXT, "fontsize": 10.5})
    ax.text(10.6, -1.0, "what the tip hangs on", **{**_TEXT, "fontsize": 10.5})
    ax.text(0.8, 1.25, "torque asked for", **{**_TEXT, "fontsize": 10.5})
    ax.plot([7.4, 7.4, 0.8], [-0.45, -1.55, -1.55], color=BLACK, lw=1.4)
    _arrow(ax, (0.8, -1.55), (0.8, -0.85))
    return drawing


def tank() -> Figure:
    """An energy tank: what flows in, what may flow out."""
    drawing, ax = _canvas((6.6, 2.9), (-6.9, 7.2), (-2.4, 3.2))
    ax.fill_between([-1.5, 1.5], -1.8, 0.4, color=BLUE, alpha=0.3, lw=0)
    ax.plot([-1.5, -1.5, 1.5, 1.5], [2.0, -1.8, -1.8, 2.0], color=BLACK, lw=2.5)
    ax.plot([-1.5, 1.5], [-1.2, -1.2], "--", color=VERMILLION, lw=1.8)
    ax.text(0, -0.4, "energy that\nmay be spent", **{**_TEXT, "fontsize": 10.5})
    ax.text(1.7, -1.25, "floor: below it nothing is given", fontsize=10.5, color=VERMILLION, va="center")
    _arrow(ax, (-2.9, 2.4), (-0.8, 1.2), GREEN)
    source = "energy that came in:\nfrom the other side,\nfrom damping"
    ax.text(-3.0, 2.4, source, fontsize=10.5, color=GREEN, ha="right", va="center")
    _arrow(ax, (0.8, 0.6), (2.9, 2.2), ORANGE)
    use = "energy given away:\nto hand or tissue"
    ax.text(3.0, 2.4, use, fontsize=10.5, color=ORANGE, va="center")
    return drawing


DIAGRAMS = {"rcm.png": rcm, "tick.png": tick, "drive.png": drive, "tank.png": tank}


def main() -> None:
    """Draw all."""
    HERE.mkdir(exist_ok=True)
    for file, diagram in DIAGRAMS.items():
        path = HERE / file
        diagram().savefig(path, dpi=150, metadata={"Software": None})
        with Image.open(path) as image:
            image.load()
            save(image, path, stamp())


if __name__ == "__main__":
    sys.exit(main())
