"""Surfaces that MJCF has no shape for: the drape over the patient, and the inside of the abdomen.

The drape is a grid over the table, laid on a few ellipsoids that stand for the body and then pulled taut.
Grid lines run along the edges of its window, so that the rim is straight. Visual only.
"""

import numpy as np
from numpy.typing import NDArray

from surgsim.array import Array

TABLE_M = -0.165  # height of the table's pads
EDGE_M = 0.285  # half width at which the sheet bends down
FEET_M, NECK_M = -1.20, 0.56  # ends of the sheet
HEM_M = (-0.22, -0.30, -0.40)  # heights of the rows of the hanging sides
SLACK_M = 0.006  # keeps the skin from showing between grid points on steep sides
WINDOW_M = (0.150, 0.190)  # half sizes of the window
# Centre and semi-axes [m] of what lies under the sheet besides the abdomen: chest, hips, thighs, shins, feet.
BODY_M = (
    (0.0, 0.40, -0.075, 0.21, 0.215, 0.135),
    (0.0, -0.37, -0.08, 0.20, 0.21, 0.130),
    (0.09, -0.58, -0.12, 0.085, 0.26, 0.105),
    (-0.09, -0.58, -0.12, 0.085, 0.26, 0.105),
    (0.09, -0.88, -0.13, 0.06, 0.26, 0.085),
    (-0.09, -0.88, -0.13, 0.06, 0.26, 0.085),
    (0.10, -1.10, -0.12, 0.05, 0.06, 0.14),
    (-0.10, -1.10, -0.12, 0.05, 0.06, 0.14),
)


def drape_mesh(abdomen_semi_axes: Array) -> tuple[Array, NDArray[np.int32]]:
    """Vertices (n, 3) [m] and triangles (m, 3) of the sheet, in the frame of the abdomen's ellipsoid.

    Args:
        abdomen_semi_axes: Semi-axes (3,) [m] of the ellipsoid at the origin.
    """
    wide, long = WINDOW_M
    x = _grid_line((-EDGE_M, -wide, wide, EDGE_M), (10, 16, 10))
    y = _grid_line((FEET_M, -long, long, NECK_M), (49, 19, 18))
    height = _taut(_body_height(x, y, abdomen_semi_axes))
    points = np.stack([*np.meshgrid(x, y, indexing="ij"), height], axis=-1)
    points = np.concatenate([_side(points[0], -1.0)[::-1], points, _side(points[-1], 1.0)])
    return points.reshape(-1, 3), _triangles(points, WINDOW_M)


def inward_ellipsoid(semi_axes: Array, count: int = 30) -> tuple[Array, NDArray[np.int32]]:
    """Vertices (n, 3) and triangles (m, 3) of an ellipsoid that is seen from inside only."""
    polar, around = np.meshgrid(
        np.linspace(1e-3, np.pi - 1e-3, count), np.linspace(0.0, 2 * np.pi, 2 * count), indexing="ij"
    )
    sphere = [np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)]
    points = np.stack(sphere, axis=-1) * semi_axes
    return points.reshape(-1, 3), _triangles(points, hole=(0.0, 0.0))[:, ::-1]


def _grid_line(knots: tuple[float, ...], cells: tuple[int, ...]) -> Array:
    """Coordinates with `cells[i]` equal steps between `knots[i]` and `knots[i + 1]`."""
    pieces = zip(knots[:-1], knots[1:], cells, strict=True)
    parts = [np.linspace(a, b, n, endpoint=False) for a, b, n in pieces]
    return np.concatenate([*parts, knots[-1:]])


def _body_height(x: Array, y: Array, abdomen: Array) -> Array:
    """Height of whatever is highest under each grid point (len(x), len(y)), with room for the cloth."""
    height = np.full((len(x), len(y)), TABLE_M)
    for *centre, a, b, c in ((0.0, 0.0, 0.0, *abdomen), *BODY_M):
        across = ((x[:, None] - centre[0]) / (a + SLACK_M)) ** 2
        inside = 1.0 - across - ((y[None, :] - centre[1]) / (b + SLACK_M)) ** 2
        top = centre[2] + (c + 0.004) * np.sqrt(np.maximum(inside, 0.0))
        height = np.where(inside > 0.0, np.maximum(height, top), height)
    return height


def _taut(height: Array, rounds: int = 25) -> Array:
    """Relax the sheet towards a stretched skin that stays on or above `height`; its rim stays."""
    sheet = height.copy()
    for _ in range(rounds):
        mean = (sheet[:-2, 1:-1] + sheet[2:, 1:-1] + sheet[1:-1, :-2] + sheet[1:-1, 2:]) / 4
        sheet[1:-1, 1:-1] = np.maximum(height[1:-1, 1:-1], mean)
        sheet[:, 0], sheet[:, -1] = sheet[:, 1], sheet[:, -2]
    return sheet


def _side(rim: Array, outwards: float) -> Array:
    """Rows of the side that hangs from `rim` (n, 3), with folds that deepen towards the hem."""
    rows = []
    for depth, z in enumerate(HEM_M, start=1):
        row = rim.copy()
        row[:, 0] += outwards * (0.012 + 0.006 * depth * np.sin(38.0 * rim[:, 1] + np.sin(9.0 * rim[:, 1])))
        row[:, 2] = z
        rows.append(row)
    return np.stack(rows)


def _triangles(points: Array, hole: tuple[float, float]) -> NDArray[np.int32]:
    """Two triangles for each cell of the grid (rows, columns, 3), none where |x|, |y| are within `hole`."""
    rows, columns = points.shape[:2]
    index = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    middle = (points[:-1, :-1] + points[1:, 1:]) / 2
    keep = np.any(np.abs(middle[..., :2]) > hole, axis=-1)
    cells = np.stack([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)], axis=2)
    return cells[keep].reshape(-1, 3)
