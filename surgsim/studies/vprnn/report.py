"""README.md of the study's result folder."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from surgsim.studies.page import claims_table, pictures, versions
from surgsim.studies.study import Claim, Row, markdown_table
from surgsim.studies.vprnn.cases import PAPER_SIZE

Tables = Mapping[str, Sequence[Row]]

INTRODUCTION = """# VPRNN paper: reproduction

"Varying parameters recurrent neural network (VPRNN) based hierarchical control of a 7-DoF surgical
manipulator for robot-assisted minimally invasive surgery": Nullspace, RNN and VPRNN with the gains of Table
I on an LWR4+ under torques, along the shipped scenario `sinusoid_lwr4plus`. Two controllers of surgsim run
beside them. Everything here is made again by

    {command}

with {versions}. The CSV files hold every table with nine digits; only `starts_every_run.csv` is
not shown."""

COMPARISON = """## Figures 4 to 8: the comparison

Nominal means that the controller's model of the arm is exact. The paper's arm was a real one, with friction
and payload that its model did not have, so the second level adds both: {level}, a cell at the edge of those
of the ladder below that stay within 5 mm and 15 mm, where VPRNN's errors are of the size of the paper's
figures. `mu over attainable` is the mean of µ/µ*, with µ* the largest µ that self-motion
could reach with the same tip and the
shaft through the same point, where it passes the trocar, so that a run cannot pass it."""

GAINS = """## Gains: why the three are nearly alike

With v the right side of eq. (20) and J = [J_T; J_rcm], the constrained optimum of eq. (22) is

    q' = pinv(J) v + (h0/h1) N grad(ln µ),  N = I - pinv(J) J

since the terms of h2, h3 and h4 vanish where the constraints hold, and (J_T <> h) psi is grad(ln µ). The
steady state of Jin's network is the same with c3/c2, and Nullspace is the same with its gain. So the three
differ by one number, the climbing rate: 0.01 for VPRNN and 1 for RNN with Table I. VPRNN climbs a hundred
times slower than RNN, and at equal rates they coincide
(at 10, Nullspace's gradient is cut at the joints' velocity limits). VPRNN's tip and RCM errors, nominally
1 % below the other two's by RMS, are those of not climbing at all (gain 0).

Under torques, the resolver's velocity enters the law only through K_N2 and D_N2 in the null space of [tip;
RCM]. Tip and RCM error are set by K_X, D_X, K_N and D_N: with K_N2 = D_N2 = 0, which cuts the resolver off,
they stay as they are. RNN without RCM rows is the network of Jin et al. as Table I lists it, which has
neither h3 nor k2."""

LADDER = """## Payload and friction

Largest errors with a payload at the tip adapter and Coulomb friction in every joint, neither known to the
controller. The RCM error passes its bound first, with either: its spring, K_N = 800 N/m, is the softest of
the hierarchy. Friction of 1 N m in every joint is enough."""

NETWORKS = """## Convergence of the networks

On the velocity problem of one instant, held still. VPRNN from a random z(0), so delta(0) = W z(0) - l; RNN
from random omega, phi, lambda and sigma. `1 percent` is when q' stays within 1 % of its first distance from
the optimum, at the control period's resolution; `end deviation` is relative to the formula above. RNN's
slowest modes are those of its constants: the self-motion decays with c2/epsilon = 10 1/s."""

THEOREM = """## Theorem 1

Eq. (27) stepped by 10 µs from delta(0) of a random z(0), against its closed form delta(0) exp(-beta (exp(t)
- 1)), against Runge-Kutta, and V' = -beta exp(t) delta^T phi(delta) against the change of V (trapezoidal
rule, so of the order of the step squared). The paper gives no bound for the activation of eq. (28); with
one, the fall is linear until the bound is reached and depends on the start. With the paper's three
cross-product rows of J_rcm, W has rank {rank} of {size}, so that z* is not unique, though q' is; the runs
use two rows normal to the shaft."""

EULER = """## Explicit Euler of eq. (29)

A step multiplies delta by 1 - T beta exp(t), which is below -1 from t = ln(2/(T beta)) on. `grows from` is
the last step that did not enlarge delta, on the still problem from z = 0 shortly before; `above its start`
is when rounding errors have grown past |delta(0)|."""

STARTS = """## Convergence of the arm from random configurations

The path's start is held; the joints are displaced at random. Near: tip 5 to 20 mm and shaft 1 to 10 mm off.
Far: tip 50 to 100 mm and shaft 10 to 50 mm off. `converged` counts runs whose tip and RCM error stay below
1 mm before 3 s are over; runs that are stopped (a joint passed its velocity limit) are counted in `runs`
only, medians are over those that converge. A `rate` is ln(20) over the time from which the error stays
below 5 % of its start: 5 1/s for an exponential with k1 = k2 = 5 1/s. With perfect velocity tracking that
is what every resolver has; under torques the impedance law sets it. No resolver is the fastest in every
column: the three differ by less than the starts do."""

UNKNOWN = """## What the paper does not say

Its curves are pictures without numbers, so that only its bounds of 5 mm and 15 mm can be compared."""

CONVENTIONS: tuple[tuple[str, str], ...] = (
    ("gain of Nullspace", "1 rad²/s on grad(ln µ); 0 to 10 in the table of gains"),
    ("λ = 0.5 in Table I's RNN", "not defined anywhere in the paper; not used"),
    (
        "RCM rows of RNN",
        "Table I gives neither h3 nor k2: c0 of the tip rows, k2 = 5 1/s; without them in the table of gains",
    ),
    ("constants of RNN", "c3 = h0, c2 = h1, c0 = h2, c1 = h4, epsilon = 1/beta"),
    ("bounds of eq. (28)", "linear activation; 1 in the table of Theorem 1"),
    (
        "sinusoid, trocar, home, instrument",
        "`sinusoid_lwr4plus`; A = 1 cm and L = 25 cm are from another paper of the same group; 10 s",
    ),
    ("sampling time, integration", "1 ms; delta is stepped in closed form, exp(t) is held from t = 20 s on"),
    ("friction and payload of the real arm", "the ladder"),
)
"""What had to be chosen."""


def write_report(
    path: Path,
    tables: Tables,
    claims: Sequence[Claim],
    figures: Sequence[str],
    *,
    cross_rank: tuple[int, int],
    quick: bool,
) -> None:
    """Write the page: command, versions, claims, tables, figures."""
    command = "surgsim reproduce vprnn" + (" --quick" if quick else "")
    parts = [INTRODUCTION.format(command=command, versions=versions())]
    if quick:
        parts.append("This is a quick run: a sample of the cells, without figures.")
    parts += ["## Claims", claims_table(claims)]
    parts += [COMPARISON.format(level=PAPER_SIZE.name), markdown_table(tables["comparison"])]
    parts += pictures(figures, [f"figure_0{i}.png" for i in range(4, 9)])
    parts += _section(GAINS, tables["gains"], figures, "gains.png")
    parts += _section(LADDER, tables["ladder"], figures, "ladder.png")
    parts += _section(NETWORKS, tables["network_rates"], figures, "networks.png")
    rank, size = cross_rank
    parts += [THEOREM.format(rank=rank, size=size), markdown_table(tables["theorem_1"])]
    parts += _section(EULER, tables["euler"], figures, "euler.png")
    parts += ["The whole sinusoid with Table I at 1 kHz:", markdown_table(tables["euler_arm"])]
    parts += _section(STARTS, tables["starts"], figures, "starts.png")
    parts += [UNKNOWN, markdown_table([{"what": what, "here": here} for what, here in CONVENTIONS])]
    path.write_text("\n\n".join(parts) + "\n", encoding="utf-8")


def _section(text: str, rows: Sequence[Row], figures: Sequence[str], picture: str) -> list[str]:
    return [text, markdown_table(rows), *pictures(figures, [picture])]
