"""A drawing in SVG. Colours are classes, which the page's style gives for light, dark and print."""

import html
from collections.abc import Iterable

from surgsim.report.figures.scale import Scale

WIDTH = 360.0
CHARACTER = 6.4
"""Width of a character of a tick."""
_MARKS = (
    "m-{r} 0a{r} {r} 0 1 0 {d} 0a{r} {r} 0 1 0 -{d} 0z",  # circle
    "m-{r} -{r}h{d}v{d}h-{d}z",  # square
    "m0 -{r}l{r} {d}h-{d}z",  # triangle
    "m0 -{d}l{r} {d}l-{r} {d}l-{r} -{d}z",  # diamond
    "m-{r} -{r}h{d}l-{r} {d}z",  # triangle, upside down
    "m-{h} -{r}h{r}v{h}h{h}v{r}h-{h}v{h}h-{r}v-{h}h-{h}v-{r}h{h}z",  # plus
)
_DASHES = ("", "6 3", "2 2", "8 3 2 3", "1 3", "10 4")


def fmt(value: float) -> str:
    """A coordinate, to a tenth of a pixel."""
    return f"{value:.1f}".removesuffix(".0")


def margin(scale: Scale, least: float = 46.0) -> float:
    """Room that the labels of a vertical axis take on its left."""
    return max(least, 10.0 + CHARACTER * max((len(text) for _, text in scale.labels()), default=0))


def shortened(name: str, most: int = 30) -> str:
    """`name`, with an ellipsis where it is longer than there is room for."""
    return name if len(name) <= most else name[: most - 1] + "…"


def colour(index: int) -> str:
    """Class of the `index`-th controller's colour."""
    return f"c{index % 8}"


def dash(index: int) -> str:
    """Attribute that dashes the `index`-th controller's line, so that colour alone does not tell it apart."""
    pattern = _DASHES[index % len(_DASHES)]
    return f' stroke-dasharray="{pattern}"' if pattern else ""


def mark(index: int, x: float, y: float, size: float = 4.0) -> str:
    """Path of the `index`-th controller's marker."""
    shape = _MARKS[index % len(_MARKS)]
    sizes = {"r": fmt(size), "d": fmt(2 * size), "h": fmt(size / 2)}
    return f"M{fmt(x)} {fmt(y)}{shape.format(**sizes)}"


def cross(x: float, y: float, size: float = 4.0) -> str:
    """Path of a cross: a failure."""
    s, d = fmt(size), fmt(2 * size)
    return f"M{fmt(x)} {fmt(y)}m-{s} -{s}l{d} {d}m0 -{d}l-{d} {d}"


def polyline(points: Iterable[tuple[float, float]]) -> str:
    """Path through `points`."""
    return "M" + "L".join(f"{fmt(x)} {fmt(y)}" for x, y in points)


class Drawing:
    """Shapes, in the order in which they are painted."""

    def __init__(self, height: float, width: float = WIDTH) -> None:
        self.width, self.height = width, height
        self._parts: list[str] = []

    def path(self, d: str, classes: str, attributes: str = "") -> None:
        """Add a path."""
        self._parts.append(f'<path class="{classes}" d="{d}"{attributes}/>')

    def text(self, x: float, y: float, text: str, classes: str = "", anchor: str = "start") -> None:
        """Add a line of text."""
        place = f'x="{fmt(x)}" y="{fmt(y)}" text-anchor="{anchor}"'
        self._parts.append(f'<text class="{classes}" {place}>{html.escape(text)}</text>')

    def x_axis(self, scale: Scale, top: float, bottom: float, label: str = "") -> None:
        """Add grid lines, ticks and the label of a horizontal axis at `bottom`."""
        for x, text in scale.labels():
            self.path(f"M{fmt(x)} {fmt(top)}V{fmt(bottom)}", "grid")
            half = 0.5 * CHARACTER * len(text)  # kept inside the drawing
            self.text(min(max(x, half), self.width - half), bottom + 14, text, "tick", "middle")
        self.path(f"M{fmt(scale.start)} {fmt(bottom)}H{fmt(scale.end)}", "axis")
        self.text((scale.start + scale.end) / 2, bottom + 30, label, "label", "middle")

    def y_axis(self, scale: Scale, left: float, right: float, label: str = "") -> None:
        """Add grid lines, ticks and the label (above) of a vertical axis at `left`."""
        for y, text in scale.labels():
            self.path(f"M{fmt(left)} {fmt(y)}H{fmt(right)}", "grid")
            self.text(left - 5, y + 4, text, "tick", "end")
        self.path(f"M{fmt(left)} {fmt(scale.start)}V{fmt(scale.end)}", "axis")
        self.text(2, 12, label, "label")

    def render(self, description: str) -> str:
        """The drawing as an element; `description` is what a screen reader says."""
        box = f'viewBox="0 0 {fmt(self.width)} {fmt(self.height)}"'
        said = html.escape(description)
        return f'<svg {box} role="img" aria-label="{said}">{"".join(self._parts)}</svg>'
