"""The page of the comparison of bilateral schemes: its figures, and what is written between them."""

from itertools import product
from typing import Any

from surgsim.studies.bilateral_schemes.cases import DELAYS_MS, GRIPS, NETWORKS, SCHEMES, SURROUNDINGS
from surgsim.studies.bilateral_schemes.measures import is_at_rest, is_passive, qualified
from surgsim.studies.figure import BLACK, BLUE, GREEN, ORANGE, PURPLE, VERMILLION, Axes, label
from surgsim.studies.study import Figure, Results, Section
from surgsim.studies.tables import Row, Tables, number, pick

_COLOURS = {"both": GREEN, "passive": BLUE, "rests": ORANGE, "neither": VERMILLION}
_WORDS = {
    "both": "passive and at rest",
    "passive": "passive, not at rest",
    "rests": "at rest, not passive",
    "neither": "neither",
}
_LINES = (BLACK, BLUE, GREEN, ORANGE, PURPLE, VERMILLION)


def _kind(row: Row) -> str:
    """What a place of the map is, by its worst seed."""
    passive, rests = is_passive(row), is_at_rest(row)
    return "both" if passive and rests else "passive" if passive else "rests" if rests else "neither"


def _network(loss: float, jitter_ms: int) -> str:
    return f"loss {100.0 * loss:g} %" + (f",\njitter {jitter_ms} ms" if jitter_ms else "")


def _panels(axes: Axes) -> list[tuple[Any, str, str]]:
    """The axes with what is pushed on and the grip: a row and a column for each."""
    return [
        (axes[i, k], place, grip)
        for (i, place), (k, grip) in product(enumerate(SURROUNDINGS), enumerate(GRIPS))
    ]


def _stability(axes: Axes, _: Results, tables: Tables) -> None:
    """A square for each scheme, network and delay; one panel for each surroundings and grip."""
    names, wide = list(SCHEMES), len(DELAYS_MS) + 1
    for ax, place, grip in _panels(axes):
        for k, (loss, jitter) in enumerate(NETWORKS):
            for row in pick(tables["map"], surroundings=place, grip=grip, loss=loss, jitter_ms=jitter):
                x = k * wide + DELAYS_MS.index(round(number(row, "delay_ms")))
                ax.plot(x, names.index(str(row["scheme"])), "s", markersize=8, color=_COLOURS[_kind(row)])
            ax.text(k * wide + 2, -1.0, _network(loss, jitter), ha="center", va="bottom", fontsize=9)
        for kind, words in _WORDS.items():
            ax.plot([], [], "s", color=_COLOURS[kind], label=words)
        ticks = [k * wide + i for k in range(len(NETWORKS)) for i in range(len(DELAYS_MS))]
        ax.set_xticks(ticks, [str(delay) for _ in NETWORKS for delay in DELAYS_MS], rotation=90)
        ax.set_yticks(range(len(names)), names)
        ax.set_ylim(len(names) - 0.4, -2.6)
        ax.set(title=f"{place}, {grip} grip", xlabel="round trip (ms)")
    label(axes, legend=4)


_SHOWN = (NETWORKS[0], NETWORKS[-1])


def _transparency(axes: Axes, _: Results, tables: Tables) -> None:
    """Mismatch of the forces over the delay, in a normal grip, where a scheme is passive and rests."""
    for (line, place), (k, (loss, jitter)) in product(
        zip(axes, SURROUNDINGS, strict=True), enumerate(_SHOWN)
    ):
        ax = line[k]
        there = pick(tables["map"], surroundings=place, grip="normal", loss=loss, jitter_ms=jitter)
        good = [row for delay in DELAYS_MS for row in qualified(pick(there, delay_ms=delay))]
        for n, scheme in enumerate(SCHEMES):
            rows = sorted(pick(good, scheme=scheme), key=lambda row: number(row, "delay_ms"))
            style = {"color": _LINES[n % len(_LINES)], "linestyle": "-" if n < len(_LINES) else "--"}
            x = [number(row, "delay_ms") for row in rows]
            ax.plot(x, [number(row, "mismatch") for row in rows], marker="o", label=scheme, **style)
        ax.set_yscale("symlog", linthresh=0.01)
        network = _network(loss, jitter).replace("\n", " ")
        ax.set(title=f"{place}, {network}", xlabel="round trip (ms)")
    label(axes, ylabels=2 * ["mismatch of the forces"], legend=4)


def _z_width(axes: Axes, _: Results, tables: Tables) -> None:
    """What the hand feels of free motion and of the wall, over the delay, where a scheme is passive."""
    for n, scheme in enumerate(SCHEMES):
        rows = [
            row
            for row in pick(tables["z_width"], scheme=scheme)
            if is_passive(row) and row["wall_stiffness_n_per_m"] is not None
        ]
        style = {"color": _LINES[n % len(_LINES)], "linestyle": "-" if n < len(_LINES) else "--"}
        x = [number(row, "delay_ms") for row in rows]
        for ax, column in zip(axes[0], ("free_impedance_ns_per_m", "wall_stiffness_n_per_m"), strict=True):
            ax.plot(x, [number(row, column) for row in rows], marker="o", label=scheme, **style)
    axes[0, 0].set_yscale("symlog", linthresh=1.0)
    axes[0, 0].set(title="free motion", xlabel="round trip (ms)", ylabel="impedance felt (N s/m)")
    axes[0, 1].set(title="wall of 20 kN/m", xlabel="round trip (ms)", ylabel="stiffness felt (N/m)")
    label(axes, legend=4)


_MAP = "Which scheme is passive and rests, over network and round trip"
_LINES_TITLE = "Mismatch of the forces at hand and tip, over the round trip, normal grip"
_Z_TITLE = "What the hand feels of free motion and of a wall, where the scheme is passive in both"
FIGURES = (
    Figure("stability.png", _MAP, _stability, (2, 2), (17.0, 11.0), (True, True)),
    Figure("transparency.png", _LINES_TITLE, _transparency, (2, 2), (12.0, 9.0), (True, True)),
    Figure("z_width.png", _Z_TITLE, _z_width, (1, 2), (12.0, 5.5)),
)

INTRODUCTION = """\
Eleven bilateral schemes in one simulated teleoperation, after the manner of "{title}" ({reference}), which
compared schemes of its time on a pair of real arms; no figure of it is reproduced. A Panda pushes through a
trocar on a wall of 20 kN/m, or on soft tissue of 200 N/m. The schemes are those of
[docs/bilateral.md](../../docs/bilateral.md), with their defaults. Everything here is made again by

    {command}

with {versions}. The CSV files hold every table with nine digits. Not shown are `pushes.csv` and
`renders.csv`, one row for every run, `map.csv`, one for every scheme and place, and `winners.csv`, one for
every place."""
_SCHEMES = """## How often each scheme is good

A place is what is pushed on, by which grip, through what round trip, loss and jitter. The hand moves aside,
waits until it must have seen that, moves to 15 mm below the surface, and holds: 6 s and 4 round trips in all.
A light grip is 20 N/m and 1 N s/m, a normal one 135 N/m and 6.45 N s/m. Jitter is the standard deviation of
the delay each way, which is never shorter than half the round trip; packets may overtake each other.

A scheme is passive where it never gives more than 1 mJ beyond what it had stored. It rests where the handle
ends below 5 mm/s (RMS) and the contact's force is steady. It qualifies where it does both with every one of
three seeds, and presses with more than 0.1 N."""
_BEST = """## Which scheme is best where

Best is the one with the smallest `mismatch` of those that qualify and press with at least half the median
force: how far the force on the hand, in the scale of the tip, is from that on the tip, over the latter. `+2`
says that two others are not told from it: their 95 % intervals reach into its own, or their mismatch is less
than 0.05 larger. `winners.csv` has names and intervals.

A scheme that is called best is so by this measure alone, at rest. The passive convex control presses far
harder than its hand feels, since it has no force between hand and tip, and is never best by it."""
_MAPS = """## Where it is passive and at rest

By the worst of the seeds. Without loss and jitter a seed draws tremor and scatter of the hand alone."""
_LINES_TEXT = """## Transparency against delay

Where a scheme qualifies, through a clean line and through the worst one."""

_Z_WIDTH = """## Z-width

The range of impedances that a scheme renders passively (Colgate, Brown, IEEE ICRA, 1994): from what the
hand feels in free motion, which should be nothing, to what it feels of a wall, which should be stiff. The
hand goes to 5 mm and then to 20 mm below a surface, in a normal grip through a clean line, and holds at both.
First the impedance in free motion: force of the console's motors over the handle's speed, by RMS, in N s/m.
Then the stiffness of the wall: the change of that force over the handle's way between both holds, in N/m; `-`
where the tip does not touch, or not everything rests, at both. `!`: not passive with every seed, in this
motion and by this hand. Every coupling has 240 N/m at the tip here, 60 N/m in the scale of the handle; the
wall itself would be 5,000 N/m there. `z_width.csv` has all figures."""

SECTIONS = (
    Section(_SCHEMES, "schemes"),
    Section(_BEST, "best"),
    Section(_MAPS, figures=("stability.png",)),
    Section(_LINES_TEXT, figures=("transparency.png",)),
    Section(_Z_WIDTH, "rendered", figures=("z_width.png",)),
)
