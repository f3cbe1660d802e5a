"""`surgsim.run`, `surgsim.load`, and the run that they lead to."""

import json
import os
import signal
import subprocess
import sys
from contextlib import contextmanager

import matplotlib.figure
import numpy as np
import pandas as pd
import pytest

import surgsim
from surgsim.cli.main import main
from surgsim.errors import ScenarioError, UnreachableError
from surgsim.scenario.load import shipped
from surgsim.scenario.yaml_text import read_yaml

CIRCLE = shipped()["circle_lwr4plus"]


def test_a_run_in_memory_writes_nothing(quick, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = surgsim.run("circle_lwr4plus", **quick)
    assert run.folder is None
    assert list(tmp_path.iterdir()) == []
    assert (run.name, run.controller, run.seed, run.outcome) == ("circle_lwr4plus", "vprnn", 0, "completed")
    assert run.provenance["scenario_sha256"] == run.scenario.sha256()


@pytest.mark.parametrize(
    "source",
    [
        "circle_lwr4plus",
        str(CIRCLE),
        CIRCLE,
        read_yaml(CIRCLE).tree,
        surgsim.load("circle_lwr4plus"),
    ],
    ids=["name", "path as text", "path", "mapping", "scenario"],
)
def test_a_scenario_is_taken_in_every_form(source):
    assert surgsim.load(source) == surgsim.load("circle_lwr4plus")


@pytest.mark.parametrize("form", ["name", "path as text", "path", "mapping", "config"])
def test_a_controller_is_taken_in_every_form(form):
    path = shipped("controllers")["qp"]
    given = {
        "name": "qp",
        "path as text": str(path),
        "path": path,
        "mapping": read_yaml(path).tree,
        "config": surgsim.load("circle_lwr4plus", controller="qp").controller,
    }[form]
    assert surgsim.load("circle_lwr4plus", controller=given) == surgsim.load(
        "circle_lwr4plus", controller="qp"
    )


def test_a_mapping_changes_keys_and_one_with_a_type_replaces():
    changed = surgsim.load("circle_lwr4plus", task={"radius_m": 0.01}, safety={"stop": {"duration_s": 0.1}})
    assert (changed.task.radius_m, changed.task.start_m) == (0.01, (0.02, 0.55, 0.02))
    assert (changed.safety.stop.duration_s, changed.safety.stop.torque_share) == (0.1, 0.3)
    task = {"type": "circle", "radius_m": 0.01, "start_m": [0.02, 0.55, 0.03]}
    replaced = surgsim.load("circle_lwr4plus", task=task)
    assert (replaced.task.duration_s, replaced.task.start_m[2]) == (10.0, 0.03)


def test_settings_are_those_of_the_command_and_come_last():
    masses = [{"type": "payload", "mass_kg": 0.1}, {"type": "payload", "mass_kg": np.float64(0.2)}]
    loaded = surgsim.load(
        "circle_lwr4plus",
        disturbances=masses,
        start={"posture_rad": np.zeros(7)},
        settings={"disturbances.1.mass_kg": 0.5},
    )
    assert [disturbance.mass_kg for disturbance in loaded.disturbances] == [0.1, 0.5]
    assert loaded.start.posture_rad == (0.0,) * 7


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"task": {"radius_m": -1}}, ["--set", "task.radius_m=-1"]),
        ({"tsk": 3}, ["--set", "tsk=3"]),
        ({"settings": {"disturbances.2.mass_kg": 1}}, ["--set", "disturbances.2.mass_kg=1"]),
        ({"controller": "vprn"}, ["--controller", "vprn"]),
        ({"controller": "none.yaml"}, ["--controller", "none.yaml"]),
        ({"seed": -1}, ["--seed", "-1"]),
        ({"seed": 2**63}, ["--seed", str(2**63)]),
    ],
)
def test_bad_input_is_refused_in_the_words_of_the_command(options, words, capfd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ScenarioError) as caught:
        surgsim.run("circle_lwr4plus", **options)
    assert main(["run", "circle_lwr4plus", *words]) == 2
    assert capfd.readouterr().err == f"surgsim: {caught.value}\n"


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"seed": 1.5}, "--seed: 1.5 (a number) is not an integer"),
        ({"seed": True}, "--seed: true (a truth value) is not an integer"),
        ({"controller": 3}, "--controller: a int is no controller: give a name, a path or a mapping"),
        ({"task": {"radius_m": float("nan")}}, "--set task.radius_m: nan is not a finite number"),
        ({"task": {"radius_m": {1, 2}}}, "--set task.radius_m: {1, 2} (set) is not a value of a scenario"),
        ({"task": {3: 1}}, "--set task: the key 3 is not a string"),
        (
            {"controller": {"name": "x"}},
            "given controller: resolver: missing. Expected a mapping with the key type: ",
        ),
    ],
)
def test_what_only_python_can_say_wrongly_is_refused_too(options, text):
    with pytest.raises(ScenarioError) as caught:
        surgsim.load("circle_lwr4plus", **options)
    assert str(caught.value).startswith(text)


def test_a_mapping_that_is_wrong_names_its_key():
    tree = {**read_yaml(CIRCLE).tree, "task": {"type": "circl"}}
    with pytest.raises(ScenarioError, match=r"^given scenario: task\.type: 'circl' is not a task\. Known"):
        surgsim.load(tree)
    with pytest.raises(ScenarioError, match=r"^a int is no scenario: give a name, a path or a mapping$"):
        surgsim.load(3)


def test_what_cannot_be_reached_names_the_file_as_it_was_given(tmp_path):
    with pytest.raises(UnreachableError, match=r"^circle_lwr4plus: "):
        surgsim.run("circle_lwr4plus", trocar={"position_m": [0.0, 3.0, 0.2]})


def test_metrics_help_with_names(made):
    assert made.metrics["tip_error_rms_mm"] > 0.0
    assert made.metrics["trocar_force_max_n"] is None
    assert "trocar_force_max_n" not in made.metrics.defined()
    with pytest.raises(surgsim.SurgsimError) as caught:
        made.metrics["tip_eror_rms_mm"]
    assert str(caught.value).startswith(
        "'tip_eror_rms_mm' is not a metric of this run. Did you mean 'tip_error_"
    )
    assert isinstance(caught.value, KeyError)
    assert "mass" not in made.metrics


def test_a_run_shows_itself_within_80_columns_and_in_html(made):
    lines = repr(made).splitlines()
    assert lines[0] == "circle_lwr4plus, pinv, seed 3"
    assert lines[1].startswith("Done")
    assert "completed at 0.300 s: The task ran to its end." in lines
    assert made.success is made.verdict.success is True
    assert any(line.split() == ["saturated_fraction", "0"] for line in lines)
    assert max(map(len, lines)) <= 80
    page = made._repr_html_()
    assert page.startswith("<div><b>circle_lwr4plus, pinv, seed 3</b></div>")
    assert page.count("<tr>") == 1 + len(made.metrics.defined())


def test_a_stopped_run_says_so(quick):
    run = surgsim.run("circle_lwr4plus", safety={"rcm_error_max_m": 1e-9}, **quick)
    assert run.outcome == "rcm_limit"
    assert run.success is False
    assert run.ended.startswith("rcm_limit at 0.0")
    assert max(map(len, repr(run).splitlines())) <= 80
    assert isinstance(run.figure(), matplotlib.figure.Figure)


def test_the_figure_draws_the_trace(made):
    path, tip, rcm = made.figure().axes
    x, y = path.lines[1].get_data()
    wanted = 1e3 * made.trace.block("tip")
    assert np.ptp(x) == pytest.approx(np.ptp(wanted[:, 0]))
    assert np.ptp(y) == pytest.approx(np.ptp(wanted[:, 1]))
    np.testing.assert_array_equal(tip.lines[0].get_ydata(), 1e3 * made.trace["tip_error_m"])
    np.testing.assert_array_equal(rcm.lines[0].get_ydata(), 1e3 * made.trace["rcm_error_m"])
    assert made.figure()._repr_png_()[:4] == b"\x89PNG"


def test_a_run_without_a_trocar_has_a_figure_too(quick):
    run = surgsim.run("circle_lwr4plus", trocar=None, safety={"tip_error_max_m": 1e-3}, **quick)
    rcm = run.figure().axes[2]
    assert [text.get_text() for text in rcm.texts] == ["not defined in this run"]


def test_a_folder_is_what_the_command_writes(folder, quick, tmp_path):
    words = [f"--set=task.{key}={value}" for key, value in quick["task"].items()]
    out = tmp_path / "run"
    options = ["--controller", "pinv", "--seed", "3", "--set=theatre=false", "--out", str(out)]
    assert main(["run", "circle_lwr4plus", *words, *options]) == 0
    assert {path.name for path in folder.iterdir()} == {path.name for path in out.iterdir()}
    assert (folder / "scenario.yaml").read_text() == (out / "scenario.yaml").read_text()
    assert surgsim.read(folder).trace.equals(surgsim.read(out).trace)


def test_a_folder_that_holds_something_else_is_refused_before_the_run(tmp_path):
    (tmp_path / "thesis.tex").touch()
    with pytest.raises(surgsim.SurgsimError, match=r"holds 'thesis.tex', which is not a run's"):
        surgsim.run("circle_lwr4plus", out=tmp_path)


def test_a_folder_that_is_filled_during_the_run_is_not_replaced(quick, tmp_path, monkeypatch):
    thesis = tmp_path / "run" / "thesis.tex"

    @contextmanager
    def filling(label):
        def report(t_s, duration_s):
            thesis.parent.mkdir(exist_ok=True)
            thesis.write_text("mine")

        yield report

    monkeypatch.setattr("surgsim.api.running.show_progress", filling)
    with pytest.raises(surgsim.SurgsimError, match=r"holds 'thesis.tex', which is not a run's"):
        surgsim.run("circle_lwr4plus", out=thesis.parent, progress=True, **quick)
    assert thesis.read_text() == "mine"


def test_progress_is_the_command_s_and_only_on_request(quick, monkeypatch, capfd):
    reached = []

    @contextmanager
    def shown(label):
        yield lambda t_s, duration_s: reached.append((label, t_s, duration_s))

    monkeypatch.setattr("surgsim.api.running.show_progress", shown)
    surgsim.run("circle_lwr4plus", **quick)
    assert reached == []
    surgsim.run("circle_lwr4plus", progress=True, **quick)
    assert reached[-1] == ("circle_lwr4plus vprnn", pytest.approx(0.3), 0.3)
    assert capfd.readouterr() == ("", "")


def test_an_interrupt_leaves_no_draft(tmp_path):
    code = (
        "import surgsim\n"
        "surgsim.run('circle_lwr4plus', task={'duration_s': 3000.0}, progress=True, "
        f"out={str(tmp_path / 'run')!r})\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert any("real time" in line for line in process.stderr)  # it is on its way
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=60)
    assert process.returncode != 0
    assert error.strip().endswith("KeyboardInterrupt")
    assert list(tmp_path.iterdir()) == []


def test_a_trace_becomes_arrays_and_a_data_frame(made, monkeypatch):
    trace = made.trace
    frame = trace.to_pandas()
    assert isinstance(frame, pd.DataFrame)
    assert tuple(frame.columns) == trace.columns
    np.testing.assert_array_equal(frame.to_numpy(), trace.data)
    assert list(trace.to_dict()) == list(trace.columns)
    copy = trace.to_numpy()
    copy[0, 0] = 5.0
    assert trace["t_s"][0] == 0.0
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(
        surgsim.SurgsimError, match=r"^to_pandas needs pandas: pip install 'surgsim\[pandas\]'$"
    ):
        trace.to_pandas()


def test_a_trace_helps_with_names(made):
    cases = {
        "tip_eror_m": "'tip_eror_m' is not a column of this trace. Did you mean 'tip_error_m'",
        "zzz": "'zzz' is not a column of this trace. See its columns.",
        "tip": "'tip' is a block of 3 columns: ask for block('tip')",
    }
    for name, text in cases.items():
        with pytest.raises(surgsim.SurgsimError) as caught:
            made.trace[name]
        assert str(caught.value).startswith(text)
    with pytest.raises(KeyError, match=r"'tipp' is not a block of this trace. Did you mean 'tip'"):
        made.trace.block("tipp")


def test_a_trace_shows_itself_within_80_columns_and_in_html(made):
    lines = repr(made.trace).splitlines()
    assert lines[0] == f"Trace of 301 rows and {len(made.trace.columns)} columns, 0 to 0.3000 s"
    assert len(lines) == 2 + len(made.trace.blocks)
    assert max(map(len, lines)) <= 80
    assert made.trace._repr_html_().count("<tr>") == 1 + len(made.trace.blocks)


def test_the_figures_of_a_run_are_those_of_its_folder(folder, made):
    stored = json.loads((folder / "metrics.json").read_text())
    read = surgsim.read(os.fspath(folder))
    assert dict(read.metrics) == stored["metrics"]
    assert (read.outcome, read.seed, read.folder) == ("completed", 3, folder)
    assert read.scenario == made.scenario
    assert read.trace.equals(made.trace)
