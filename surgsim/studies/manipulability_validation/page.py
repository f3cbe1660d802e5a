"""The page of the manipulability study: figures 5 to 10 of the paper and one more, and what is written."""

import numpy as np

from surgsim.studies.figure import BLACK, BLUE, GREEN, VERMILLION, Axes, label
from surgsim.studies.manipulability_validation.calibrate import HOMES, PAPER, PATHS, STEPS
from surgsim.studies.manipulability_validation.cases import DRAWN, Cell, UnfittedHome, upper_bound
from surgsim.studies.study import Figure, Results, Section
from surgsim.studies.tables import Tables, numbers

SHOWN_HOME = 4
PINV, RNN, OURS, BOUND = VERMILLION, BLUE, GREEN, BLACK
_STYLES = (
    ("pinv", PINV, "not optimised (pseudo-inverse)"),
    ("rnn", RNN, "optimised (network)"),
)
_MU = "manipulability µ (m³)"
_SMALL = {"fontsize": 9.5, "frameon": False}


def _mu_lines(ax: Axes, results: Results, path: str, home: int) -> None:
    for method, colour, name in _STYLES:
        ax.plot(results.of(Cell(path, home, method)).curves["mu"], color=colour, linewidth=1.8, label=name)


def _manipulability_by_path(axes: Axes, results: Results, _: Tables) -> None:
    for ax, path in zip(axes.flat, PATHS, strict=True):
        _mu_lines(ax, results, path, SHOWN_HOME)
    label(axes, "step", [_MU], PATHS)
    axes[0, 0].legend(loc="upper left", **_SMALL)
    axes[0, 0].set_ylim(top=0.064)


def _manipulability_by_home(axes: Axes, results: Results, _: Tables) -> None:
    for ax, home in zip(axes.flat, HOMES, strict=True):
        _mu_lines(ax, results, "spiral", home)
    label(axes, "step", [_MU, _MU], _HOME_TITLES)
    axes[0, 0].legend(loc="upper left", **_SMALL)


def _boxes(axes: Axes, results: Results, _: Tables) -> None:
    median = {"color": "black", "linewidth": 1.6}
    for ax, home in zip(axes.flat, HOMES, strict=True):
        values = [results.of(Cell("spiral", home, method)).curves["mu"][1:] for method, _, _ in _STYLES]
        boxes = ax.boxplot(values, whis=(0, 100), widths=0.55, patch_artist=True, medianprops=median)
        for box, colour in zip(boxes["boxes"], (PINV, RNN), strict=True):
            box.set(facecolor=colour, alpha=0.65)
        ax.set_xticks([1, 2], ["not\noptimised", "optimised"])
    label(axes, ylabels=[_MU], titles=_HOME_TITLES)


def _coordinates(axes: Axes, results: Results, _: Tables) -> None:
    curves = results.of(Cell("sinusoid", SHOWN_HOME, "rnn")).curves
    desired, actual = (1e3 * (curves[name] - curves["tip_ref"][0]) for name in ("tip_ref", "tip"))
    for i, (ax, name) in enumerate(zip(axes.flat, "xyz", strict=True)):
        ax.plot(actual[:, i], color=RNN, linewidth=3.0, label="actual")
        ax.plot(desired[:, i], "--", color=PINV, linewidth=1.6, label="desired")
        ax.set_ylabel(f"{name} from the start (mm)")
    label(axes, "step", titles="xyz")
    axes[0, 0].legend(fontsize=10, frameon=False)


def _error(axes: Axes, results: Results, _: Tables) -> None:
    curves, steps, ax = (
        results.of(Cell("sinusoid", SHOWN_HOME, "pinv")).curves,
        np.arange(1, STEPS + 1),
        axes[0, 0],
    )
    printed = 0.1 * PAPER["pinv_error"]["sinusoid"][SHOWN_HOME - 1]
    ax.plot(steps, 1e3 * curves["lagged"], "--", color=PINV, label="lagged: new target, old position")
    ax.plot(steps, 1e3 * curves["matched"], color=PINV, linewidth=2.0, label="matched indices")
    ax.axhline(printed, color="0.4", linestyle=":")
    ax.text(5, printed + 0.004, "Table 5 (RMS)", color="0.3")
    ax.set_ylim(0.0, 0.45)
    label(axes, "step", ["tip error (mm)"])
    ax.legend(fontsize=10, frameon=False, loc="upper right")


def _errors(axes: Axes, results: Results, _: Tables) -> None:
    steps, paths = np.arange(1, STEPS + 1), ("sinusoid", "spiral")
    for ax, path in zip(axes.flat, paths, strict=True):
        for method, colour, name in _STYLES:
            curves, lagged = results.of(Cell(path, SHOWN_HOME, method)).curves, "the same, lagged"
            ax.semilogy(steps, 1e3 * curves["matched"], color=colour, linewidth=1.8, label=name)
            ax.semilogy(steps, 1e3 * curves["lagged"], ":", color=colour, linewidth=1.3, label=lagged)
        ax.set_ylim(3e-4, 20.0)
    label(axes, "step", ["tip error (mm)"], paths)
    axes[0, 0].legend(ncols=2, loc="upper center", **_SMALL)


def _attainable(axes: Axes, results: Results, _: Tables) -> None:
    cells = [(path, home) for path in PATHS for home in HOMES]
    for ax, (path, home) in zip(axes.flat, cells, strict=True):
        best = upper_bound(results, path, home)["smooth"]
        ours = results.of(Cell(path, home, "self_motion", "smooth")).curves["mu"]
        ax.plot(best, "--", color=BOUND, linewidth=1.4, label="attainable µ*")
        ax.plot(ours, color=OURS, linewidth=2.0, label="self_motion")
        _mu_lines(ax, results, path, home)
        ax.set_ylim(0.0, 0.135)
    label(axes, "step", 3 * [_MU], [f"{path}, home {home}" for path, home in cells], legend=4)


_HOME_TITLES = [f"home {home}" for home in HOMES]
_5 = f"Figure 5: manipulability over the steps, home {SHOWN_HOME}"
_6 = "Figure 6: manipulability over the steps of the spiral, four homes"
_7 = "Figure 7: manipulability over all steps of the spiral (box: quartiles and median, whiskers: range)"
_8 = f"Figure 8: desired and actual tip on the sinusoid, optimised, home {SHOWN_HOME}"
_9 = f"Figure 9: tip error on the sinusoid, not optimised, home {SHOWN_HOME}"
_10 = f"Figure 10: tip error without and with optimisation, home {SHOWN_HOME}"
_MORE = "Not in the paper: what self-motion inside the joint limits could reach at the same tip positions"
FIGURES = (
    Figure("figure_05.png", _5, _manipulability_by_path, (1, 3), share=(False, True)),
    Figure("figure_06.png", _6, _manipulability_by_home, (2, 2), (10.0, 6.4), (True, False)),
    Figure("figure_07.png", _7, _boxes, (1, 4), (11.0, 4.2)),
    Figure("figure_08.png", _8, _coordinates, (1, 3)),
    Figure("figure_09.png", _9, _error, size=(8.0, 4.2)),
    Figure("figure_10.png", _10, _errors, (1, 2), (11.0, 4.4)),
    Figure("attainable.png", _MORE, _attainable, (3, 4), (12.0, 8.0), (True, True)),
)

INTRODUCTION = """\
{reference}, "{title}": the pseudo-inverse and a dynamic neural network move the flange of an LWR4+
along a circle, a sinusoid and a spiral from four homes. Everything here is made again by

    {command}

with {versions}. The CSV files hold the tables with nine digits; only
`random_homes_every.csv` is not shown."""
_TABLE_4 = """## Table 4: averages of µ

The paper prints neither its homes nor the network's constants. The homes below were calibrated on this
table, six joints on six averages each, so that the table cannot fail to come out: it can be fitted, with an
LWR4+ and one common gain c3/c2, and that is all that the agreement says. It does not identify the paper's
homes: many others fit as well. What can fail are the random homes below. `off` is our deviation."""
_INCREASE = """\
The paper prints the increase with one to three digits: from home 2 one unit of the last one is up to a
third of it. On the spiral from home 3 its increase is not the difference of its own averages, 0.0009.
`steps above` is the share of the steps in which the optimised µ is the larger one."""
_RANDOM = f"""## Random homes: what can fail

Homes that nothing is fitted to, joints uniform in their ranges (numpy's generator of [{UnfittedHome.seed},
home], up to {DRAWN} draws), the same paths, steps and network, whose c3/c2 is that of Table 4's fit.
A home counts if the pseudo-inverse follows all three paths within 1 mm and no joint comes to a limit: from
many homes a path of 25 cm leaves the workspace. `drawn` is how many it took. Intervals are at 95 %: Wilson's
for the share, of order statistics for the median. The paper's "always" is not refuted by any of these homes.
How much is another matter: the median is 2 %, and on the sinusoid the paper's home 4 (55.8 %), with a gain
that was fitted to it, lies beyond the largest."""
_STEPS = """## Number of steps

Section 4 has the increase depend on the number of steps N. The twelve cells again with other N. In the same
time of the path the increase does not change: the network climbs by (c3/c2) times the time. With steps of
the same time, eq. (5) with a constant t, a path of more steps takes longer, and the increase grows with that
time. So the dependence is one on the time of the path. `rms` are the medians of the matched tip errors."""
_TABLE_5 = """## Table 5: root mean square tip errors, in 1e-4 m

`matched` compares position and desired position of the same step. `lagged` compares the new desired
position with the position before the step: about the length of a step, whatever the arm does. The paper's
pseudo-inverse errors look like the lagged ones, near `step length` on every path; the drift itself is
mostly several times smaller. Not all of it fits: sinusoid from home 4 is larger than any lag explains.

The network's own error is exactly epsilon (lambda - lambda(0)), so the optimised column is a statement
about epsilon, which the paper does not print. With the one that fits the circle, matched indices give the
four circles within 5 % and two sinusoids within 15 %; the other cells come out up to 2.5 times the
printed errors. So the paper's two rows seem to differ in how their indices are matched, or the homes are
others than ours.

The abstract's "1 mm compared to 0.5 mm", and section 4's "higher order of magnitude", are not in this table:
its largest entries are 0.60 and 0.42 mm, and no entry is ten times the other method's. As largest errors over
the steps they may be what figure 10 shows, which the text says is of the spiral and the caption of the
sinusoid. That errors grow with the gain in µ (section 5) is in neither the paper's own tables nor in ours."""
_ATTAINABLE = """## What the paper does not give: the attainable µ

µ* is the largest µ that self-motion reaches at the same tip position without leaving the joint limits,
sought from 12 random starts and then followed along every run, 41 samples a path. A fraction is (mean µ −
mean µ of the pseudo-inverse) / (mean µ* − mean µ of the pseudo-inverse). `self_motion` is surgsim's
resolver: same path, 1000 steps and 10 s. It leaves and reaches rest in ramps of 0.5 s; constant speed
from the first step, as in the paper, would need up to {jerk} times the joints' acceleration limits.
`pinv` and `attainable` have the same ramps, `fraction rnn` has the paper's timing."""
_VARIANTS = """## Variants: d2 = 0.2 m as Table 3 prints it, and the 6x7 µ

The same homes and controllers. With the printed d2 the paths start elsewhere and the averages are others:
the homes are calibrated for d2 = 0. `6x7` is the µ of the whole Jacobian along the standard runs, whose
network maximises the 3x7 one."""
_NETWORK = """## Eq. (7) as printed

The signs of the c3 and c1 terms follow from the gradient of the Lagrangian the other way round. As
printed the network is unstable (its linearisation has a pole pair in the right half plane); home 1,
circle. A run ends as diverged when a neural state exceeds 1e12. c1 = 0 leaves the corrected network
undamped, which fails too."""
_HOME_TEXT = """## Homes

Homes 1 and 3 are what `surgsim/studies/manipulability_validation/calibrate.py` finds; homes 2 and 4 are
of an earlier search that ignored the joint limits. Its homes 1 and 3 are given up: along the sinusoid
they leave the joint range (`margin` below zero), and held at the limit the tip leaves the path."""
_CONVENTIONS = (
    ("steps, N", "1000", "section 3.1"),
    (
        "duration",
        "10 s, so one step is 10 ms",
        "chosen: the paper gives none, and only (c3/c2) T matters for mu",
    ),
    ("circle", "R = 2 cm in the xy plane, from its point furthest along x", "R: Table 1; plane: chosen"),
    (
        "sinusoid",
        "A = 1 cm along y, L = 25 cm along x, 2 periods",
        "A, L: Table 1; axes and periods: chosen",
    ),
    (
        "spiral",
        "R = 1 cm, L = 5 cm along z, 6 turns",
        "R, L: Table 1; axis: chosen; turns: 6 steps as long as Table 5 has them",
    ),
    ("mu", "sqrt(det(J J^T)) of the 3x7 translational Jacobian", "eq. (1); 3x7 or 6x7 is not said"),
    ("tip", "the flange, no instrument", "an instrument makes mu several times larger than Table 4"),
    ("DH", "Table 3 with d2 = 0", "d2 = 0.2 is a misprint; shown as a variant"),
    ("velocity", "(r(k+1) - r(k)) / T", "eq. (2)"),
    ("position", "q(k+1) = q(k) + T q'(k), no feedback", "eq. (3)-(5)"),
    ("c0, c1, c2", "1", "chosen: no visible effect on mu at a given c3/c2"),
    ("c3", "0.04", "calibrated with the homes on Table 4"),
    (
        "epsilon",
        "6e-4 s",
        "calibrated on the circle's optimised errors of Table 5, which are proportional to it",
    ),
    ("averages", "over steps 1 to 1000", "chosen: the start is common to all methods"),
)
"""What is assumed, and where it comes from."""


def _attainable_text(tables: Tables) -> str:
    most = max(numbers(tables["attainable"], "pinv_paper_timing_acceleration"))
    return _ATTAINABLE.format(jerk=f"{most:.1f}")


SECTIONS = (
    Section(_TABLE_4, "table_4", digits=3),
    Section(_INCREASE, "table_4_increase", ("figure_05.png", "figure_06.png", "figure_07.png"), 3),
    Section(_RANDOM, "random_homes", digits=3),
    Section(_STEPS, "steps", digits=3),
    Section(_TABLE_5, "table_5", ("figure_08.png", "figure_09.png", "figure_10.png")),
    Section(_attainable_text, "attainable", ("attainable.png",), 3),
    Section(_VARIANTS, "variants", digits=3),
    Section(_NETWORK, "printed_network", digits=3),
    Section(_HOME_TEXT, "homes", digits=5),
    Section(
        "## Conventions",
        rows=tuple({"what": what, "value": value, "from": source} for what, value, source in _CONVENTIONS),
    ),
)
