"""What can be checked of a bundle without a run: hashes, protocol, cells, scenarios, code, scorecard."""

import hashlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from surgsim.compare.job import REFUSED
from surgsim.errors import SurgsimError
from surgsim.protocol.bundle import CODE, Bundle
from surgsim.protocol.canonical import sha256_of
from surgsim.protocol.cells import BASE, Cell, cells
from surgsim.protocol.definition import Protocol
from surgsim.protocol.entrants import Entrant, check_entry
from surgsim.protocol.findings import Finding, differences, short
from surgsim.protocol.freeze import check_frozen, frozen_sha256
from surgsim.protocol.rows import Row, rows_sha256
from surgsim.protocol.runs import key_of
from surgsim.protocol.score import ROWS, SCHEMA_VERSION, SCORE
from surgsim.protocol.scorecard import scorecard
from surgsim.protocol.seeds import seeds_of
from surgsim.runs.provenance import code_sha256
from surgsim.runs.sources import hash_of_hashes
from surgsim.scenario.load import load_controller
from surgsim.verdict import ALWAYS


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What the protocol asks of the bundle's controller.

    Attributes:
        entrant: The controller.
        cells: Its cells by id.
    """

    entrant: Entrant
    cells: Mapping[str, Cell]


def check_files(bundle: Bundle) -> Iterator[Finding]:
    """Every file is the one that `bundle.json` tells of, and the hashes inside of `score.json` hold."""
    score = bundle.score
    for name, content in sorted(bundle.files.items()):
        told, found = bundle.told.files.get(name), hashlib.sha256(content).hexdigest()
        if name == "bundle.json":
            continue
        if told is None or told.sha256 != found or told.bytes != len(content):
            yield _hashed(f"file {name}", "SHA-256", told.sha256 if told else None, found)
    for name in sorted(bundle.told.files.keys() - bundle.files.keys()):
        yield Finding(where=f"file {name}", what="content", bundle="told of", here="missing")
    inside = (
        ("rows_sha256", score.rows_sha256, rows_sha256(bundle.files[ROWS].decode())),
        ("scorecard_sha256", score.scorecard_sha256, sha256_of(score.scorecard)),
        (
            "controller.definition_sha256",
            score.controller.definition_sha256,
            sha256_of(score.controller.definition),
        ),
        (
            "environment.sources_sha256",
            score.environment.sources_sha256,
            hash_of_hashes(bundle.code.files),
        ),
    )
    for name, told_sha256, found in inside:
        if told_sha256 != found:
            yield _hashed(f"file {SCORE}", name, told_sha256, found)
    if score.schema_version != SCHEMA_VERSION:
        yield Finding(
            where=f"file {SCORE}",
            what="schema_version",
            bundle=str(score.schema_version),
            here=str(SCHEMA_VERSION),
        )


def check_protocol(bundle: Bundle, protocol: Protocol) -> Iterator[Finding]:
    """The protocol is the one that is frozen here and unchanged since, and its rounds gave the seeds."""
    score = bundle.score
    if score.protocol != protocol.name:
        yield Finding(where="protocol", what="name", bundle=score.protocol, here=protocol.name)
        return
    if score.track not in protocol.config.tracks:
        known = ", ".join(protocol.config.tracks)
        yield Finding(where="track", what="name", bundle=f"'{score.track[:60]}'", here=known)
        return
    in_order = [arm for arm in protocol.config.arms if arm in score.arms]
    if score.arms != in_order or not in_order:
        allowed = ", ".join(protocol.config.arms)
        yield Finding(where="arms", what="names", bundle=", ".join(score.arms)[:80], here=allowed)
        return
    try:
        frozen = check_frozen(protocol, score.track, score.arms)
    except SurgsimError as error:
        yield Finding(where="protocol", what=protocol.name, bundle="frozen", here=str(error))
        frozen = frozen_sha256(protocol)
    if score.protocol_sha256 != frozen:
        yield _hashed("protocol", protocol.name, score.protocol_sha256, frozen)
    try:
        told = seeds_of(protocol, score.seeds.round or score.seeds.kind).told()
    except SurgsimError as error:
        yield Finding(where="seeds", what=score.seeds.round or "kind", bundle="used", here=str(error))
    else:
        yield from differences("seeds", score.seeds.model_dump(), told)


def asked_of(bundle: Bundle, protocol: Protocol) -> Asked | Finding:
    """What the protocol asks of the controller; a finding if that is none that may enter here."""
    score = bundle.score
    try:
        definition = dict(score.controller.definition)
        scheme = str(definition.pop("scheme", ""))
        config = load_controller(definition)
        entrant = Entrant(
            config=config,
            tuning=score.tuning,
            weights=score.controller.weights,
            label=score.controller.name,
            scheme=scheme,
        )
        if entrant.definition_sha256 != score.controller.definition_sha256:
            return _hashed(
                "controller",
                "definition",
                score.controller.definition_sha256,
                entrant.definition_sha256,
            )
        check_entry(score.track, protocol.track(score.track), config)
        seeds = seeds_of(protocol, score.seeds.round or score.seeds.kind)
        found = cells(protocol, score.track, score.arms, seeds, config, scheme)
    except SurgsimError as error:
        told = " ".join(str(error).split())
        return Finding(where="controller", what=score.controller.name[:60], bundle="scored", here=told)
    return Asked(entrant=entrant, cells={cell.id: cell for cell in found})


def check_rows(bundle: Bundle, asked: Asked, protocol: Protocol) -> Iterator[Finding]:
    """The rows are those of the protocol's cells, one of each, in order, with its scenarios and metrics."""
    counts = Counter(row.cell for row in bundle.rows)
    for cell in sorted(asked.cells.keys() - counts.keys()):
        yield Finding(where=f"cell {cell}", what="row", bundle="none", here="one that the protocol asks for")
    for cell in sorted(counts.keys() - asked.cells.keys()):
        yield Finding(where=f"cell {cell[:80]}", what="row", bundle="one", here="none that is asked for")
    for cell, count in sorted(counts.items()):
        if count > 1:
            yield Finding(where=f"cell {cell[:80]}", what="rows", bundle=str(count), here="1")
    ordered = sorted(row.cell for row in bundle.rows)
    if ordered != [row.cell for row in bundle.rows]:
        yield Finding(where=f"file {ROWS}", what="order", bundle="another", here="by cell")
    for row in bundle.rows:
        if row.cell in asked.cells:
            yield from _check_row(row, asked.cells[row.cell], protocol)


def _check_row(row: Row, cell: Cell, protocol: Protocol) -> Iterator[Finding]:
    where = f"cell {row.cell}"
    wanted = {
        "generator": cell.generator,
        "arm": cell.arm,
        "axis": cell.axis or BASE,
        "level": cell.level,
        "seed": cell.seed,
        "scenario_sha256": cell.scenario.sha256() if cell.scenario is not None else None,
    }
    yield from differences(where, {name: getattr(row, name) for name in wanted}, wanted)
    for name in sorted(row.metrics.keys() ^ set(protocol.config.metrics)):
        here, there = ("none", "there") if name in row.metrics else ("asked for", "none")
        yield Finding(where=where, what=f"metric {name[:60]}", bundle=there, here=here)
    if cell.scenario is None and (row.outcome != REFUSED or row.run_key is not None):
        yield Finding(where=where, what="outcome", bundle=row.outcome, here=f"{REFUSED}: {cell.refusal}")
    yield from _check_thresholds(row, protocol)


def _check_thresholds(row: Row, protocol: Protocol) -> Iterator[Finding]:
    """What a row says that it exceeded is past its threshold, and none that always holds is left out."""
    thresholds = protocol.config.thresholds
    for name in sorted({*row.exceeded, *ALWAYS}):
        threshold, value = getattr(thresholds, name, None), row.metrics.get(name)
        past = threshold is not None and value is not None and not value <= threshold.most
        if name in row.metrics and past != (name in row.exceeded) and row.completed:
            told = "exceeded" if name in row.exceeded else "not exceeded"
            limit = f"{value} of {threshold.most:g}" if threshold is not None else f"{value}, no threshold"
            yield Finding(where=f"cell {row.cell}", what=name, bundle=told, here=limit)


def check_keys(bundle: Bundle) -> Iterator[Finding]:
    """Every run's key is that of its scenario and of the code and packages that the bundle tells of."""
    score = bundle.score
    told = {
        "sources_sha256": hash_of_hashes(bundle.code.files),
        "packages": score.environment.packages,
        "plugins": score.controller.plugins,
        "policies": score.controller.policies,
        "externals": score.controller.externals,
    }
    code = code_sha256(told)
    for row in bundle.rows:
        if row.scenario_sha256 is None:
            continue
        wanted = key_of(row.scenario_sha256, code, bundle.code.compilers)
        if row.run_key != wanted:
            yield Finding(
                where=f"cell {row.cell[:80]}",
                what="run_key",
                bundle=short(row.run_key),
                here=f"{short(wanted)} by its scenario, {CODE} and environment",
            )


def check_scorecard(bundle: Bundle, protocol: Protocol, rows: Sequence[Row]) -> Iterator[Finding]:
    """The scorecard is what the rows come to."""
    score = bundle.score
    card = scorecard(
        rows,
        protocol,
        protocol_sha256=score.protocol_sha256,
        track=score.track,
        arms=score.arms,
        seeds=score.seeds.model_dump(),
        definition_sha256=score.controller.definition_sha256,
        tuning=score.tuning,
    )
    if sha256_of(card) == sha256_of(score.scorecard):
        return
    for name in ("figures", "failures"):
        told = score.scorecard.get(name)
        if isinstance(told, dict) and told != card[name]:
            yield from differences("scorecard", told, card[name])
    rest = [
        name for name in card.keys() | score.scorecard.keys() if name not in ("figures", "failures", "axes")
    ]
    yield from differences(
        "scorecard", {n: score.scorecard.get(n) for n in rest}, {n: card.get(n) for n in rest}
    )
    if sha256_of(score.scorecard.get("axes")) != sha256_of(card["axes"]):
        yield _hashed("scorecard", "axes", sha256_of(score.scorecard.get("axes")), sha256_of(card["axes"]))


def _hashed(where: str, what: str, told: str | None, found: str) -> Finding:
    return Finding(where=where, what=what, bundle=short(told), here=short(found))
