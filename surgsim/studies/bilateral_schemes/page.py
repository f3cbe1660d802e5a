"""The page of the comparison of bilateral schemes: its figures, and what is written between them."""

from surgsim.studies.bilateral_schemes.cases import DELAYS_MS, GRIPS, LOSSES, SCHEMES
from surgsim.studies.bilateral_schemes.measures import qualified
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
    passive, rests = row["passive"] == row["seeds"], row["rests"] == row["seeds"]
    return "both" if passive and rests else "passive" if passive else "rests" if rests else "neither"


def _stability(axes: Axes, _: Results, tables: Tables) -> None:
    """A square for each scheme and delay; one panel for each grip and loss."""
    for line, grip in zip(axes, GRIPS, strict=True):
        for ax, loss in zip(line, LOSSES, strict=True):
            for row in pick(tables["map"], grip=grip, loss=loss):
                x, y = (
                    DELAYS_MS.index(round(number(row, "delay_ms"))),
                    list(SCHEMES).index(str(row["scheme"])),
                )
                ax.plot(x, y, "s", markersize=13, color=_COLOURS[_kind(row)])
            for kind, words in _WORDS.items():
                ax.plot([], [], "s", color=_COLOURS[kind], label=words)
            ax.set_xticks(range(len(DELAYS_MS)), [str(delay) for delay in DELAYS_MS])
            ax.set_yticks(range(len(SCHEMES)), list(SCHEMES))
            ax.set(title=f"{grip} grip, loss {100.0 * loss:g} %", xlabel="round trip (ms)")
    axes[0, 0].invert_yaxis()
    label(axes, legend=4)


def _transparency(axes: Axes, _: Results, tables: Tables) -> None:
    """Mismatch of the forces over the delay, of the places where a scheme is passive and rests."""
    for line, grip in zip(axes, GRIPS, strict=True):
        for ax, loss in zip(line, LOSSES, strict=True):
            good = [
                row
                for delay in DELAYS_MS
                for row in qualified(pick(tables["map"], grip=grip, loss=loss, delay_ms=delay))
            ]
            for k, scheme in enumerate(SCHEMES):
                rows = sorted(pick(good, scheme=scheme), key=lambda row: number(row, "delay_ms"))
                style = {"color": _LINES[k % len(_LINES)], "linestyle": "-" if k < len(_LINES) else "--"}
                x = [number(row, "delay_ms") for row in rows]
                ax.plot(x, [number(row, "mismatch") for row in rows], marker="o", label=scheme, **style)
            ax.set_yscale("symlog", linthresh=0.01)
            ax.set(title=f"{grip} grip, loss {100.0 * loss:g} %", xlabel="round trip (ms)")
    label(axes, ylabels=2 * ["mismatch of the forces"], legend=4)


_MAP = "Which scheme is passive and rests, over the round trip"
_LINES_TITLE = "Mismatch of the forces at hand and tip, over the round trip"
FIGURES = (
    Figure("stability.png", _MAP, _stability, (2, 2), (12.0, 11.0), (True, True)),
    Figure("transparency.png", _LINES_TITLE, _transparency, (2, 2), (12.0, 9.0), (True, True)),
)

INTRODUCTION = """\
Eleven bilateral schemes in one simulated teleoperation, after the manner of "{title}" ({reference}), which
compared schemes of its time on a pair of real arms; no figure of it is reproduced. A Panda pushes on a wall
of 20 kN/m through a trocar. The schemes are those of [docs/bilateral.md](../../docs/bilateral.md), with their
defaults. Everything here is made again by

    {command}

with {versions}. The CSV files hold every table with nine digits; `pushes.csv`, one row for every push, and
`map.csv`, one row for every scheme and place, are not shown."""
_WINNERS = """## Which scheme is best where

The hand moves aside, then to 15 mm below the wall's surface, and holds for 6 s and 4 round trips. A light
grip is 20 N/m and 1 N s/m, a normal one 135 N/m and 6.45 N s/m. A scheme qualifies at a place if it is
passive (never more than 1 mJ beyond what it had stored), rests at the end (handle below 5 mm/s RMS, the
contact's force steady) and presses with more than 0.1 N, with every one of three seeds. Best is the one with
the smallest `mismatch`: how far the force on the hand, in the scale of the tip, is from that on the tip, over
the latter; with its 95 % interval. `not told apart` are those whose interval reaches into that of the best.

A scheme that is called best is so by this measure alone: the passive convex control presses far harder than
its hand feels, since it has no force between hand and tip, and is never best by it."""
_MAPS = """## Where it is passive and at rest

By the worst of the seeds. Without loss a seed draws the tremor and the scatter of the hand alone."""
_LINES_TEXT = """## Transparency against delay

Where a scheme qualifies."""

SECTIONS = (
    Section(_WINNERS, "winners"),
    Section(_MAPS, figures=("stability.png",)),
    Section(_LINES_TEXT, figures=("transparency.png",)),
)
