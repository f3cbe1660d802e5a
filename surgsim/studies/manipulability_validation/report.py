"""README.md of the study's result folder."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from surgsim.studies.manipulability_validation.setup import CONVENTIONS
from surgsim.studies.page import claims_table, pictures, versions
from surgsim.studies.study import Claim, Row, markdown_table

Tables = Mapping[str, Sequence[Row]]

INTRODUCTION = """# Manipulability paper: reproduction

Su et al., "Experimental Validation of Manipulability Optimization Control of a 7-DoF Serial Manipulator
for Robot-assisted Surgery": the pseudo-inverse and a dynamic neural network move the flange of an LWR4+
along a circle, a sinusoid and a spiral from four homes. Everything here is made again by

    {command}

with {versions}. The CSV files hold the tables with nine digits."""

TABLE_4 = """## Table 4: averages of µ

The paper prints neither its homes nor the network's constants. The homes below were calibrated on this
table, six joints on six averages each, so the averages show that the table can be had from an LWR4+ with
one common gain c3/c2. They do not identify the paper's homes: many others fit as well. `off` is our
deviation."""

INCREASE = """\
The paper prints the increase with one to three digits: from home 2 one unit of the last one is up to a
third of it. On the spiral from home 3 its increase is not the difference of its own averages, 0.0009."""

TABLE_5 = """## Table 5: root mean square tip errors, in 1e-4 m

`matched` compares position and desired position of the same step. `lagged` compares the new desired
position with the position before the step: about the length of a step, whatever the arm does. The paper's
pseudo-inverse errors look like the lagged ones, near `step length` on every path; the drift itself is
mostly several times smaller. Not all of it fits: sinusoid from home 4 is larger than any lag explains.

The network's own error is exactly epsilon (lambda - lambda(0)), so the optimised column is a statement
about epsilon, which the paper does not print. With the one that fits the circle, matched indices give the
four circles within 5 % and two sinusoids within 15 %; the other cells come out up to 2.5 times the
printed errors. So the paper's two rows seem to differ in how their indices are matched, or the homes are
others than ours."""

ATTAINABLE = """## What the paper does not give: the attainable µ

µ* is the largest µ that self-motion reaches at the same tip position without leaving the joint limits,
sought from 12 random starts and then followed along every run, 41 samples a path. A fraction is (mean µ −
mean µ of the pseudo-inverse) / (mean µ* − mean µ of the pseudo-inverse). `self_motion` is surgsim's
resolver: same path, 1000 steps and 10 s. It leaves and reaches rest in ramps of 0.5 s; constant speed
from the first step, as in the paper, would need up to {jerk} times the joints' acceleration limits.
`pinv` and `attainable` have the same ramps, `fraction rnn` has the paper's timing."""

VARIANTS = """## Variants: d2 = 0.2 m as Table 3 prints it, and the 6x7 µ

The same homes and controllers. With the printed d2 the paths start elsewhere and the averages are others:
the homes are calibrated for d2 = 0. `6x7` is the µ of the whole Jacobian along the standard runs, whose
network maximises the 3x7 one."""

NETWORK = """## Eq. (7) as printed

The signs of the c3 and c1 terms follow from the gradient of the Lagrangian the other way round. As
printed the network is unstable (its linearisation has a pole pair in the right half plane); home 1,
circle. A run ends as diverged when a neural state exceeds 1e12. c1 = 0 leaves the corrected network
undamped, which fails too."""

HOMES = """## Homes

Homes 1 and 3 are what `surgsim/studies/manipulability_validation/calibrate.py` finds; homes 2 and 4 are
of an earlier search that ignored the joint limits. Its homes 1 and 3 are given up: along the sinusoid
they leave the joint range (`margin` below zero), and held at the limit the tip leaves the path."""


def write_report(
    path: Path, tables: Tables, claims: Sequence[Claim], figures: Sequence[str], *, quick: bool
) -> None:
    """Write the page: command, versions, claims, tables, figures."""
    command = "surgsim reproduce manipulability_validation" + (" --quick" if quick else "")
    parts = [INTRODUCTION.format(command=command, versions=versions())]
    if quick:
        parts.append("This is a quick run: a sample of the cells, without variants and figures.")
    parts += ["## Claims", claims_table(claims)]
    parts += [TABLE_4, markdown_table(tables["table_4"], 3)]
    parts += [INCREASE, markdown_table(tables["table_4_increase"], 3)]
    parts += pictures(figures, ("figure_05.png", "figure_06.png", "figure_07.png"))
    parts += [TABLE_5, markdown_table(tables["table_5"])]
    parts += pictures(figures, ("figure_08.png", "figure_09.png", "figure_10.png"))
    parts += [ATTAINABLE.format(jerk=_jerk(tables["attainable"])), markdown_table(tables["attainable"], 3)]
    parts += pictures(figures, ("attainable.png",))
    if not quick:
        parts += [VARIANTS, markdown_table(tables["variants"], 3)]
        parts += [NETWORK, markdown_table(tables["printed_network"], 3)]
        parts += [HOMES, markdown_table(tables["homes"], 5)]
    parts += ["## Conventions", _conventions()]
    path.write_text("\n\n".join(parts) + "\n", encoding="utf-8")


def _jerk(rows: Sequence[Row]) -> str:
    return f"{max(float(str(row['pinv_paper_timing_acceleration'])) for row in rows):.1f}"


def _conventions() -> str:
    return markdown_table(
        [{"what": what, "value": value, "from": source} for what, value, source in CONVENTIONS]
    )
