"""The page of the VPRNN study: its figures, and what is written between them."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from surgsim.array import Array
from surgsim.studies.figure import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    VERMILLION,
    Axes,
    label,
)
from surgsim.studies.levels import Column
from surgsim.studies.stages import draw_stages
from surgsim.studies.starts import draw_starts
from surgsim.studies.study import Figure, Measured, Results, Section
from surgsim.studies.tables import Tables, numbers
from surgsim.studies.vprnn.cases import (
    COMPARED,
    LABEL,
    LADDERS,
    LEVELS,
    METHODS,
    PAPER,
    PAPER_SIZE,
    SHOWN,
    STARTED,
    Sinusoid,
)
from surgsim.studies.vprnn.networks import cross_form_rank, draw_euler, draw_networks, instant

_TIME = "time (s)"
_TIP_MM, _RCM_MM = PAPER["tip_bound"], PAPER["rcm_bound"]
_ERRORS = (
    Column("tip_max_mm", _TIP_MM, "largest tip error (mm)"),
    Column("rcm_max_mm", _RCM_MM, "largest RCM error (mm)"),
)


def _style(name: str) -> dict[str, Any]:
    method = METHODS[name]
    return {"color": method.colour, "linestyle": method.style, "linewidth": 1.6, "label": method.label}


def _over_time(axes: Axes, results: Results, values: Callable[[Measured], Array]) -> None:
    """Every controller over time, a panel for each level."""
    for ax, level in zip(axes.flat, LEVELS, strict=True):
        for name in COMPARED:
            found = results.of(Sinusoid(name, level))
            ax.plot(found.curves["t_s"], values(found), **_style(name))


def _tracking(axes: Axes, results: Results, _: Tables) -> None:
    for row, level in zip(axes, LEVELS, strict=True):
        start = results.of(Sinusoid("vprnn", level)).curves["tip_ref"][0]
        for ax, i, axis in ((row[0], 1, "y"), (row[1], 2, "z")):
            wanted = 1e3 * (results.of(Sinusoid("vprnn", level)).curves["tip_ref"] - start)
            ax.plot(*wanted[:, [0, i]].T, color="0.75", linewidth=5.0, label="desired")
            for name in COMPARED:
                tip = 1e3 * (results.of(Sinusoid(name, level)).curves["tip"] - start)
                ax.plot(*tip[:, [0, i]].T, **_style(name))
            ax.set(title=str(level), ylabel=f"{axis} from the start (mm)")
        row[1].set_ylim(-4.0, 1.0)
    label(axes, "x from the start (mm)", legend=6)


def _error(name: str, bound: float, axes: Axes, results: Results, _: Tables) -> None:
    _over_time(axes, results, lambda found: 1e3 * found.curves[f"{name}_error_m"])
    for ax in axes.flat:
        ax.axhline(bound, color="0.3", linewidth=1.2, linestyle=(0, (1, 1)))
        ax.text(0.2, 1.12 * bound, f"the paper's bound, {bound:g} mm", color="0.3", fontsize=9.5)
        ax.set(yscale="log", ylim=(1e-5, 60.0))
    label(axes, _TIME, [f"{'RCM' if name == 'rcm' else name} error (mm)"], LEVELS, legend=5)


def _manipulability(axes: Axes, results: Results, _: Tables) -> None:
    for ax, level in zip(axes.flat, LEVELS, strict=True):
        best = results.of(Sinusoid("self_motion", level)).curves
        style = {"color": BLACK, "linewidth": 4.0, "alpha": 0.25, "label": "attainable µ*"}
        ax.plot(best["attainable_t_s"], best["attainable"], **style)
    _over_time(axes, results, lambda found: found.curves["manipulability"])
    label(axes, _TIME, ["manipulability µ (m³)"], LEVELS, legend=6)


def _joints(axes: Axes, results: Results, _: Tables) -> None:
    colours = (BLACK, ORANGE, "#56B4E9", GREEN, VERMILLION, BLUE, PURPLE)
    styles = ("-", "--", "-.", ":", "-", "--", "-.")
    for ax, level in zip(axes.flat, LEVELS, strict=True):
        curves = results.of(Sinusoid("vprnn", level)).curves
        for i, q in enumerate(np.rad2deg(curves["q"]).T):
            ax.plot(curves["t_s"], q, styles[i], color=colours[i], linewidth=1.8, label=f"q{i + 1}")
    label(axes, _TIME, ["joint angle (deg)"], LEVELS, legend=7)


def _gains(axes: Axes, _: Results, tables: Tables) -> None:
    shapes = {"Nullspace": ("o", VERMILLION, 12), "RNN": ("s", BLUE, 8), "VPRNN": ("^", PURPLE, 8)}
    rows = [
        r for r in tables["gains"] if r["climbing_rate"] is not None and "without" not in str(r["variant"])
    ]
    for name, (marker, colour, size) in shapes.items():
        mine = [row for row in rows if str(row["variant"]).split(",")[0] == name]
        style = {"color": colour, "markersize": size, "fillstyle": "none", "markeredgewidth": 2.0}
        for ax, column in zip(axes.flat, ("mu_mean", "mu_mean_kinematic"), strict=True):
            rates = numbers(mine, "climbing_rate")
            ax.plot(rates, numbers(mine, column), marker, label=name, linestyle="none", **style)
    for ax in axes.flat:
        ax.set_xscale("symlog", linthresh=0.01)
        ax.set_xlim(-0.002, 20.0)
    words = ["under torques", "perfect velocity tracking"]
    label(axes, "k (rad²/s); Table I: VPRNN 0.01, RNN 1", ["mean manipulability µ (m³)"], words)
    axes[0, 0].legend(frameon=False, fontsize=10, loc="upper left")


_NOT, _ALL, _Y, _WIDE = "Not in the paper:", (True, True), (False, True), ((1, 2), (11.5, 5.0))
_F3 = "Figure 3: a hand leads the instrument through the port, then the tip goes to the path and follows it"
_F5, _F6 = r"Figure 5: end-effector error $E_\mathrm{end}$", r"Figure 6: RCM error $\|E_\mathrm{rcm}\|$"
_F7 = "Figure 7: manipulability µ, and the largest that self-motion could reach"
_CLIMB = f"{_NOT} mean µ over the climbing rate k of q' = pinv(J) v + k N grad(ln µ)"
_STILL = f"{_NOT} the networks alone, from random states, on a problem that stands still"
_BREAKS = f"{_NOT} explicit Euler of eq. (29) breaks at t = ln(2/(Tβ)) (dashed)"
_RANDOM = f"{_NOT} {SHOWN} random initial configurations under torques, the path's start held"
_ROWS, _MAKE = (2, len(STARTED)), "errors that payload and friction make"
_BESIDE = {LABEL[n]: (s, METHODS[n].colour) for n, s in (("vprnn", "VPRNN"), *((n, "ours") for n in LADDERS))}
_LINES = {name: _style(name) for name in STARTED}
_NEAR = {name: (LABEL[name], METHODS[name].colour) for name in STARTED}
FIGURES = (
    Figure("figure_04.png", "Figure 4: trajectory tracking", _tracking, (2, 2), (12.5, 7.0), (True, False)),
    Figure("figure_05.png", f"{_F5} (logarithmic)", partial(_error, "tip", _TIP_MM), *_WIDE, _ALL),
    Figure("figure_06.png", f"{_F6} (logarithmic)", partial(_error, "rcm", _RCM_MM), *_WIDE, _ALL),
    Figure("figure_07.png", _F7, _manipulability, *_WIDE, _ALL),
    Figure("figure_08.png", "Figure 8: joint angles with VPRNN", _joints, *_WIDE, _Y),
    Figure("figure_03.png", _F3, partial(draw_stages, _LINES), (1, 3), (12.0, 4.2)),
    Figure("gains.png", _CLIMB, _gains, (1, 2), (11.0, 4.6), _Y),
    *(
        Figure(
            f"{ladder.table}.png",
            f"{_NOT} {words}",
            partial(ladder.draw, _ERRORS, _BESIDE),
            (2, 2),
            (11.5, 8.4),
        )
        for ladder, words in zip(LADDERS.values(), (_MAKE, f"{_MAKE}, on real drives"), strict=True)
    ),
    Figure("networks.png", _STILL, draw_networks, (1, 2), (11.0, 4.6), _Y),
    Figure("euler.png", _BREAKS, draw_euler, (1, 2), (11.0, 4.4), _Y),
    Figure("starts.png", _RANDOM, partial(draw_starts, _NEAR), _ROWS, (11.5, 6.0), (True, "row")),
)

INTRODUCTION = """\
"{title}": Nullspace, RNN and VPRNN with the gains of Table I on an LWR4+ under torques, along the shipped
scenario `sinusoid_lwr4plus`. Two controllers of surgsim run beside them. Everything here is made again by

    {command}

with {versions}. The CSV files hold every table with nine digits; only `starts_every_run.csv` and
`laws_every_run.csv` are not shown."""
_COMPARISON = f"""## Figures 4 to 8: the comparison

Nominal means that the controller's model of the arm is exact. The paper's arm was a real one, with friction
and payload that its model did not have, so the second level adds both: {PAPER_SIZE}, a cell at the
edge of those of the ladder below that stay within 5 mm and 15 mm, where VPRNN's errors are of the size of
the paper's figures. `mu over attainable` is the mean of µ/µ*, with µ* the largest µ that self-motion could
reach with the same tip and the shaft through the same point, where it passes the trocar, so that a run
cannot pass it."""
_GAINS = """## Gains: why the three are nearly alike

With v the right side of eq. (20) and J = [J_T; J_rcm], the constrained optimum of eq. (22) is

    q' = pinv(J) v + (h0/h1) N grad(ln µ),  N = I - pinv(J) J

since the terms of h2, h3 and h4 vanish where the constraints hold, and (J_T <> h) psi is grad(ln µ). The
steady state of Jin's network is the same with c3/c2, and Nullspace is the same with its gain. So the three
differ by one number, the climbing rate: 0.01 for VPRNN and 1 for RNN with Table I. At equal rates they
coincide (at 10, Nullspace's gradient is cut at the joints' velocity limits). VPRNN's tip and RCM errors,
nominally 1 % below the other two's by RMS, are those of not climbing at all (gain 0).

Under torques, the resolver's velocity enters the law only through K_N2 and D_N2 in the null space of [tip;
RCM]. Tip and RCM error are set by K_X, D_X, K_N and D_N: with K_N2 = D_N2 = 0, which cuts the resolver off,
they stay as they are."""
_RESOLVERS = """## The resolvers on exact joints

With perfect velocity tracking (the kinematic plant) tip and RCM error are the resolver's own. RNN as Table I
lists it has neither h3 nor k2, so no RCM rows: its shaft leaves the trocar. With them its network, of time
constant epsilon = 1 ms, follows v late, the more the faster the path, and rings at the start. VPRNN's delta,
stepped in closed form, is zero after some milliseconds whatever v does: VPRNN beats RNN in tip and RCM
error. So do pinv and Nullspace, which have no network, with the same figures; what is left is the sampling.
In 2 s `qp` meets its acceleration bounds, which the others do not have, and leaves the path."""
_LAWS = """## Which torque law lets a resolver be seen

Every resolver over every torque law with its shipped gains, k1 = k2 = 5 1/s, model exact. `evaluated at`:
the resolver's kinematics are those of the measured joints, or of its own reference, as in a position-
controlled arm. Columns of RNN are its difference from VPRNN. Two are told apart if RMS tip or RCM error
differ by more than 10 % and 1 µm. Over a law that closes tip and RCM loops of its own, as the paper's
hierarchical_impedance does, a resolver has only the null space of both, and at most the speed of
`self_motion` is seen. A law that follows the joint reference shows it: RNN without RCM rows is 130 mm off,
and RNN is told from VPRNN where the law's own error is smaller than the difference."""
_HANDS_ON = """## Figure 3: hands-on insertion, then tracking

Section IV has two steps: a user leads the robot through the incision, then it tracks on its own. Here a hand
(300 N/m, with tremor) leads the adapter 18 cm down the port's axis while the controller holds the axis and
gives way along it; it lets go, the tip goes to the start of the sinusoid (`led`), and the sinusoid begins
from the posture of that moment (`tracked`), at rest: `switch` has the velocity that was left and the errors
that the tracking begins with. rcm_inverse_dynamics is led without its observer, which would hold against the
hand. RCM errors before the tip is inside are those of the shaft's axis. Not covered: the person, the hand
being a spring on a planned way, and the second user, who may stop the robot."""
_LADDER = """## Payload and friction

Largest errors with a payload at the tip adapter and Coulomb friction in every joint, neither known to the
controller. The RCM error passes its bound first, with either: its spring, K_N = 800 N/m, is the softest of
the hierarchy. Friction of 1 N m in every joint is enough. Here the drives are ideal, and the friction is the
joints'."""
_LADDER_REAL = """## Payload and friction on real drives

The same on real drives: gears with springs, and the friction where most of an arm's is, on the motors. The
torque loop divides it by eight: of the shipped arm's 4 N m the controller meets 0.5 N m. On an LWR4+ 5 to 12
N m were identified (cited from memory), measured without a torque loop."""
_NETWORKS = """## Convergence of the networks

On the velocity problem of one instant, held still. VPRNN from a random z(0), so delta(0) = W z(0) - l; RNN
from random omega, phi, lambda and sigma. `1 percent` is when q' stays within 1 % of its first distance from
the optimum, at the control period's resolution; `end deviation` is relative to the formula above. RNN's
slowest modes are those of its constants: the self-motion decays with c2/epsilon = 10 1/s."""
_THEOREM = """## Theorem 1

Eq. (27) stepped by 10 µs from delta(0) of a random z(0), against its closed form delta(0) exp(-beta (exp(t)
- 1)), against Runge-Kutta, and V' = -beta exp(t) delta^T phi(delta) against the change of V (trapezoidal
rule, so of the order of the step squared). The paper gives no bound for the activation of eq. (28); with
one, the fall is linear until the bound is reached and depends on the start. With the paper's three
cross-product rows of J_rcm, W has rank {rank} of {size}, so that z* is not unique, though q' is; the runs
use two rows normal to the shaft."""
_EULER = """## Explicit Euler of eq. (29)

A step multiplies delta by 1 - T beta exp(t), which is below -1 from t = ln(2/(T beta)) on. `grows from` is
the last step that did not enlarge delta, on the still problem from z = 0 shortly before; `above its start`
is when rounding errors have grown past |delta(0)|."""
_STARTS = """## Convergence of the arm from random configurations

The path's start is held; the joints are displaced at random. Near: tip 5 to 20 mm and shaft 1 to 10 mm off.
Far: tip 50 to 100 mm and shaft 10 to 50 mm off. `converged` counts runs whose tip and RCM error stay below
1 mm before 3 s are over; runs that are stopped (a joint passed its velocity limit) are counted in `runs`
only, medians are over those that converge. A `rate` is ln(20) over the time from which the error stays
below 5 % of its start: 5 1/s for an exponential with k1 = k2 = 5 1/s. With perfect velocity tracking that
is what every resolver has; under torques the impedance law sets it. No resolver is the fastest in every
column: the three differ by less than the starts do."""
_UNKNOWN = """## What the paper does not say

Its curves are pictures without numbers, so that only its bounds of 5 mm and 15 mm can be compared."""
_CHOSEN = (
    ("gain of Nullspace", "1 rad²/s on grad(ln µ); 0 to 10 in the table of gains"),
    ("λ = 0.5 in Table I's RNN", "not defined anywhere in the paper; not used"),
    ("RCM rows of RNN", "Table I gives neither h3 nor k2: c0 of the tip rows, k2 = 5 1/s; without them too"),
    ("constants of RNN", "c3 = h0, c2 = h1, c0 = h2, c1 = h4, epsilon = 1/beta"),
    ("bounds of eq. (28)", "linear activation; 1 in the table of Theorem 1"),
    (
        "sinusoid, trocar, home, instrument",
        "`sinusoid_lwr4plus`; A = 1 cm and L = 25 cm are from another paper of the same group; 10 s",
    ),
    ("sampling time, integration", "1 ms; delta is stepped in closed form, exp(t) is held from t = 20 s on"),
    ("friction and payload of the real arm", "the ladder"),
)


def _theorem(_: Tables) -> str:
    rank, size = cross_form_rank(instant())
    return _THEOREM.format(rank=rank, size=size)


SECTIONS = (
    Section(_HANDS_ON, "hands_on", ("figure_03.png",), 3),
    Section(_COMPARISON, "comparison", tuple(f"figure_0{i}.png" for i in range(4, 9))),
    Section(_GAINS, "gains", ("gains.png",)),
    Section(_RESOLVERS, "resolvers"),
    Section(_LAWS, "laws", digits=3),
    Section(_LADDER, "ladder", ("ladder.png",)),
    Section(_LADDER_REAL, "ladder_real", ("ladder_real.png",)),
    Section(_NETWORKS, "network_rates", ("networks.png",)),
    Section(_theorem, "theorem_1"),
    Section(_EULER, "euler", ("euler.png",)),
    Section("The whole sinusoid with Table I at 1 kHz:", "euler_arm"),
    Section(_STARTS, "starts", ("starts.png",)),
    Section(_UNKNOWN, rows=tuple({"what": what, "here": here} for what, here in _CHOSEN)),
)
