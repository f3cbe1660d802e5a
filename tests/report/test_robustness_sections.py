"""Robustness and frontier of the page: what fails where, panels, maps, and suites that have neither."""

import itertools
import json
import re
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from surgsim.metrics.catalog import METRICS
from surgsim.recording.sealed import sealed
from surgsim.report import html
from surgsim.report.figures.heat import HeatMap, heat_map, shades_of
from surgsim.report.write import write_report

SWEEPS = {
    "payload": {"label": "payload <b>[kg]</b>", "levels": [0.5, 1.0, 2.0]},
    "delay": {"label": "", "levels": [5.0]},
    "never_run": {"label": "x", "levels": [1.0]},
}
AXES = {
    "delay": {"label": "delay [ms]", "levels": [1.0, 5.0]},
    "gain": {"label": "gain & more", "levels": [0.5, 1.0, 2.0]},
    "push": {"label": "push [N]", "levels": [2.0, 20.0]},
}


def _row(made_up, controller, point, seed, rcm_max, outcome="completed"):
    values = {"rcm_error_rms_mm": 0.5 * rcm_max, "rcm_error_max_mm": rcm_max, "tip_error_rms_mm": rcm_max}
    folder = f"runs/s/{controller}/{json.dumps(point)}-seed{seed}"
    return made_up.row_of(
        controller=controller,
        parameters=json.dumps(point),
        seed=seed,
        outcome=outcome,
        folder=folder,
        **(dict.fromkeys(METRICS) | (values if outcome == "completed" else {})),
    )


def _write(made_up, folder, rows, **suite):
    made_up.write_results(folder, rows)
    told = {"name": "made", "command": "surgsim compare made", "seeds": "0:3", **suite}
    (folder / "suite.json").write_text(json.dumps(sealed(told)))
    return write_report(folder).read_text(encoding="utf-8")


def _section(text, anchor):
    return re.search(rf'<section id="{anchor}">(.*?)\n</section>', text, re.S)[1]


@pytest.fixture
def swept(made_up, tmp_path):
    """A page: `weak` passes 5 mm at 1 kg and diverges at 2 kg in one run of three, `strong` holds."""
    rows = []
    for seed in range(3):
        for controller, size in (("weak", 1.0), ("strong", 0.01)):
            rows.append(_row(made_up, controller, {}, seed, size))
            rows.append(_row(made_up, controller, {"delay": 5.0}, seed, 2.0 * size))
            for kg in (0.5, 1.0, 2.0):
                lost = controller == "weak" and kg == 2.0 and seed == 1
                error = size * (1.0 + 4.0 * kg + 0.1 * seed)
                outcome = "diverged" if lost else "completed"
                rows.append(_row(made_up, controller, {"payload": kg}, seed, error, outcome))
    return _write(made_up, tmp_path, rows, sweeps=SWEEPS, grid={})


def test_the_table_names_the_first_level_that_fails_and_how(swept):
    section = _section(swept, "robustness")
    body = re.search(r"<tbody>(.*?)</tbody>", section, re.S)[1]
    rows = [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row, re.S) for row in body.split("<tr>")[1:]]
    cells = {re.sub("<.*", "", row[0]): [unescape(cell) for cell in row[1:]] for row in rows}
    assert cells == {
        "payload": ["1<small>RCM error up to 5.2 mm</small>", "–<small>holds to 2</small>"],
        "delay": ["–<small>holds to 5</small>", "–<small>holds to 5</small>"],
    }


def test_panels_show_every_disturbance_with_its_failures(swept):
    section = _section(swept, "robustness")
    said = [unescape(label) for label in re.findall(r'role="img" aria-label="([^"]*)"', section)]
    assert said == [
        f"{metric}, log scale against {label}, 2 controllers, {count} fail."
        for metric in ("RCM error, RMS [mm]", "tip error, RMS [mm]")
        for label, count in (("payload <b>[kg]</b>", 1), ("delay", 0))
    ]
    panel = section.split('aria-label="RCM error, RMS')[1]
    texts = [unescape(text) for text in re.findall(r"<text[^>]*>(.*?)</text>", panel.split("</svg>")[0])]
    assert {">5 mm", "1/3", "off", "0.5", "1", "2"} <= set(texts)


def test_a_failure_without_a_disturbance_is_the_first(made_up, tmp_path):
    rows = [_row(made_up, "a", {}, 0, 9.0), _row(made_up, "a", {"payload": 1.0}, 0, 1.0)]
    section = _section(_write(made_up, tmp_path, rows, sweeps=SWEEPS), "robustness")
    assert "undisturbed<small>RCM error up to 9 mm</small>" in section


def test_sweeps_are_not_drawn_a_second_time_with_the_scenario(swept):
    assert "<b>[kg]</b>" not in swept
    assert " against payload," not in _section(swept, "scenarios")
    assert '<a href="#robustness">' in swept
    assert '<a href="#frontier">' not in swept


@pytest.fixture
def mapped(made_up, tmp_path):
    """A page with maps: everything at 5 ms and gain 2 is lost, one of two runs at gain 1."""
    rows = []
    for delay, gain, push, seed in itertools.product((1.0, 5.0), (0.5, 1.0, 2.0), (2.0, 20.0), (0, 1)):
        lost = delay == 5.0 and (gain == 2.0 or (gain == 1.0 and seed == 1))
        point = {"delay": delay, "gain": gain, "push": push}
        outcome = "velocity_limit" if lost else "completed"
        rows += [_row(made_up, name, point, seed, push * gain / 10.0, outcome) for name in ("a", "b")]
    return _write(made_up, tmp_path, rows, axes=AXES)


def test_maps_count_failures_in_their_cells(mapped):
    section = _section(mapped, "frontier")
    said = [unescape(label) for label in re.findall(r'role="img" aria-label="([^"]*)"', section)]
    told = "over delay [ms] and gain & more, 6 cells; 3 of 12 runs failed."
    assert said == 4 * [f"RCM error, RMS [mm] {told}"] + 4 * [f"tip error, RMS [mm] {told}"]
    first = section.split("</svg>")[0]
    assert first.count('class="heat"') == 5
    assert first.count('class="lost"') == 1
    texts = re.findall(r"<text[^>]*>(.*?)</text>", first)
    assert [text for text in texts if "/" in text] == ["1/2", "2/2"]
    assert section.count("<h4>push [N]: 2</h4>") == section.count("<h4>push [N]: 20</h4>") == 2


def test_the_same_value_is_the_same_shade_in_every_map(mapped):
    section = _section(mapped, "frontier").split("<h3>")[1]
    shades = [re.findall(r'fill-opacity="([\d.]+)"', svg) for svg in section.split("</svg>")[:4]]
    assert shades[0] == shades[1]  # two controllers with equal errors
    assert max(shades[0]) < max(shades[2])  # a harder push
    assert all(0.05 <= float(shade) <= 0.5 for shade in itertools.chain(*shades))


def test_a_map_without_a_completed_run_is_drawn():
    nothing = HeatMap(
        x=(1.0,), y=(1.0,), value=np.array([[np.nan]]), failed=np.array([[2]]), runs=np.array([[2]])
    )
    drawn = heat_map(nothing, shades_of([nothing]), "x", "y", "error")
    assert "2/2" in drawn
    assert 'class="lost"' in drawn


@pytest.mark.parametrize(
    "told", [{}, {"sweeps": [], "axes": "gain"}, {"sweeps": {"gone": 3}, "axes": {"x": None}}]
)
def test_a_suite_without_axes_has_neither_section(made_up, tmp_path, told):
    text = _write(made_up, tmp_path, [_row(made_up, "a", {"disturbances.0.mass_kg": 1.0}, 0, 1.0)], **told)
    assert 'id="robustness"' not in text
    assert 'id="frontier"' not in text


@pytest.mark.parametrize("theme", [0, 1], ids=["light", "dark"])
def test_numbers_can_be_read_on_the_darkest_cell(theme):
    block = Path(html.__file__).with_name("page.css").read_text().split(":root {")[theme + 1]
    ink, paper, heat = (
        np.array([int(re.search(rf"--{name}: #(\w{{6}})", block)[1][i : i + 2], 16) for i in (0, 2, 4)]) / 255
        for name in ("fg", "bg", "c0")
    )
    bright, dim = sorted((_light(ink), _light(0.5 * paper + 0.5 * heat)), reverse=True)
    assert (bright + 0.05) / (dim + 0.05) > 4.5


def _light(rgb):
    """Relative luminance of sRGB (WCAG 2)."""
    linear = np.where(rgb <= 0.03928, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])
