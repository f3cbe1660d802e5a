"""The paper's claims, each beside our figures."""

from collections.abc import Callable, Mapping, Sequence

from surgsim.studies.passive_teleoperation.paper import PAPER_RCM_MM, PAPER_VELOCITY_MM_PER_S
from surgsim.studies.passive_teleoperation.stability import UNSTABLE
from surgsim.studies.study import Claim, Row, Verdict
from surgsim.studies.vprnn.cells import number, numbers, pick, span

Tables = Mapping[str, Sequence[Row]]

SUB_MILLIMETRE_MM = 1.0
OVERSHOOT_MM = 0.1
SPEED_MARGIN = 1.02
"""Of the tip's measured speed over its limit."""
ENERGY_TOLERANCE_J = 1e-6


def paper_claims(tables: Tables) -> tuple[Claim, ...]:
    """Every claim for which there are rows, in the paper's order."""
    makers: tuple[Callable[[Tables], list[Claim]], ...] = (
        _rcm,
        _velocity,
        _planes,
        _speed_limit,
        _tanks,
        _rings,
        _any_delay,
        _energy_row,
    )
    return tuple(claim for make in makers for claim in make(tables))


def holds(condition: bool) -> Verdict:
    """The verdict of a yes-or-no claim."""
    return "holds" if condition else "does not hold"


def _each(rows: Sequence[Row], column: str, unit: str) -> str:
    return ", ".join(f"{row['scenario']} {number(row, column):.3g}{unit}" for row in rows)


def _rcm(tables: Tables) -> list[Claim]:
    rows = tables["scenarios"]
    ours, largest = max(numbers(rows, "rcm_rms_mm")), max(numbers(rows, "rcm_max_mm"))
    return [
        Claim(
            source="paper, section 3.1",
            text=f"the RCM error's RMSE is about {PAPER_RCM_MM:g} mm",
            verdict=holds(ours <= PAPER_RCM_MM),
            evidence=f"at most that here: {_each(rows, 'rcm_rms_mm', ' mm')}. The paper's arm is a real one, "
            "with friction and model error; ours knows its model, so this does not mean a better law",
        ),
        Claim(
            source="paper, section 3.1",
            text="the RCM is kept with sub-millimetre accuracy",
            verdict=holds(largest < SUB_MILLIMETRE_MM),
            evidence=f"largest error: {_each(rows, 'rcm_max_mm', ' mm')}",
        ),
    ]


def _velocity(tables: Tables) -> list[Claim]:
    rows = pick(tables["scenarios"], scenario="free motion")
    if not rows:
        return []
    aligned = number(rows[0], "velocity_aligned_mm_per_s")
    unaligned = number(rows[0], "velocity_unaligned_mm_per_s")
    text = f"the tip follows the operator's velocity with an RMSE of about {PAPER_VELOCITY_MM_PER_S:g} mm/s"
    return [
        Claim(
            source="paper, section 3.1",
            text=f"{text} (aligned: against the command that has arrived)",
            verdict=holds(aligned <= PAPER_VELOCITY_MM_PER_S),
            evidence=f"{aligned:.3g} mm/s in free motion while no constraint acts. The paper does not say "
            "whether its figure is aligned",
        ),
        Claim(
            source="paper, section 3.1",
            text=f"{text} (not aligned: against what the master does now)",
            verdict="holds" if unaligned <= PAPER_VELOCITY_MM_PER_S else "not comparable",
            evidence=f"{unaligned:.3g} mm/s: the delay times the hand's acceleration, whatever the arm does; "
            "the paper publishes neither its alignment nor how fast its operator moved",
        ),
    ]


def _planes(tables: Tables) -> list[Claim]:
    rows = [row for row in tables["scenarios"] if number(row, "planes_percent") > 0.0]
    if not rows:
        return []
    row = rows[0]
    over, slack = number(row, "plane_overshoot_mm"), number(row, "slack_max_mm_per_s")
    inside = over <= OVERSHOOT_MM and slack > number(row, "slack_free_max_mm_per_s")
    steady = row["outcome"] == "completed" and number(row, "rcm_max_mm") <= PAPER_RCM_MM
    return [
        Claim(
            source="paper, section 3.2",
            text="past a limit of the workspace the slack takes over; motion and RCM stay stable",
            verdict=holds(inside and steady),
            evidence=f"a plane acts in {number(row, 'planes_percent'):.0f} % of the ticks and begins to "
            f"act {number(row, 'plane_contacts'):g} times; tip at most {over:.3g} mm past it, slack up to "
            f"{slack:.3g} mm/s, RCM error at most {number(row, 'rcm_max_mm'):.2g} mm; {row['outcome']}",
        )
    ]


def _speed_limit(tables: Tables) -> list[Claim]:
    rows = [row for row in tables["scenarios"] if number(row, "speed_limit_percent") > 0.0]
    if not rows:
        return []
    row = rows[0]
    limit, fastest = number(row, "tip_speed_limit_mm_per_s"), number(row, "tip_speed_max_mm_per_s")
    return [
        Claim(
            source="paper, section 3.2",
            text="past the velocity limit the slack takes over",
            verdict=holds(fastest <= SPEED_MARGIN * limit and row["outcome"] == "completed"),
            evidence=f"the command is above the limit of {limit:.3g} mm/s in "
            f"{number(row, 'speed_limit_percent'):.0f} % of the ticks; the tip moves at most "
            f"{fastest:.4g} mm/s along an axis",
        )
    ]


def _tanks(tables: Tables) -> list[Claim]:
    rows, pushes = tables["scenarios"], pick(tables["pushes"], passivity="tank")
    lowest = min(numbers(rows, "tank_min_j"))
    pushed = numbers(pushes, "tank_min_j")
    deficit = max(numbers(rows, "deficit_j"))
    positive = min([lowest, *pushed]) > 0.0 and deficit <= ENERGY_TOLERANCE_J
    low = f", {min(pushed):.3g} J over {len(pushed)} pushes" if pushed else ""
    return [
        Claim(
            source="paper, section 3.2",
            text="the energy tanks stay positive throughout",
            verdict=holds(positive),
            evidence=f"lowest level: {_each(rows, 'tank_min_j', ' J')}{low}; taken from an empty tank: "
            f"{deficit:.3g} J; the floor is 0.01 J",
        )
    ]


def _rings(tables: Tables) -> list[Claim]:
    rows = pick(tables["scenarios"], scenario="peg and ring")
    if not rows:
        return []
    moved, drops = number(rows[0], "rings_transferred"), number(rows[0], "ring_drops")
    return [
        Claim(
            source="paper, section 3",
            text="peg and ring can be done through a round trip of 300 ms",
            verdict=holds(moved == 3.0 and rows[0]["outcome"] == "completed"),
            evidence=f"{moved:g} of 3 rings in {number(rows[0], 'duration_s'):.0f} s with {drops:g} drops, "
            "by a simulated operator, one seed; the paper gives no rate of success",
        )
    ]


def _any_delay(tables: Tables) -> list[Claim]:
    rows = pick(tables["pushes"], passivity="tank")
    if not rows:
        return []
    unstable = [row for row in rows if row["end"] in UNSTABLE]
    beyond = max(numbers(rows, "beyond_stock_j"))
    delays = span(numbers(rows, "delay_ms"), 4)
    cells = "; ".join(_cell(row) for row in unstable) or "none"
    verdict: Verdict = holds(beyond <= ENERGY_TOLERANCE_J and not unstable)
    if unstable and len(unstable) < len(rows) and beyond <= ENERGY_TOLERANCE_J:
        verdict = "depends"
    return [
        Claim(
            source="paper, key insights",
            text="passive and stable at any delay",
            verdict=verdict,
            evidence=f"{len(rows)} pushes at {delays} ms: never more energy delivered than the tanks held "
            f"at first: {'yes' if beyond <= ENERGY_TOLERANCE_J else 'no'} (at most {beyond:.3g} J beyond). "
            f"Unstable in {len(unstable)}: {cells}",
        )
    ]


def _energy_row(tables: Tables) -> list[Claim]:
    rows = [*pick(tables["pushes"], passivity="tank"), *tables["scenarios"]]
    acts = [row for row in rows if number(row, "passivity_percent") > 0.0]
    scaled = [row for row in rows if number(row, "force_scaled_percent") > 0.0]
    return [
        Claim(
            source="paper, key insights",
            text="the energy row in the QP is what keeps the loop passive",
            verdict="depends" if acts else "does not hold",
            evidence=f"it limits the tip in {len(acts)} of {len(rows)} runs with tanks; the operator's tank "
            f"limits the force on the handle in {len(scaled)}, and its refill damps the handle before that",
        )
    ]


def _cell(row: Row) -> str:
    return f"{row['place']}, {row['grip']} grip, {row['link']}, {number(row, 'delay_ms'):g} ms ({row['end']})"
