"""Figures that the paper does not have: the ladder of disturbances, and what the gains change."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from surgsim.studies.figure import BLUE, PURPLE, VERMILLION, Axes, figure
from surgsim.studies.study import Row
from surgsim.studies.vprnn.cases import METHODS, RCM_BOUND_MM, TIP_BOUND_MM
from surgsim.studies.vprnn.cells import number, pick
from surgsim.studies.vprnn.disturbances import FRICTIONS_NM, PAYLOADS_KG

Array = NDArray[np.float64]
_PAYLOAD, _FRICTION = "payload at the adapter (kg)", "Coulomb friction of each joint (N m)"
_ERRORS = (
    ("tip_max_mm", TIP_BOUND_MM, "largest tip error (mm)"),
    ("rcm_max_mm", RCM_BOUND_MM, "largest RCM error (mm)"),
)


def draw_ladder(rows: Sequence[Row], out: Path) -> None:
    """Largest errors of VPRNN over payload and friction, and ours beside them for each alone."""
    title = "Not in the paper: errors that payload and friction make"
    with figure(out, title, 2, 2, size=(11.5, 8.4)) as axes:
        for ax, (column, bound, words) in zip(axes[0], _ERRORS, strict=True):
            _heat_map(ax, rows, column, bound)
            ax.set(title=f"VPRNN, {words}; boxed: within {bound:g} mm", xlabel=_FRICTION)
        axes[0, 0].set_ylabel(_PAYLOAD)
        _alone(axes[1, 0], pick(rows, friction_nm=0.0), "payload_kg")
        axes[1, 0].set(xlabel=_PAYLOAD, title="payload alone", ylabel="largest error (mm)")
        _alone(axes[1, 1], pick(rows, payload_kg=0.0), "friction_nm")
        axes[1, 1].set(xlabel=_FRICTION, title="friction alone")
        axes[1, 0].legend(frameon=False, fontsize=10, loc="upper left", ncols=2)


def _heat_map(ax: Axes, rows: Sequence[Row], column: str, bound: float) -> None:
    vprnn = pick(rows, controller=METHODS["vprnn"].label)
    found = {(row["payload_kg"], row["friction_nm"]): number(row, column) for row in vprnn}
    values = np.array([[found[m, f] for f in FRICTIONS_NM] for m in PAYLOADS_KG])
    ax.grid(visible=False)
    ax.imshow(np.log(values / bound), cmap="cividis", aspect="auto", origin="lower", vmin=-3.0, vmax=2.0)
    for (i, j), value in np.ndenumerate(values):
        text = f"{value:.1f}" if value < 20.0 else f"{value:.0f}"
        colour = "white" if value < bound else "black"
        box = {"fill": False, "edgecolor": "white", "linewidth": 1.2} if value <= bound else None
        ax.text(j, i, text, ha="center", va="center", fontsize=11, color=colour, bbox=box)
    ax.set_xticks(range(len(FRICTIONS_NM)), [f"{x:g}" for x in FRICTIONS_NM])
    ax.set_yticks(range(len(PAYLOADS_KG)), [f"{x:g}" for x in PAYLOADS_KG])


def _alone(ax: Axes, rows: Sequence[Row], axis: str) -> None:
    for name, short in (("vprnn", "VPRNN"), ("rcm_inverse_dynamics", "ours")):
        method = METHODS[name]
        mine = pick(rows, controller=method.label)
        for (column, _, _), style, what in zip(_ERRORS, ("o-", "s--"), ("tip", "RCM"), strict=True):
            points = np.array([(number(row, axis), number(row, column)) for row in mine]).T
            ax.semilogy(*points, style, color=method.colour, label=f"{short}, {what}")
    ax.set_ylim(1e-5, 3e3)


def draw_gains(rows: Sequence[Row], out: Path) -> None:
    """Mean manipulability over the climbing rate, under torques and with perfect velocity tracking."""
    title = "Not in the paper: mean µ over the climbing rate k of q' = pinv(J) v + k N grad(ln µ)"
    shapes = {"Nullspace": ("o", VERMILLION, 12), "RNN": ("s", BLUE, 8), "VPRNN": ("^", PURPLE, 8)}
    with figure(out, title, 1, 2, size=(11.0, 4.6), sharey=True) as axes:
        for name, (marker, colour, size) in shapes.items():
            style = {"color": colour, "markersize": size, "fillstyle": "none", "markeredgewidth": 2.0}
            for ax, column in zip(axes.flat, ("mu_mean", "mu_mean_kinematic"), strict=True):
                ax.plot(*_points(rows, name, column), marker, label=name, linestyle="none", **style)
        for ax, words in zip(axes.flat, ("under torques", "perfect velocity tracking"), strict=True):
            ax.set_xscale("symlog", linthresh=0.01)
            ax.set(title=words, xlabel="k (rad²/s); Table I: VPRNN 0.01, RNN 1", xlim=(-0.002, 20.0))
        axes[0, 0].set_ylabel("mean manipulability µ (m³)")
        axes[0, 0].legend(frameon=False, fontsize=10, loc="upper left")


def _points(rows: Sequence[Row], name: str, column: str) -> Array:
    """Climbing rate and mean µ (2, n) of a controller's variants with RCM rows."""
    mine = [row for row in rows if str(row["variant"]).split(",")[0] == name]
    mine = [
        row for row in mine if row["climbing_rate"] is not None and "without RCM" not in str(row["variant"])
    ]
    return np.array([(number(row, "climbing_rate"), number(row, column)) for row in mine]).T
