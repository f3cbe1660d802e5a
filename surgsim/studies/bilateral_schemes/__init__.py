"""Bilateral schemes compared: which is passive, at rest and transparent at which delay."""

from collections.abc import Sequence

from surgsim.display import count
from surgsim.studies.bilateral_schemes import page
from surgsim.studies.bilateral_schemes.cases import (
    DELAYS_MS,
    MADE_PASSIVE,
    PAPER,
    SCHEMES,
    Push,
    pushes,
    renders,
)
from surgsim.studies.bilateral_schemes.measures import (
    best_table,
    is_at_rest,
    is_good,
    map_table,
    qualified,
    rendered_table,
    schemes_table,
    winners_table,
    worst_excess,
    z_width_table,
)
from surgsim.studies.study import Claim, Groups, Judged, Results, Study, holds
from surgsim.studies.tables import Row, Tables, groups, pick
from surgsim.teleop.judgement import PASSIVE_J

_PASSIVE_MJ = 1e3 * PASSIVE_J


def cases_of(quick: bool) -> Groups:
    """Every push, or a few short ones."""
    if not quick:
        return {"pushes": pushes(), "renders": renders()}
    return {
        "pushes": [
            Push(scheme=scheme, grip="normal", delay_ms=100, loss=0.0, cut_s=4.0)
            for scheme in ("passive convex, tank", "P+d", "waves")
        ]
    }


def _listed(excesses: dict[str, float]) -> str:
    return ", ".join(f"{scheme} {most:.3g} mJ" for scheme, most in excesses.items()) or "none"


def _ours(tables: Tables) -> Judged:
    found = worst_excess(tables["map"], SCHEME_OURS)
    rows = pick(tables["map"], scheme=SCHEME_OURS)
    moving = [row for row in rows if not is_at_rest(row)]
    return holds(found <= _PASSIVE_MJ), (
        f"at most {found:.3g} mJ beyond its stock in {count(len(rows), 'place')}; "
        f"not at rest in {len(moving)}{_where(moving)}"
    )


def _where(rows: Sequence[Row]) -> str:
    """How rows are spread over what is pushed on, by which hand."""
    found = groups(rows, "surroundings", "grip")
    parts = (f"{len(those)} on the {place} in a {grip} grip" for (place, grip), those in found.items())
    return f" ({', '.join(parts)})" if rows else ""


def _others(tables: Tables) -> Judged | None:
    known = {str(row["scheme"]) for row in tables["map"]}
    most = {name: worst_excess(tables["map"], name) for name in MADE_PASSIVE if name in known - {SCHEME_OURS}}
    active = {name: found for name, found in most.items() if found > _PASSIVE_MJ}
    return "holds" if not active else "depends" if len(active) < len(most) else "does not hold", (
        f"{len(most) - len(active)} of {len(most)} never give more than 1 mJ beyond their stock; "
        f"more: {_listed(active)}"
    )


def _without(tables: Tables) -> Judged | None:
    known = {str(row["scheme"]) for row in tables["map"]}
    names = [name for name in SCHEMES if name in known and name not in MADE_PASSIVE]
    if not names:
        return None
    bad = {name: [row for row in pick(tables["map"], scheme=name) if not is_good(row)] for name in names}
    told = "; ".join(f"{name} in {count(len(rows), 'place')}" for name, rows in bad.items())
    every = all(bad.values())
    return "holds" if every else "depends" if any(bad.values()) else "does not hold", (
        f"active or not at rest: {told}"
    )


def _everywhere(tables: Tables) -> Judged:
    names = [name for name in SCHEMES if pick(tables["map"], scheme=name)]
    rows = {name: pick(tables["map"], scheme=name) for name in names}
    whole = [name for name in names if len(qualified(rows[name])) == len(rows[name])]
    return (
        "holds" if whole else "does not hold",
        f"passive, at rest and pressing at every place: {', '.join(whole) or 'none'}",
    )


def _map(results: Results) -> list[Row]:
    return map_table(results.rows("pushes"))


def _winners(results: Results) -> list[Row]:
    return winners_table(_map(results))


def _z_width(results: Results) -> list[Row]:
    return z_width_table(results.rows("renders"))


SCHEME_OURS = "passive convex, tank"
STUDY = Study(
    name="bilateral_schemes",
    heading="Bilateral schemes over delay, loss and jitter",
    introduction=page.INTRODUCTION,
    quick_note="three schemes, short pushes through 100 ms, without figures",
    paper=PAPER,
    cases=cases_of,
    tables={
        "pushes": lambda results: results.rows("pushes"),
        "map": _map,
        "winners": _winners,
        "schemes": lambda results: schemes_table(_map(results), _winners(results)),
        "renders": lambda results: results.rows("renders"),
        "z_width": _z_width,
        "rendered": lambda results: rendered_table(_z_width(results)),
        "best": lambda results: best_table(_winners(results)),
    },
    claims=[
        Claim("surgsim", "ours, with tanks and valve, gives no energy beyond its stock anywhere", _ours),
        Claim("surgsim", "the other schemes that are to be passive are", _others),
        Claim("surgsim", "a scheme with nothing to keep it passive fails somewhere", _without),
        Claim(
            "surgsim",
            f"some scheme is passive, rests and presses everywhere, from 0 to {DELAYS_MS[-1]} ms",
            _everywhere,
        ),
    ],
    sections=page.SECTIONS,
    figures=page.FIGURES,
)
