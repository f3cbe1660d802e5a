"""What surgsim says beside the paper."""

from collections.abc import Callable, Sequence

from surgsim.studies.passive_teleoperation.claims import Tables, holds
from surgsim.studies.passive_teleoperation.stability import UNSTABLE
from surgsim.studies.passive_teleoperation.timing import QP_LIMIT_US
from surgsim.studies.study import Claim, Row
from surgsim.studies.vprnn.cells import number, numbers, pick, span

ACTIVE_J = 1e-3
RESIDUAL_PERCENT = 1.0
DRIFT_MM = 0.01
"""A difference of offsets that counts."""


def own_claims(tables: Tables) -> tuple[Claim, ...]:
    """Every claim for which there are rows."""
    makers: tuple[Callable[[Tables], list[Claim]], ...] = (_active, _contact, _drift, _ledger, _qp_time)
    return tuple(claim for make in makers for claim in make(tables))


def _active(tables: Tables) -> list[Claim]:
    """Whether the loop without passivity is active and unstable, for each grip."""
    claims = []
    for grip in ("normal", "light"):
        rows = pick(tables["pushes"], passivity="off", grip=grip)
        if not rows:
            continue
        active = [row for row in rows if number(row, "delivered_max_j") > ACTIVE_J]
        unstable = [row for row in rows if row["end"] in UNSTABLE]
        some = bool(active or unstable)
        every = len(unstable) == len(rows)
        claims.append(
            Claim(
                source="surgsim",
                text=f"without tank or controller the loop is active ({grip} grip)",
                verdict="holds" if every else "depends" if some else "does not hold",
                evidence=f"delivers more than 1 mJ in {len(active)} of {len(rows)} pushes, up to "
                f"{max(numbers(rows, 'delivered_max_j')):.3g} J; "
                f"unstable in {len(unstable)}{_where(unstable)}",
            )
        )
    return claims


def _where(rows: Sequence[Row]) -> str:
    if not rows:
        return ""
    found = sorted({(str(row["place"]), int(number(row, "delay_ms"))) for row in rows})
    return ": " + ", ".join(f"{place} {delay} ms" for place, delay in found)


def _contact(tables: Tables) -> list[Claim]:
    tank, tdpa = (pick(tables["pushes"], passivity=name, place="wall") for name in ("tank", "tdpa"))
    if not tank or not tdpa:
        return []
    rests = [len(pick(rows, end="rests")) for rows in (tank, tdpa)]
    better = rests[0] == len(tank) and not rests[1]
    return [
        Claim(
            source="surgsim",
            text="held on the wall, the contact rests with the tank, and not with the passivity controller",
            verdict="holds" if better else "depends" if rests[0] > rests[1] else "does not hold",
            evidence=f"rests in {rests[0]} of {len(tank)} pushes with the tank, in {rests[1]} of {len(tdpa)} "
            f"with tdpa; deviation of the force at most {max(numbers(tank, 'contact_deviation_n')):.3g} and "
            f"{max(numbers(tdpa, 'contact_deviation_n')):.3g} N",
        )
    ]


def _drift(tables: Tables) -> list[Claim]:
    rows = pick(tables["comparison"], place="free")
    pairs = [
        (str(row["grip"]), number(row, "drift_end_mm"), number(other[0], "drift_end_mm"))
        for row in pick(rows, passivity="tank")
        if (other := pick(rows, passivity="tdpa", grip=row["grip"]))  # type: ignore[arg-type]
    ]
    if not pairs:
        return []
    wins = [tdpa - tank > DRIFT_MM for _, tank, tdpa in pairs]
    return [
        Claim(
            source="surgsim",
            text="in free motion the tip drifts further from the master with the passivity controller",
            verdict="holds" if all(wins) else "depends" if any(wins) else "does not hold",
            evidence="offset at the end: "
            + "; ".join(f"{grip} grip: tank {tank:.3g} mm, tdpa {tdpa:.3g} mm" for grip, tank, tdpa in pairs)
            + f" (differences below {DRIFT_MM:g} mm do not count): the drift term pulls the tip back",
        )
    ]


def _ledger(tables: Tables) -> list[Claim]:
    rows = [row for row in tables["scenarios"] if row["energy_residual_percent"] is not None]
    if not rows:
        return []
    worst = max(numbers(rows, "energy_residual_percent"))
    parts = (f"{row['scenario']} {number(row, 'energy_residual_percent'):.2g} %" for row in rows)
    return [
        Claim(
            source="surgsim",
            text="the energy ledger of the whole system closes within 1 % of the energy exchanged",
            verdict=holds(worst <= RESIDUAL_PERCENT),
            evidence=", ".join(parts),
        )
    ]


def _qp_time(tables: Tables) -> list[Claim]:
    rows = tables.get("timing", ())
    if not rows:
        return []
    worst = max(numbers(rows, "qp_p99_us"))
    return [
        Claim(
            source="surgsim",
            text=f"the QP takes at most {QP_LIMIT_US:g} µs at the 99th percentile (on this machine)",
            verdict=holds(worst <= QP_LIMIT_US),
            evidence=f"median {span(numbers(rows, 'qp_p50_us'))} µs, 99th percentile "
            f"{span(numbers(rows, 'qp_p99_us'))} µs, one process alone; other load on the machine counts in",
        )
    ]
