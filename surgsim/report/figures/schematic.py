"""A schematic of a scene, where no picture can be drawn: arm, shaft, port and path, seen from the side."""

from collections.abc import Callable, Sequence

from surgsim.report.figures.svg import WIDTH, Drawing, fmt, polyline
from surgsim.report.scenes import Point, SceneView

_RIGHT = (0.9277, -0.3732, 0.0)
_UP = (0.148, 0.3678, 0.918)
"""Axes of the picture in the world frame: those of the scene's camera `overview`."""
_HEIGHT, _EDGE = 230.0, 26.0
_Place = tuple[float, float]


def schematic(view: SceneView) -> str:
    """The scene as lines: the arm thick, the shaft thin, the port a circle, the path as it is asked for."""
    points = [view.base, *view.joints, view.tip, *view.path]
    points += [view.trocar] if view.trocar is not None else []
    place = _fitting([_flat(point) for point in points])
    drawing = Drawing(_HEIGHT)
    base, tip = place(_flat(view.base)), place(_flat(view.tip))
    arm = [base, *(place(_flat(point)) for point in view.joints)]
    drawing.path(f"M{fmt(base[0] - 30)} {fmt(base[1])}h60", "axis")
    drawing.path(polyline(arm), "limb")
    drawing.path(polyline([arm[-1], tip]), "shaft")
    drawing.path(_dots(arm[1:], 3.0), "joint")
    if view.path:
        drawing.path(polyline([place(_flat(point)) for point in view.path]), "line c1")
    if view.trocar is not None:
        x, y = place(_flat(view.trocar))
        drawing.path(f"M{fmt(x - 7)} {fmt(y)}a7 4 0 1 0 14 0a7 4 0 1 0 -14 0", "line c2")
        drawing.text(x + 12, y + 4, "port")
    drawing.text(tip[0] + 8, tip[1] + 12, "tip")
    drawing.text(base[0] + 8, base[1] - 8, view.robot)
    return drawing.render(f"Schematic of {view.scenario}: the arm {view.robot}, its shaft, port and path.")


def _flat(point: Point) -> _Place:
    """Place on the picture plane [m], to the right and up."""
    return (
        sum(a * b for a, b in zip(point, _RIGHT, strict=True)),
        sum(a * b for a, b in zip(point, _UP, strict=True)),
    )


def _fitting(places: Sequence[_Place]) -> Callable[[_Place], _Place]:
    """From metres to the drawing, such that all `places` are inside."""
    left, right = min(x for x, _ in places), max(x for x, _ in places)
    low, high = min(y for _, y in places), max(y for _, y in places)
    scale = min((WIDTH - 2 * _EDGE) / max(right - left, 0.1), (_HEIGHT - 2 * _EDGE) / max(high - low, 0.1))
    centre = (WIDTH - scale * (left + right)) / 2

    def place(at: _Place) -> _Place:
        return centre + scale * at[0], _HEIGHT - _EDGE - scale * (at[1] - low)

    return place


def _dots(places: Sequence[_Place], radius: float) -> str:
    r, d = fmt(radius), fmt(2 * radius)
    return "".join(f"M{fmt(x)} {fmt(y)}m-{r} 0a{r} {r} 0 1 0 {d} 0a{r} {r} 0 1 0 -{d} 0z" for x, y in places)
