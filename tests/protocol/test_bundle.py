"""Bundles: the same bytes for the same score, hostile archives, samples of runs, the commands."""

import io
import json
import os
import shutil
import subprocess
import sys
import zipfile
from dataclasses import replace

import laboratory as lab
import numpy as np
import pytest

from surgsim.errors import SurgsimError
from surgsim.protocol import verify as verifying
from surgsim.protocol.archive import MOST_BYTES, pack, unpack
from surgsim.protocol.bundle import CODE, FILES, bundle_of, read_bundle, with_told
from surgsim.protocol.canonical import canonical
from surgsim.protocol.rows import Row
from surgsim.protocol.score import ROWS, SCORE, TIMING
from surgsim.protocol.strict import strict_json
from surgsim.protocol.submit import protocol_for, submission
from surgsim.protocol.verify import Effort, close, compared, escape, sample, verify
from surgsim.runs import sources

PLAIN = {name: b"{}\n" for name in FILES}


def test_the_same_score_gives_the_same_bytes(at_the_laboratory):
    again = submission(at_the_laboratory.score, at_the_laboratory.protocol)
    assert again.archive == at_the_laboratory.archive
    assert pack(dict(reversed(at_the_laboratory.files.items()))) == at_the_laboratory.archive


def test_what_is_packed_is_unpacked(tmp_path):
    (tmp_path / "b.zip").write_bytes(pack(PLAIN))
    assert unpack(tmp_path / "b.zip", FILES) == PLAIN


def repacked(compression=zipfile.ZIP_STORED, comment=b"", **more):
    """An archive by another hand."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", compression) as archive:
        for name in sorted(PLAIN):
            archive.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), PLAIN[name], compression)
        for name, content in more.items():
            archive.writestr(name.replace("__", "/").replace("UP", ".."), content)
        archive.comment = comment
    return out.getvalue()


def doubled():
    with pytest.warns(UserWarning, match="Duplicate name"):
        return repacked(**{"score.json": b"{}"})


def lying():
    """A member that says it is large, in a small archive."""
    content = bytearray(pack(PLAIN))
    place = content.rindex(b"PK\x01\x02")
    content[place + 20 : place + 28] = (2**31).to_bytes(4, "little") * 2
    return bytes(content)


HOSTILE = {
    "no archive": (lambda: b"runs are good\n" * 10, "no bundle: File is not a zip file"),
    "empty": (lambda: b"", "no bundle: File is not a zip file"),
    "truncated": (lambda: pack(PLAIN)[:-40], "no bundle: File is not a zip file"),
    "path upwards": (lambda: repacked(UP__evil=b"x"), "no bundle: '../evil' is no file of a bundle"),
    "absolute path": (lambda: repacked(__etc__passwd=b"x"), "no bundle: '/etc/passwd' is no file of"),
    "extra file": (lambda: repacked(**{"weights.pkl": b"x"}), "no bundle: 'weights.pkl' is no file of"),
    "compressed": (lambda: repacked(zipfile.ZIP_DEFLATED), "bundle.json is compressed or encrypted"),
    "comment": (lambda: repacked(comment=b"hello"), "holds something beside its files"),
    "bytes before": (lambda: b"#!/bin/sh\n" + pack(PLAIN), "holds something beside its files"),
    "bytes after": (lambda: pack(PLAIN) + b"more", "holds something beside its files"),
    "a name twice": (doubled, "holds something beside its files"),
    "file missing": (lambda: pack({ROWS: b"", SCORE: b""}), "no bundle: it lacks bundle.json"),
    "a lie about the size": (lying, "score.json|timing.json"),
    "flipped bit": (lambda: pack(PLAIN).replace(b"{}\n", b"{]\n", 1), "Bad CRC-32 for file"),
    "too large": (lambda: b"P" * (MOST_BYTES + 1), "larger than 64 MiB"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_archive_is_no_bundle(name, tmp_path):
    make, reason = HOSTILE[name]
    (tmp_path / "evil.zip").write_bytes(make())
    with pytest.raises(SurgsimError, match=reason):
        read_bundle(tmp_path / "evil.zip")
    assert [path.name for path in tmp_path.iterdir()] == ["evil.zip"]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (b'{"a": NaN}', "NaN is no number"),
        (b'{"a": -Infinity}', "-Infinity is no number"),
        (b'{"a": 1e999}', "1e999 is too large"),
        (b'{"a": 1, "a": 2}', "the key 'a' is there twice"),
        (b"[" * 100_000, "it is nested too deeply"),
        (b'{"a": ' + b"9" * 5000 + b"}", "Exceeds the limit"),
        (b'{"a": "\xff"}', "can't decode byte"),
        (b"", "Expecting value"),
    ],
)
def test_a_file_that_says_different_things_to_different_readers_is_refused(text, reason):
    with pytest.raises(SurgsimError, match=f"x: no strict JSON: .*{reason}"):
        strict_json(text, "x")
    assert strict_json(b'{"a": [1.5, null]}', "x") == {"a": [1.5, None]}


def changed(name, **values):
    def change(files):
        content = {**json.loads(files[name]), **values}
        return {**files, name: (canonical(content) + "\n").encode()}

    return change


def rows_of(change):
    return lambda files: {**files, ROWS: change(files[ROWS])}


FORMS = {
    "unknown key": (changed(SCORE, better=True), "score.json: better: Extra inputs are not permitted"),
    "wrong type": (changed(SCORE, arms="panda"), "score.json: arms: Input should be a valid list"),
    "text for a number": (changed(CODE, cpu=1), "code.json: cpu: Input should be a valid string"),
    "NaN in a row": (
        rows_of(lambda text: text.replace(b'"level":null', b'"level":NaN', 1)),
        "rows.jsonl line 1: no strict JSON: NaN is no number",
    ),
    "key of a row missing": (
        rows_of(lambda text: text.replace(b'"seed":0,', b"", 1)),
        "rows.jsonl line 1: seed: Field required",
    ),
    "another spelling": (
        rows_of(lambda text: text.replace(b'"seed":0', b'"seed": 0', 1)),
        "rows.jsonl line 1: it is not written as `surgsim score` writes it",
    ),
    "cut": (rows_of(lambda text: text[:-1]), "rows.jsonl: its last line has no end"),
    "empty line": (rows_of(lambda text: b"\n" + text), "rows.jsonl line 1: no strict JSON"),
    "another schema": (
        changed("bundle.json", schema_version=9),
        "its schema_version is 9; this release reads 1",
    ),
    "another maker": (changed("bundle.json", bundle="x"), "bundle.json: bundle: Input should be 'surgsim'"),
}


@pytest.mark.parametrize("name", FORMS)
def test_what_has_not_the_form_of_a_bundle_is_none(name, laboratory):
    change, reason = FORMS[name]
    with pytest.raises(SurgsimError) as caught:
        bundle_of(change(laboratory.files), "b.zip")
    assert str(caught.value).startswith("b.zip: ")
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_path_of_a_protocol_in_a_bundle_is_not_followed(laboratory):
    files = changed(SCORE, protocol=str(laboratory.protocol.path))(laboratory.files)
    with pytest.raises(SurgsimError, match="is no shipped protocol; give its file with --protocol FILE"):
        protocol_for(bundle_of(with_told(files), "b.zip"))


def test_a_sample_is_that_of_its_seed_without_repetition_and_never_empty():
    names = [f"c{i:03}" for i in range(240)]
    first = sample(names, 0.05, 3)
    assert first == sample(names, 0.05, 3) != sample(names, 0.05, 4)
    assert len(first) == len(set(first)) == 12
    assert first == sorted(first)
    assert (sample(names, 1.0, 0), len(sample(names[:7], 0.05, 0)), sample([], 1.0, 0)) == (names, 1, [])
    for fraction in (0.0, -1.0, 1.1, float("nan")):
        with pytest.raises(SurgsimError, match="--fraction"):
            sample(names, fraction, 0)


def test_the_chance_to_escape_is_that_of_samples_drawn():
    """Against counting: of samples of 6 of 60 runs, how many have none of 5 altered ones."""
    names = [f"c{i:02}" for i in range(60)]
    altered = set(names[:5])
    free = np.mean([not altered & set(sample(names, 0.1, seed)) for seed in range(4000)])
    assert free == pytest.approx(escape(60, 6, 5), abs=4 * np.sqrt(0.25 / 4000))
    assert (escape(60, 60, 1), escape(60, 0, 1), escape(60, 56, 5)) == (0.0, 1.0, 0.0)


def test_five_percent_catch_an_altered_run_where_it_is_in_the_sample_and_nowhere_else(at_the_laboratory):
    bundle = bundle_of(at_the_laboratory.files, "b.zip")
    cells = [row.cell for row in bundle.rows]
    for seed in range(4):
        found = verify(bundle, at_the_laboratory.protocol, Effort(sample=seed, runner=lab.here))
        assert (found.verified, list(found.again)) == (True, sample(cells, 0.05, seed))


ROW = Row(
    cell="c",
    generator="g",
    arm="a",
    axis="base",
    level=None,
    seed=0,
    scenario_sha256="0",
    run_key="0",
    outcome="completed",
    success=True,
    exceeded=(),
    metrics={"tip_error_max_mm": 1.0, "trocar_force_max_n": None},
)


def test_on_another_platform_numbers_may_differ_by_the_tolerance_and_nothing_else_may():
    def lines(tolerance, **changes):
        return [each.line for each in compared(ROW, replace(ROW, **changes), tolerance)]

    near = {"tip_error_max_mm": 1.0 + 0.009, "trocar_force_max_n": None}
    assert lines(0.0, metrics=near) == ["cell c: tip_error_max_mm: 1.0 in the bundle, 1.009 here"]
    assert lines(0.01, metrics=near) == []
    assert lines(0.01, metrics={**near, "tip_error_max_mm": 1.02}) != []
    assert lines(0.5, metrics={**near, "trocar_force_max_n": 0.0}) == [
        "cell c: trocar_force_max_n: none in the bundle, 0.0 here"
    ]
    assert lines(0.5, outcome="diverged", success=False, exceeded=("tip_error_max_mm",)) == [
        "cell c: outcome: completed in the bundle, diverged here",
        "cell c: success: true in the bundle, false here",
        "cell c: exceeded: nothing in the bundle, tip_error_max_mm here",
    ]
    assert close(0.0, 0.0009, "tip_error_max_mm", 0.01)  # a hundredth of the 0.1 mm that matter
    assert not close(0.0, 0.0011, "tip_error_max_mm", 0.01)


def test_another_platform_is_told_and_takes_the_tolerance(at_the_laboratory, monkeypatch):
    monkeypatch.setattr("surgsim.protocol.installation.cpu", lambda: "another")
    bundle = bundle_of(at_the_laboratory.files, "b.zip")
    altered = [replace(row, metrics={**row.metrics, "tip_error_rms_mm": 3.0}) for row in bundle.rows]
    value = bundle.rows[0].metrics["tip_error_rms_mm"]
    found = verify(bundle, at_the_laboratory.protocol, Effort(fraction=1.0, sample=0, runner=lab.here))
    assert [each.what for each in found.platform] == ["cpu"]
    assert (found.verified, found.exact) == (True, 7)
    for factor, verified in ((1.005, True), (1.02, False)):
        altered = {
            row.cell: replace(row, metrics={**row.metrics, "tip_error_rms_mm": factor * value})
            for row in bundle.rows[:1]
        }
        monkeypatch.setattr(verifying, "_run", lambda *given, altered=altered: altered)
        found = verify(bundle, at_the_laboratory.protocol, Effort(fraction=1.0, sample=0))
        assert (found.verified, found.exact) == (verified, 0)


def test_weights_that_were_exchanged_here_are_named(laboratory, tmp_path):
    shutil.copytree(laboratory.site, tmp_path / "site")
    weights = tmp_path / "site" / "lab_controller" / "weights.json"
    weights.write_text(weights.read_text().replace("9.0", "9.5"))
    with lab.installed(tmp_path / "site"):
        bundle = bundle_of(laboratory.files, "b.zip")
        found = verify(bundle, laboratory.protocol, Effort(fraction=1.0, sample=0, runner=lab.here))
    assert [each.what for each in found.findings] == ["lab_controller.sources_sha256"]
    assert found.again == ()


def test_an_asset_that_was_touched_here_is_named(at_the_laboratory, tmp_path, monkeypatch):
    shutil.copytree(lab.ROOT / "assets", tmp_path / "assets")
    with (tmp_path / "assets" / "robots" / "lwr4plus" / "lwr4plus.xml").open("a") as file:
        file.write("<!-- heavier -->\n")
    place = sources.resource_dir
    for module in ("surgsim.runs.sources", "surgsim.protocol.items"):
        monkeypatch.setattr(
            f"{module}.resource_dir", lambda name: tmp_path / name if name == "assets" else place(name)
        )
    bundle = bundle_of(at_the_laboratory.files, "b.zip")
    found = verify(bundle, at_the_laboratory.protocol, Effort(sample=0, runner=lab.here))
    told = [each.line for each in found.findings]
    assert len(told) == 1
    assert (
        "protocol: short: frozen in the bundle, short is not what its name says: asset/robots/lwr4plus"
        in told[0]
    )


def test_a_package_that_is_not_here_is_named(laboratory):
    bundle = bundle_of(laboratory.files, "b.zip")
    found = verify(bundle, laboratory.protocol, Effort(sample=0, runner=lab.here))
    told = [each.line for each in found.findings]
    package = bundle.score.controller.plugins["lab_controller"]["sources_sha256"][:12]
    policy = bundle.score.controller.policies["lab"][:12]
    assert told == [
        f"package: lab_controller: version 0.1.0, sources_sha256 {package} in the bundle, none here",
        f"policy: lab: {policy} in the bundle, none here",
    ]


def test_a_score_of_other_code_is_not_submitted(at_the_laboratory, tmp_path, monkeypatch):
    made = {name: text for name, text in sources.source_hashes().items()}
    monkeypatch.setattr(
        "surgsim.protocol.bundle.source_hashes", lambda: {**made, "surgsim/verdict.py": "0" * 64}
    )
    found = submission(at_the_laboratory.score, at_the_laboratory.protocol).findings
    assert found[0].line.startswith("file score.json: environment.sources_sha256: ")
    with pytest.raises(SurgsimError, match="no folder of a score: No such file or directory"):
        submission(tmp_path, at_the_laboratory.protocol)


def test_the_command_verify_says_what_differs_and_what_is_no_bundle(warm, laboratory, tmp_path):
    given = ("--protocol", str(laboratory.protocol.path))
    (tmp_path / "forged.zip").write_bytes(pack({**laboratory.files, TIMING: b"{}\n"}))
    (tmp_path / "evil.zip").write_bytes(b"evil")
    seen = warm.run(("verify", "forged.zip", *given), tmp_path)
    assert seen.returncode == 1
    assert "file timing.json: SHA-256: " in seen.stdout
    assert "DIFFERS: 3 differences, no run was done again." in seen.stdout  # its package is not here either
    told = json.loads(warm.run(("verify", "forged.zip", *given, "--json"), tmp_path).stdout)
    assert (told["verified"], len(told["findings"]), told["run_again"]) == (False, 3, [])
    for words, reason in (
        (("evil.zip",), "evil.zip: no bundle: File is not a zip file"),
        (("missing.zip",), "missing.zip: cannot be read: No such file or directory"),
        (("forged.zip",), "'short' is no shipped protocol; give its file with --protocol FILE"),
        (("forged.zip", "--all", "--fraction", "0.5"), "--all runs every run again: leave --fraction out"),
        (("forged.zip", "--fraction", "2"), "--fraction: 2 is not allowed"),
        (("forged.zip", "--tolerance", "-1"), "--tolerance: -1 is not allowed"),
        (("forged.zip", "--sample", "-1"), "--sample: -1 is not allowed"),
    ):
        done = warm.run(("verify", *words), tmp_path)
        assert (done.returncode, done.stdout) == (2, "")
        assert reason in done.stderr


def test_the_command_submit_writes_nothing_that_would_not_be_verified(warm, laboratory, tmp_path):
    given = ("--protocol", str(laboratory.protocol.path), "--out", "lab.zip")
    done = warm.run(("submit", str(laboratory.score), *given), tmp_path)  # its package is not here
    assert done.returncode == 1
    assert done.stdout.startswith("package: lab_controller: ")
    assert "no bundle was written" in done.stderr
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "lab.zip").write_bytes(b"")
    done = warm.run(("submit", str(laboratory.score), *given), tmp_path)
    assert (done.returncode, "lab.zip is there already; give --force" in done.stderr) == (2, True)


def test_a_controller_of_a_package_is_scored_submitted_and_verified_as_the_page_says(laboratory, tmp_path):
    """Word for word, but for the protocol, whose runs are short, and the place of the installation."""
    lab.write_package(tmp_path)
    path = os.pathsep.join([str(laboratory.site), *filter(None, sys.path)])
    said = {}
    for command in lab.pages_commands():
        words = command.split()
        if words[0] == "surgsim" and words[1] in ("score", "submit", "verify"):
            more = ["--protocol", str(laboratory.protocol.path)]
            more += ["--jobs", "1"] if words[1] != "submit" else []
            done = subprocess.run(
                [sys.executable, "-m", *words, *more],
                cwd=tmp_path,
                env={**os.environ, "PYTHONPATH": path},
                capture_output=True,
                text=True,
                timeout=300,
            )
            assert done.returncode == 0, done.stdout + done.stderr
            said[words[1]] = done.stdout
    assert list(said) == ["score", "submit", "verify"]
    assert "lab, short, track nominal, panda: 7 runs" in said["submit"]
    assert "VERIFIED: 1 of 7 runs run again" in said["verify"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["lab", "lab.zip", "runs", "scores"]
