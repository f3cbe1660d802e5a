"""The page: whole, escaped, self-contained, with links that lead somewhere; and clear refusals."""

import json
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest

from surgsim.compare.columns import Table
from surgsim.compare.table import keep_table, read_table, schema
from surgsim.errors import Outcome, RecordingError, SurgsimError
from surgsim.metrics.catalog import METRICS
from surgsim.recording.read import Recorded
from surgsim.report import html, series
from surgsim.report.write import write_report

VOID = {"meta", "link", "br", "wbr", "hr", "img", "input"}


class Page(HTMLParser):
    """Checks that tags nest, and collects what the tests ask about."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open, self.tags, self.links, self.ids, self.text = [], [], [], [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        assert len(given) == len(attrs), f"attribute twice in {tag} {attrs}"
        assert all(name.isidentifier() or "-" in name for name in given), attrs
        self.tags.append((tag, given))
        self.ids += [given["id"]] if "id" in given else []
        self.links += [value for name, value in attrs if name in ("href", "src")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] not in ("style", "script"):
            self.text.append(data)


@pytest.fixture(scope="module", params=[False, True], ids=["plain", "awkward"])
def made(request, made_results):
    folder = made_results(awkward=request.param)
    file = write_report(folder)
    text = file.read_text(encoding="utf-8")
    return folder, text, Page(text)


def test_every_section_is_there_and_linked(made):
    _, _, page = made
    wanted = {"leaderboard", "failures", "ranking", "pairs", "scenarios", "scenario-2", "runs", "methods"}
    assert wanted <= set(page.ids)
    assert len(set(page.ids)) == len(page.ids)
    anchors = [link[1:] for link in page.links if link.startswith("#")]
    assert set(anchors) <= set(page.ids)


def test_figures_of_every_kind_are_there(made):
    _, _, page = made
    said = [attrs["aria-label"] for tag, attrs in page.tags if tag == "svg" and "aria-label" in attrs]
    assert sum(label.startswith("Box plot of RCM error, RMS [mm]") for label in said) == 3
    assert sum(label.startswith("Box plot of manipulability") for label in said) >= 6
    assert sum(" against disturbances.0.mass_kg" in label for label in said) == 9
    assert sum(label.startswith("share of runs with score") for label in said) == 3


def test_nothing_is_fetched_from_elsewhere(made):
    _, text, page = made
    assert all(link.startswith(("./", "#", "data:,", "data:image/jpeg;base64,")) for link in page.links)
    assert not re.search(r"@import|url\(|fetch\(|XMLHttpRequest|<iframe|<object|<embed", text)
    assert "default-src 'none'" in text


def test_names_are_text_wherever_they_stand(made):
    _, text, page = made
    scripts = [tag for tag, _ in page.tags if tag == "script"]
    assert len(scripts) == 1
    assert not any(name.startswith("on") for _, attrs in page.tags for name in attrs)
    assert "<results>" in "".join(page.text)
    if "javascript" in text:
        shown = "".join(page.text)
        for name in (
            "circle <b>&amp; co</b>",
            "vp<script>alert(1)</script>",
            "a'b</td>",
            "<i>5.1</i> mm & more",
        ):
            assert name in shown
        assert not any(tag in ("b", "i") and attrs == {"onclick": ""} for tag, attrs in page.tags)


def test_links_lead_to_the_runs_folders_and_recordings(made):
    folder, _, page = made
    targets = [folder / unquote(link) for link in page.links if link.startswith("./")]
    recordings = [target for target in targets if target.suffix == ".rrd"]
    assert len(recordings) == 36
    assert all(target.is_file() for target in recordings)
    folders = [target for target in targets if target.suffix != ".rrd"]
    assert len(folders) == 360
    assert all(target.parent.is_dir() for target in folders[:36])


def test_failures_stand_beside_the_figures(made):
    folder, _, page = made
    table = read_table(folder).rows()
    failed = sum(row["outcome"] != "completed" for row in table)
    text = " ".join("".join(page.text).split())
    assert f"{failed} failed" in text
    assert failed > 20
    for outcome in ("rcm limit", "diverged"):
        assert outcome in text


def test_the_leaderboard_is_ready_to_be_sorted(made):
    _, _, page = made
    sorts = [attrs["aria-sort"] for tag, attrs in page.tags if tag == "th" and "aria-sort" in attrs]
    assert sorts.count("ascending") == 1
    buttons = {a["data-name"]: a for tag, a in page.tags if tag == "button"}
    assert {"controller", "failed", "mean rank", "tip_error_rms_mm", "sparc"} <= set(buttons)
    assert buttons["manipulability_mean"]["data-first"] == "descending"
    assert buttons["tip_error_rms_mm"]["data-first"] == "ascending"
    assert "trocar" not in buttons


def test_the_same_table_gives_the_same_page(made_results):
    folder = made_results()
    first = write_report(folder).read_text()
    assert write_report(folder).read_text() == first


def test_size_stays_bounded_for_a_thousand_runs(tmp_path, made_up):
    file = write_report(made_up.make_results(tmp_path / "many", seeds=28))
    assert len(read_table(tmp_path / "many")) == 1008
    assert file.stat().st_size < 1_500_000


def test_links_hold_from_another_folder(made_results, tmp_path):
    file = write_report(made_results(), tmp_path / "elsewhere.html")
    links = [link for link in Page(file.read_text()).links if link.endswith(".rrd")]
    assert all((tmp_path / unquote(link)).is_file() for link in links)


@pytest.mark.parametrize(
    "target", ["javascript:alert(1)", "//evil.example/x", "https://evil.example", "a?b#c"]
)
def test_a_link_can_only_be_a_path(target, tmp_path):
    made = html.link(tmp_path, tmp_path / "report.html", target, "x")
    address = re.search('href="([^"]*)"', made)[1]
    assert address.startswith("./")
    assert not set(address) & set(':?#"<>')


def test_errors_over_time_come_from_recordings(made_results, trace_of, tmp_path, monkeypatch):
    folder = tmp_path / "recorded"
    shutil.copytree(made_results(), folder)
    rng = np.random.default_rng(0)

    def read(path: Path) -> Recorded:
        if "spiral" in str(path) or "gradient" in str(path):
            raise RecordingError("damaged")
        n = 1000 if "vprnn" in str(path) else 400
        columns = {name: 1e-3 * rng.random(n) for name in ("tip_error_m", "rcm_error_m", "manipulability")}
        outcome = Outcome.COMPLETED
        return Recorded(trace=trace_of(n, outcome=outcome, **columns), metrics={})

    monkeypatch.setattr(series, "read_recording", read)
    said: list[str] = []
    text = "".join(Page(write_report(folder, say=said.append).read_text()).text)
    assert said == [
        "reading 12 recordings for the figures over time",
        "6 recordings could not be read: the figures over time leave them out",  # 4 of spiral, 2 of gradient
    ]
    assert "Median and 10–90 % band of 3 recorded runs at disturbances.0.mass_kg = 0.0" in text
    assert "1 recordings could not be read." in text
    assert "None of 4 recordings could be read." in text
    assert text.count("RCM error over time") == 2


def test_thinning_keeps_the_peaks_and_ends_where_the_run_ended(trace_of):
    error = np.zeros(1000)
    error[333] = 7.0
    trace = trace_of(1000, tip_error_m=error, manipulability=1.0 - error)
    found = series.thin(trace, "tip_error_m", end_s=2.0)
    assert found.shape == (series.SLICES,)
    assert np.nanmax(found) == 7.0
    assert np.nanmin(series.thin(trace, "manipulability", end_s=2.0)) == -6.0
    assert np.isnan(found[81:]).all()
    assert np.isfinite(found[:80]).all()


def test_a_batch_that_failed_throughout_still_has_a_page(tmp_path, made_up):
    rows = [made_up.row_of(seed=seed, outcome="diverged", folder=f"runs/{seed}") for seed in range(3)]
    made_up.write_results(tmp_path, rows)
    (tmp_path / "suite.json").unlink()
    page = Page(write_report(tmp_path).read_text())
    assert "No run completed." in page.text
    assert "ranking" not in page.ids


def test_one_controller_and_one_seed_make_a_page_without_intervals(tmp_path, made_up):
    metrics = dict.fromkeys(METRICS, 0.0) | {"tip_error_rms_mm": 1.0, "rcm_error_rms_mm": 2.0}
    made_up.write_results(tmp_path, [made_up.row_of(**metrics)])
    page = Page(write_report(tmp_path).read_text())
    assert "pairs" not in page.ids
    assert "one seed" in page.text


def test_what_is_no_results_folder_is_refused(made_results, tmp_path):
    with pytest.raises(SurgsimError, match="is not a folder; give the one that `surgsim compare` wrote"):
        write_report(tmp_path / "none")
    with pytest.raises(SurgsimError, match=r"holds no runs\.csv"):
        write_report(tmp_path)
    for name in ("runs.csv", "runs.csv.sha256"):
        shutil.copy(made_results() / name, tmp_path)
    whole = (tmp_path / "runs.csv").read_bytes()
    for damaged in (b"", b"x" * 100, whole[: len(whole) // 2], whole[:200] + b"\0" * 400 + whole[600:]):
        (tmp_path / "runs.csv").write_bytes(damaged)
        with pytest.raises(SurgsimError, match="damaged"):
            write_report(tmp_path)
    table = read_table(made_results())
    keep_table(tmp_path, table.without(["seed"]))
    with pytest.raises(SurgsimError, match="has no column 'seed'"):
        write_report(tmp_path)
    keep_table(tmp_path, Table.of_rows([], schema()))
    with pytest.raises(SurgsimError, match="no rows"):
        write_report(tmp_path)
    (tmp_path / "runs.parquet").unlink()
    keep_table(tmp_path, table)
    (tmp_path / "suite.json").write_text("{")
    with pytest.raises(SurgsimError, match=r"suite\.json is damaged"):
        write_report(tmp_path)
    assert not (tmp_path / "report.html").exists()


def test_command_line(made_results, tmp_path):
    command = [sys.executable, "-m", "surgsim", "report"]
    out = tmp_path / "page.html"
    arguments = [str(made_results()), "--out", str(out), "--json"]
    done = subprocess.run([*command, *arguments], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == {"report": str(out), "bytes": out.stat().st_size}
    refused = subprocess.run([*command, str(tmp_path)], capture_output=True, text=True, check=False)
    assert refused.returncode == 2
    assert refused.stderr.startswith(f"surgsim: {tmp_path} holds no runs.csv")


# Machado, Oliveira and Fernandes, IEEE TVCG 15(6), 2009: severity 1, on linear RGB.
DEFICIENCIES = {
    "none": np.eye(3),
    "protan": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deutan": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritan": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}


def _lab(rgb, deficiency):
    """CIE L*a*b* (D65) of sRGB as seen with a colour vision deficiency."""
    rgb = np.array(rgb) / 255.0
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    seen = np.clip(np.array(DEFICIENCIES[deficiency]) @ linear, 0.0, 1.0)
    to_xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    x, y, z = np.cbrt(np.maximum(np.array(to_xyz) @ seen / [0.9505, 1.0, 1.089], 0.00886))
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("deficiency", DEFICIENCIES)
@pytest.mark.parametrize("theme", [0, 1, 2], ids=["light", "dark", "print"])
def test_the_first_six_colours_can_be_told_apart(theme, deficiency):
    style = Path(html.__file__).with_name("page.css").read_text()
    block = style.split(":root {")[theme + 1]
    codes = [re.search(rf"--c{k}: #([0-9a-f]{{6}})", block)[1] for k in range(6)]
    colours = [_lab([int(code[i : i + 2], 16) for i in (0, 2, 4)], deficiency) for code in codes]
    distances = {(i, j): float(np.linalg.norm(colours[i] - colours[j])) for i in range(6) for j in range(i)}
    assert {pair: d for pair, d in distances.items() if d < 10.0} == {}
