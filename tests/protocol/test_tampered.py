"""Tampered bundles: each is caught, and what was done to it is named."""

import hashlib
import json
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any

import laboratory as lab
import pytest

from surgsim.protocol.bundle import CODE, bundle_of, with_told
from surgsim.protocol.canonical import canonical, sha256_of
from surgsim.protocol.cells import cells
from surgsim.protocol.rows import Row
from surgsim.protocol.runs import key_of
from surgsim.protocol.score import ROWS, SCORE, TIMING
from surgsim.protocol.scorecard import scorecard
from surgsim.protocol.seeds import seeds_of
from surgsim.protocol.verify import Effort, verify
from surgsim.runs.provenance import code_sha256
from surgsim.runs.sources import hash_of_hashes
from surgsim.scenario.load import load_controller, load_scenario

BASE = "loads/lwr4plus/base/0"
ALL = Effort(fraction=1.0, sample=0, runner=lab.here)


@dataclass
class Forgery:
    """A bundle in the forger's hands, as plain data, and how to make its hashes anew."""

    score: dict[str, Any]
    rows: list[dict[str, Any]]
    code: dict[str, Any]
    timing: dict[str, Any]
    protocol: Any
    raw: dict[str, bytes] = field(default_factory=dict)

    @property
    def row(self) -> dict[str, Any]:
        return next(row for row in self.rows if row["cell"] == BASE)

    def seal_keys(self) -> None:
        """Keys of all runs, of the code that the bundle now tells of."""
        self.score["environment"]["sources_sha256"] = hash_of_hashes(self.code["files"])
        told = {**self.score["environment"], **self.score["controller"]}
        code = code_sha256(told)
        for row in self.rows:
            row["run_key"] = key_of(row["scenario_sha256"], code, self.code["compilers"])

    def seal_rows(self) -> None:
        """Hash of the rows."""
        self.score["rows_sha256"] = hashlib.sha256(self._rows()).hexdigest()

    def seal_card(self) -> None:
        """The scorecard that the rows now come to, and its hash."""
        controller = self.score["controller"]
        controller["definition_sha256"] = sha256_of(controller["definition"])
        self.score["scorecard"] = scorecard(
            [Row(**{**row, "exceeded": tuple(row["exceeded"])}) for row in self.rows],
            self.protocol,
            protocol_sha256=self.score["protocol_sha256"],
            track=self.score["track"],
            arms=self.score["arms"],
            seeds=self.score["seeds"],
            definition_sha256=controller["definition_sha256"],
            tuning=self.score["tuning"],
        )
        self.score["scorecard_sha256"] = sha256_of(self.score["scorecard"])

    def seal(self) -> None:
        """Every hash that follows from the rows."""
        self.seal_rows()
        self.seal_card()

    def files(self) -> dict[str, bytes]:
        """The bundle's files, with the `bundle.json` that is theirs."""
        text = {SCORE: self.score, TIMING: self.timing, CODE: self.code}
        files = {name: (canonical(content) + "\n").encode() for name, content in text.items()}
        return {**with_told({**files, ROWS: self._rows()}), **self.raw}

    def _rows(self) -> bytes:
        return "".join(canonical(row) + "\n" for row in self.rows).encode()


@pytest.fixture
def forgery(at_the_laboratory):
    files = at_the_laboratory.files
    read = {name: json.loads(files[name]) for name in (SCORE, TIMING, CODE)}
    rows = [json.loads(line) for line in files[ROWS].splitlines()]
    return Forgery(
        score=read[SCORE],
        rows=rows,
        code=read[CODE],
        timing=read[TIMING],
        protocol=at_the_laboratory.protocol,
    )


def scenario_with(forged: Forgery, assignment: str) -> str:
    """Hash of the base scenario with one key changed."""
    protocol, controller = forged.protocol, load_controller(forged.score["controller"]["definition"])
    asked = cells(protocol, "nominal", ("lwr4plus",), seeds_of(protocol, "development"), controller)
    whole = next(cell.scenario for cell in asked if cell.id == BASE)
    return load_scenario(whole.resolved(), assignments=[assignment]).sha256()


def a_row_edited(f):
    f.row["metrics"]["tip_error_max_mm"] = 0.5


def a_row_edited_with_all_hashes(f):
    f.row["metrics"]["rcm_error_rms_mm"] *= 0.999
    f.seal()


def a_row_edited_in_its_last_digit(f):
    value = f.row["metrics"]["tip_error_rms_mm"]
    f.row["metrics"]["tip_error_rms_mm"] = value * (1.0 + 2.3e-16)
    assert f.row["metrics"]["tip_error_rms_mm"] != value
    f.seal()


def the_bytes_of_the_rows_edited(f):
    files = f.files()
    f.raw = {ROWS: files[ROWS].replace(b'"seed":0', b'"seed":1', 1)}


def a_row_edited_and_the_hash_of_rows(f):
    for row in f.rows:
        row["metrics"]["tip_error_max_mm"] = 2.0
        row["exceeded"] = ["tip_error_end_mm"]
    f.seal_rows()


def a_row_removed(f):
    f.rows.remove(f.row)
    f.seal()


def a_row_doubled(f):
    f.rows.insert(0, deepcopy(f.row))
    f.seal()


def the_order_of_the_rows_changed(f):
    f.rows.reverse()
    f.seal()


def a_seed_changed(f):
    f.row["seed"] = 7
    f.seal()


def a_seed_swapped_for_one_that_went_better(f):
    f.row.update(seed=7, cell="loads/lwr4plus/base/7")
    f.rows.sort(key=lambda row: row["cell"])
    f.seal()


def seeds_of_a_round_that_was_never_opened(f):
    f.score["seeds"] = {"kind": "round", "round": "2027-1", "key": "00" * 32}
    f.seal()


def a_level_changed(f):
    row = next(row for row in f.rows if row["axis"] == "payload")
    row["level"] = 0.5 if row["level"] == 0.2 else 0.2
    f.seal()


def a_key_of_the_scenario_changed(f):
    f.row["scenario_sha256"] = scenario_with(f, "task.radius_m=0.001")
    f.seal_keys()
    f.seal()


def an_asset_touched(f):
    f.code["files"]["assets/robots/lwr4plus/lwr4plus.xml"] = "0" * 64
    f.seal_keys()
    f.seal()


def a_metric_patched(f):
    f.code["files"]["surgsim/metrics/accuracy.py"] = "0" * 64
    f.seal_keys()
    f.seal()


def a_module_added(f):
    f.code["files"]["surgsim/metrics/better.py"] = "0" * 64
    f.seal_keys()
    f.seal()


def code_told_that_the_runs_did_not_have(f):
    f.code["files"]["surgsim/metrics/accuracy.py"] = "0" * 64


def weights_exchanged(f):
    f.score["controller"]["plugins"]["lab_controller"]["sources_sha256"] = "0" * 64
    f.seal_keys()
    f.seal()


def another_version_of_the_package(f):
    f.score["controller"]["plugins"]["lab_controller"]["version"] = "0.2.0"
    f.seal_keys()
    f.seal()


def a_policy_exchanged(f):
    f.score["controller"]["policies"]["lab"] = "0" * 64
    f.seal_keys()
    f.seal()


def rows_of_another_version(f):
    code = {**f.code, "files": {**f.code["files"], "surgsim/verdict.py": "0" * 64}}
    told = {**f.score["environment"], **f.score["controller"]}
    old = code_sha256({**told, "sources_sha256": hash_of_hashes(code["files"])})
    for row in f.rows:
        row["run_key"] = key_of(row["scenario_sha256"], old, f.code["compilers"])
    f.seal()


def versions_of_packages_changed(f):
    f.score["environment"]["packages"]["mujoco"] = "3.9.0"


def the_compiler_changed(f):
    f.code["compilers"]["numba"] = "0.1"


def the_sources_of_the_environment_changed(f):
    f.score["environment"]["sources_sha256"] = "0" * 64


def the_scorecard_edited_with_its_hash(f):
    f.score["scorecard"]["figures"]["tip_p95"]["value"] = 0.1
    f.score["scorecard_sha256"] = sha256_of(f.score["scorecard"])


def an_axis_of_the_scorecard_edited(f):
    f.score["scorecard"]["axes"][0]["first_failing"] = None
    f.score["scorecard_sha256"] = sha256_of(f.score["scorecard"])


def the_scorecard_edited(f):
    f.score["scorecard"]["runs"] = 100


def the_definition_of_the_controller_changed(f):
    f.score["controller"]["definition"]["resolver"]["resolver"]["k_tip"] = 50.0
    f.seal()


def the_definition_changed_and_not_its_hash(f):
    f.score["controller"]["definition"]["description"] = "better"


def another_track_named(f):
    f.score["track"] = "port_tracked"


def a_track_that_there_is_not(f):
    f.score["track"] = "open"


def another_arm_named(f):
    f.score["arms"] = ["lwr4plus", "panda"]
    f.seal()


def the_hash_of_the_protocol_replaced(f):
    f.score["protocol_sha256"] = "0" * 64
    f.seal()


def another_protocol_named(f):
    f.score["protocol"] = "surgsim_v1"


def an_outcome_flipped(f):
    f.row.update(outcome="rcm_limit")
    f.seal()


def success_flipped(f):
    f.row["success"] = True
    f.seal()


def a_threshold_forgotten(f):
    for row in f.rows:
        row["exceeded"] = []
        row["metrics"]["trocar_force_max_n"] = 7.0
    f.seal()


def a_threshold_invented(f):
    f.row["exceeded"] = ["tip_error_end_mm", "tip_error_max_mm", "trocar_force_max_n"]
    f.seal()


def a_metric_renamed(f):
    f.row["metrics"]["tip_error_best_mm"] = f.row["metrics"].pop("tip_error_max_mm")
    f.seal_rows()


def a_metric_left_out(f):
    f.row["metrics"]["tip_error_rms_mm"] = None
    f.seal()


def a_refusal_in_place_of_a_run(f):
    f.row.update(outcome="refused", scenario_sha256=None, run_key=None, success=False, exceeded=[])
    f.row["metrics"] = dict.fromkeys(f.row["metrics"])
    f.seal()


def the_times_edited(f):
    f.raw = {TIMING: b"{}\n"}


TAMPERED = {
    the_bytes_of_the_rows_edited: "file rows.jsonl: SHA-256: ",
    a_row_edited: "file score.json: rows_sha256: ",
    a_row_edited_and_the_hash_of_rows: "scorecard: tip_p95.value: 4.05",
    a_row_edited_with_all_hashes: f"cell {BASE}: rcm_error_rms_mm: ",
    a_row_edited_in_its_last_digit: f"cell {BASE}: tip_error_rms_mm: ",
    a_row_removed: f"cell {BASE}: row: none in the bundle, one that the protocol asks for here",
    a_row_doubled: f"cell {BASE}: rows: 2 in the bundle, 1 here",
    the_order_of_the_rows_changed: "file rows.jsonl: order: ",
    a_seed_changed: f"cell {BASE}: seed: 7 in the bundle, 0 here",
    a_seed_swapped_for_one_that_went_better: "cell loads/lwr4plus/base/7: row: one in the bundle, none",
    seeds_of_a_round_that_was_never_opened: "seeds: 2027-1: used in the bundle, '2027-1' is no round",
    a_level_changed: "cell loads/lwr4plus/payload=0.2/0: level: 0.5 in the bundle, 0.2 here",
    a_key_of_the_scenario_changed: f"cell {BASE}: scenario_sha256: ",
    an_asset_touched: "code: assets/robots/lwr4plus/lwr4plus.xml: 000000000000 in the bundle, ",
    a_metric_patched: "code: surgsim/metrics/accuracy.py: 000000000000 in the bundle, ",
    a_module_added: "code: surgsim/metrics/better.py: 000000000000 in the bundle, none here",
    code_told_that_the_runs_did_not_have: f"cell {BASE}: run_key: ",
    weights_exchanged: "package: lab_controller.sources_sha256: 000000000000 in the bundle, ",
    another_version_of_the_package: "package: lab_controller.version: 0.2.0 in the bundle, 0.1.0 here",
    a_policy_exchanged: "policy: lab: 000000000000 in the bundle, ",
    rows_of_another_version: f"cell {BASE}: run_key: ",
    versions_of_packages_changed: f"cell {BASE}: run_key: ",
    the_compiler_changed: f"cell {BASE}: run_key: ",
    the_sources_of_the_environment_changed: "file score.json: environment.sources_sha256: 000000000000",
    the_scorecard_edited_with_its_hash: "scorecard: tip_p95.value: 0.1 in the bundle, 4.05",
    an_axis_of_the_scorecard_edited: "scorecard: axes: ",
    the_scorecard_edited: "file score.json: scorecard_sha256: ",
    the_definition_of_the_controller_changed: f"cell {BASE}: scenario_sha256: ",
    the_definition_changed_and_not_its_hash: "file score.json: controller.definition_sha256: ",
    another_track_named: "scorecard: track: nominal in the bundle, port_tracked here",
    a_track_that_there_is_not: "track: name: 'open' in the bundle, nominal, port_tracked here",
    another_arm_named: "cell loads/panda/base/0: row: none in the bundle",
    the_hash_of_the_protocol_replaced: "protocol: short: 000000000000 in the bundle, ",
    another_protocol_named: "protocol: name: surgsim_v1 in the bundle, short here",
    an_outcome_flipped: f"cell {BASE}: outcome: rcm_limit in the bundle, completed here",
    success_flipped: f"cell {BASE}: success: true in the bundle, false here",
    a_threshold_forgotten: f"cell {BASE}: trocar_force_max_n: not exceeded in the bundle, 7.0 of 5 here",
    a_threshold_invented: f"cell {BASE}: trocar_force_max_n: exceeded in the bundle, ",
    a_metric_renamed: f"cell {BASE}: metric tip_error_best_mm: there in the bundle, none here",
    a_metric_left_out: f"cell {BASE}: tip_error_rms_mm: none in the bundle, ",
    a_refusal_in_place_of_a_run: f"cell {BASE}: scenario_sha256: none in the bundle, ",
    the_times_edited: "file timing.json: SHA-256: ",
}


def found_in(files, laboratory):
    found = verify(bundle_of(files, "forged"), laboratory.protocol, ALL)
    return found, [finding.line for finding in found.findings]


def test_the_bundle_itself_is_verified_and_so_is_what_a_forger_makes_anew_without_a_change(
    at_the_laboratory, forgery
):
    for files in (at_the_laboratory.files, forgery.files()):
        found, told = found_in(files, at_the_laboratory)
        assert (told, found.verified, found.exact, found.total) == ([], True, 7, 7)
    before = canonical([forgery.score, forgery.rows])
    forgery.seal_keys()
    forgery.seal()
    assert canonical([forgery.score, forgery.rows]) == before  # the forger's hashes are those of `score`


@pytest.mark.parametrize("tampering", TAMPERED, ids=lambda tampering: tampering.__name__)
def test_a_tampered_bundle_is_caught_and_what_was_done_is_named(tampering, at_the_laboratory, forgery):
    tampering(forgery)
    found, told = found_in(forgery.files(), at_the_laboratory)
    assert not found.verified
    assert [line for line in told if line.startswith(TAMPERED[tampering])], "\n".join(told)


def test_every_kind_of_tampering_has_a_finding_of_its_own():
    assert len(TAMPERED) >= 40
