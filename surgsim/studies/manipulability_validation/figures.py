"""Figures 5 to 10 of the paper, and one of what self-motion could have reached."""

from pathlib import Path

import numpy as np

from surgsim.studies.figure import BLACK, BLUE, GREEN, VERMILLION, Axes, figure
from surgsim.studies.manipulability_validation import paper
from surgsim.studies.manipulability_validation.runs import lagged_errors, matched_errors
from surgsim.studies.manipulability_validation.setup import STEPS
from surgsim.studies.manipulability_validation.tables import Data

SHOWN_HOME = 4
PINV, RNN, OURS, BOUND = VERMILLION, BLUE, GREEN, BLACK

_PAPER_NAMES = {"pinv": "not optimised (pseudo-inverse)", "rnn": "optimised (network)"}
_MU = "manipulability µ (m³)"


def draw(data: Data, out: Path) -> tuple[str, ...]:
    """Draw every figure into the folder `out`; gives the files' names."""
    figures = {
        "figure_05.png": _manipulability_by_path,
        "figure_06.png": _manipulability_by_home,
        "figure_07.png": _boxes,
        "figure_08.png": _coordinates,
        "figure_09.png": _error,
        "figure_10.png": _errors,
        "attainable.png": _attainable,
    }
    for name, make in figures.items():
        make(data, out / name)
    return tuple(figures)


def _mu_lines(ax: Axes, data: Data, path: str, home: int) -> None:
    for method, colour, style in (("pinv", PINV, "-"), ("rnn", RNN, "-")):
        mu = data.trace(path, home, "pinv" if method == "pinv" else "rnn")["manipulability"]
        ax.plot(mu, style, color=colour, linewidth=1.8, label=_PAPER_NAMES[method])


def _manipulability_by_path(data: Data, out: Path) -> None:
    title = f"Figure 5: manipulability over the steps, home {SHOWN_HOME}"
    with figure(out, title, 1, 3, sharey=True) as axes:
        for ax, path in zip(axes.flat, paper.PATHS, strict=True):
            _mu_lines(ax, data, path, SHOWN_HOME)
            ax.set(title=path, xlabel="step")
        axes[0, 0].set_ylabel(_MU)
        axes[0, 0].legend(loc="upper left", fontsize=9.5, frameon=False)
        axes[0, 0].set_ylim(top=0.064)


def _manipulability_by_home(data: Data, out: Path) -> None:
    title = "Figure 6: manipulability over the steps of the spiral, four homes"
    with figure(out, title, 2, 2, size=(10.0, 6.4), sharex=True) as axes:
        for ax, home in zip(axes.flat, paper.HOMES, strict=True):
            _mu_lines(ax, data, "spiral", home)
            ax.set(title=f"home {home}")
        for ax in axes[1]:
            ax.set_xlabel("step")
        for ax in axes[:, 0]:
            ax.set_ylabel(_MU)
        axes[0, 0].legend(loc="upper left", fontsize=9.5, frameon=False)


def _boxes(data: Data, out: Path) -> None:
    title = (
        "Figure 7: manipulability over all steps of the spiral (box: quartiles and median, whiskers: range)"
    )
    with figure(out, title, 1, 4, size=(11.0, 4.2)) as axes:
        for ax, home in zip(axes.flat, paper.HOMES, strict=True):
            values = [data.trace("spiral", home, "pinv"), data.trace("spiral", home, "rnn")]
            boxes = ax.boxplot(
                [trace["manipulability"][1:] for trace in values],
                whis=(0, 100),
                widths=0.55,
                patch_artist=True,
                medianprops={"color": "black", "linewidth": 1.6},
            )
            for box, colour in zip(boxes["boxes"], (PINV, RNN), strict=True):
                box.set(facecolor=colour, alpha=0.65)
            ax.set_xticks([1, 2], ["not\noptimised", "optimised"])
            ax.set(title=f"home {home}")
        axes[0, 0].set_ylabel(_MU)


def _coordinates(data: Data, out: Path) -> None:
    title = f"Figure 8: desired and actual tip on the sinusoid, optimised, home {SHOWN_HOME}"
    trace = data.trace("sinusoid", SHOWN_HOME, "rnn")
    start = trace.block("tip_ref")[0]
    with figure(out, title, 1, 3) as axes:
        for i, (ax, name) in enumerate(zip(axes.flat, "xyz", strict=True)):
            desired, actual = (1e3 * (trace.block(block)[:, i] - start[i]) for block in ("tip_ref", "tip"))
            ax.plot(actual, color=RNN, linewidth=3.0, label="actual")
            ax.plot(desired, "--", color=PINV, linewidth=1.6, label="desired")
            ax.set(title=name, xlabel="step", ylabel=f"{name} from the start (mm)")
        axes[0, 0].legend(fontsize=10, frameon=False)


def _error(data: Data, out: Path) -> None:
    title = f"Figure 9: tip error on the sinusoid, not optimised, home {SHOWN_HOME}"
    trace = data.trace("sinusoid", SHOWN_HOME, "pinv")
    with figure(out, title, size=(8.0, 4.2)) as axes:
        ax, steps = axes[0, 0], np.arange(1, STEPS + 1)
        ax.plot(steps, 1e3 * lagged_errors(trace), "--", color=PINV, label="lagged: new target, old position")
        ax.plot(steps, 1e3 * matched_errors(trace), color=PINV, linewidth=2.0, label="matched indices")
        ax.axhline(0.1 * paper.TABLE_5_PSEUDO_INVERSE["sinusoid"][SHOWN_HOME - 1], color="0.4", linestyle=":")
        ax.text(
            5,
            0.1 * paper.TABLE_5_PSEUDO_INVERSE["sinusoid"][SHOWN_HOME - 1] + 0.004,
            "Table 5 (RMS)",
            color="0.3",
        )
        ax.set(xlabel="step", ylabel="tip error (mm)", ylim=(0.0, 0.45))
        ax.legend(fontsize=10, frameon=False, loc="upper right")


def _errors(data: Data, out: Path) -> None:
    title = f"Figure 10: tip error without and with optimisation, home {SHOWN_HOME}"
    with figure(out, title, 1, 2, size=(11.0, 4.4)) as axes:
        for ax, path in zip(axes.flat, ("sinusoid", "spiral"), strict=True):
            for method, colour in (("pinv", PINV), ("rnn", RNN)):
                trace = data.trace(path, SHOWN_HOME, "pinv" if method == "pinv" else "rnn")
                steps = np.arange(1, STEPS + 1)
                ax.semilogy(
                    steps,
                    1e3 * matched_errors(trace),
                    color=colour,
                    linewidth=1.8,
                    label=_PAPER_NAMES[method],
                )
                ax.semilogy(
                    steps,
                    1e3 * lagged_errors(trace),
                    ":",
                    color=colour,
                    linewidth=1.3,
                    label="the same, lagged",
                )
            ax.set(title=path, xlabel="step", ylim=(3e-4, 20.0))
        axes[0, 0].set_ylabel("tip error (mm)")
        axes[0, 0].legend(fontsize=9.5, frameon=False, ncols=2, loc="upper center")


def _attainable(data: Data, out: Path) -> None:
    title = "Not in the paper: what self-motion inside the joint limits could reach at the same tip positions"
    with figure(out, title, 3, 4, size=(12.0, 8.0), sharex=True, sharey=True) as axes:
        for i, path in enumerate(paper.PATHS):
            for j, home in enumerate(paper.HOMES):
                ax = axes[i, j]
                smooth = data.trace(path, home, "self_motion", "smooth")["manipulability"]
                ax.plot(
                    data.upper[path, home].along("smooth"),
                    "--",
                    color=BOUND,
                    linewidth=1.4,
                    label="attainable µ*",
                )
                ax.plot(smooth, color=OURS, linewidth=2.0, label="self_motion")
                _mu_lines(ax, data, path, home)
                ax.set_title(f"{path}, home {home}")
                ax.set_ylim(0.0, 0.135)
            axes[i, 0].set_ylabel(_MU)
        for ax in axes[-1]:
            ax.set_xlabel("step")
        handles, labels = axes[0, 0].get_legend_handles_labels()
        axes[0, 0].figure.legend(
            handles, labels, loc="outside lower center", ncols=4, fontsize=11, frameon=False
        )
