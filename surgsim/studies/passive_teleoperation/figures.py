"""Figures of the shipped scenarios: velocity, tanks, slack and constraints over time."""

from collections.abc import Sequence
from pathlib import Path

from surgsim.studies.figure import BLACK, BLUE, GREEN, ORANGE, PURPLE, VERMILLION, Axes, figure, legend_below
from surgsim.studies.passive_teleoperation.runs import Done
from surgsim.studies.passive_teleoperation.series import Series

FLOOR_J = 0.01
_BANDS = (
    ("planes", ORANGE, "a plane acts"),
    ("budget", VERMILLION, "the energy budget acts"),
    ("scaled", PURPLE, "the operator's tank limits the force"),
    ("speed", GREEN, "command above the speed limit"),
)


def _curves(done: Done) -> Series:
    assert done.curves is not None, "a shipped scenario keeps its curves"
    return done.curves


def draw_tracking(shipped: Sequence[Done], out: Path) -> None:
    """Velocity along x in free motion, and the RCM error of every scenario."""
    colours = (BLUE, GREEN, VERMILLION, PURPLE)
    with figure(out, "Velocity in free motion, and RCM error", 2, 1, size=(11.0, 7.0)) as axes:
        free = _curves(shipped[0])
        top, bottom = axes[:, 0]
        lines = (
            ("v_issued", ORANGE, 1.2, "master now"),
            ("v_command", BLACK, 3.0, "command that has arrived"),
            ("v_tip", BLUE, 1.2, "tip"),
        )
        for name, colour, width, label in lines:
            top.plot(free["t"], 1e3 * free[name], color=colour, linewidth=width, label=label)
        top.set(ylabel="velocity along x (mm/s)", xlabel="time (s)", title="free motion, 300 ms round trip")
        top.legend(frameon=False, fontsize=10, loc="upper right", ncols=3)
        for done, colour in zip(shipped, colours, strict=True):
            curves = _curves(done)
            bottom.semilogy(
                curves["t"], 1e3 * curves["rcm"], color=colour, label=done.case.label, linewidth=1.0
            )
        bottom.axhline(0.3, color=BLACK, linestyle="--", linewidth=1.0, label="the paper's RMSE")
        bottom.set(ylabel="RCM error (mm)", xlabel="time (s)")
        bottom.legend(frameon=False, fontsize=10, loc="upper right", ncols=3)
        bottom.set_ylim(1e-6, 100.0)


def draw_tanks(shipped: Sequence[Done], out: Path) -> None:
    """Both tanks over time, one panel for each scenario."""
    with figure(out, "Energy tanks over time", 2, 2, size=(11.0, 7.0), sharey=True) as axes:
        for ax, done in zip(axes.flat, shipped, strict=True):
            curves = _curves(done)
            ax.plot(curves["t"], curves["tank_operator"], color=BLUE, label="operator's tank")
            ax.plot(curves["t"], curves["tank_remote"], color=VERMILLION, label="remote tank", linestyle="--")
            ax.axhline(FLOOR_J, color=BLACK, linewidth=1.0, linestyle=":", label="floor")
            ax.set(title=done.case.label, xlabel="time (s)")
        for ax in axes[:, 0]:
            ax.set_ylabel("energy (J)")
        axes[0, 0].set_ylim(0.0, None)
        legend_below(axes, 3)


def draw_constraints(shipped: Sequence[Done], out: Path) -> None:
    """Slack over time, with bands while a constraint acts."""
    with figure(out, "Slack and active constraints over time", 2, 2, size=(11.0, 7.5), sharey=True) as axes:
        for ax, done in zip(axes.flat, shipped, strict=True):
            curves = _curves(done)
            ax.semilogy(curves["t"], 1e3 * curves["slack"] + 1e-6, color=BLUE, label="slack", linewidth=1.2)
            for i, (name, colour, label) in enumerate(_BANDS):
                _band(ax, curves, name, colour, label, i)
            ax.set(title=done.case.label, xlabel="time (s)", ylim=(1e-5, 3e4))
            ax.set_yticks([1e-5, 1e-3, 1e-1, 1e1])
        for ax in axes[:, 0]:
            ax.set_ylabel("slack of the tip's velocity (mm/s)")
        legend_below(axes, 3)


def _band(ax: Axes, curves: Series, name: str, colour: str, label: str, row: int) -> None:
    """A bar above the curve wherever a flag is set."""
    low = 0.95 - 0.06 * row
    ax.fill_between(
        curves["t"],
        low,
        low + 0.05,
        where=curves[name] > 0.0,
        color=colour,
        linewidth=0.8,
        transform=ax.get_xaxis_transform(),
        label=label,
    )
