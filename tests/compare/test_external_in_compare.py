"""External controllers in batches: workers have them, results say which, --resume knows another version."""

import json
from pathlib import Path

import outside
import pytest
from batches import Here, short_run

import surgsim
from surgsim.cli.main import main
from surgsim.compare.engine import Batch, compare
from surgsim.compare.job import Job
from surgsim.compare.suite import SuiteConfig
from surgsim.compare.workers import run_jobs
from surgsim.control.external.given_commands import giving
from surgsim.errors import SurgsimError
from surgsim.runs.part_origins import externals_of
from surgsim.scenario.load import load_scenario


def summary(folder):
    return json.loads((Path(folder) / "metrics.json").read_text(encoding="utf-8"))


def test_two_workers_run_it_to_the_same_bit_as_the_law_inside(tmp_path):
    with giving({"mine": outside.command()}):
        jobs = [
            Job(
                scenario_json=load_scenario(
                    "circle_lwr4plus", controller=controller, assignments=short_run(0.25), seed=seed
                ).model_dump_json(),
                folder=str(tmp_path / f"{controller}{seed}"),
                record=False,
            )
            for seed in (0, 1)
            for controller in ("external_velocity", "pinv")
        ]
    assert {done.outcome for done in run_jobs(jobs, 2)} == {"completed"}
    for outer, inner in ((0, 1), (2, 3)):
        mine, own = (summary(jobs[k].folder)["metrics"] for k in (outer, inner))
        not_equal = {name for name in own if mine[name] != own[name]}
        assert not_equal <= {
            "resolver_residual_rms",
            *(name for name in own if name.startswith("control_time")),
        }


SUITE = SuiteConfig(
    name="small", scenarios=("circle_lwr4plus",), controllers=("external_velocity",), settings=short_run(0.25)
)


def test_results_say_which_it_was_and_another_version_is_run_again(tmp_path, capsys):
    batch = Batch(suite=SUITE, folder=Path(), out=tmp_path, resume=True)
    folder = tmp_path / "runs/circle_lwr4plus/external_velocity/base-seed0"
    for release, again in (("3.1", 1), ("3.1", 0), ("3.2", 1)):
        runner = Here()
        with giving({"mine": outside.command("-", 0, 0, release)}):
            compare(batch, runner=runner)
        assert len(runner.folders) == again
        assert summary(folder)["provenance"]["externals"] == {
            "mine": {"name": outside.NAME, "version": release}
        }
    said = " ".join(capsys.readouterr().err.split())
    assert "1 of 1 runs were made by other code (external controller mine) and are run again" in said


NAMELESS = ["--set", "controller.resolver.name=nobody"]


def test_without_a_command_nothing_is_begun(tmp_path, capsys):
    batch = ["compare", "circle_lwr4plus", "--controllers", "external_velocity", *NAMELESS]
    assert main([*batch, "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.startswith(
        "surgsim: external controller 'nobody' has no command: give --external nobody=COMMAND, or the line"
    )
    assert not (tmp_path / "out").exists()
    on = ["--scenario", "circle_lwr4plus", "--budget", "9", "--out", str(tmp_path / "t")]
    tune = ["tune", "external_velocity", *on, *NAMELESS]
    assert main(tune) == 2
    assert "has no command" in capsys.readouterr().err


def test_one_that_no_run_names_is_refused(tmp_path, capsys):
    """A person who forgot --controller would look at the results of another one."""
    given = ["--external", f"lab={outside.command()}", "--out", str(tmp_path / "out")]
    for command in ("run", "compare", "check"):
        words = given if command != "check" else given[:2]
        assert main([command, "circle_lwr4plus", *words]) == 2
        assert "--external lab: no controller of these runs names it" in " ".join(
            capsys.readouterr().err.split()
        )
    assert main(["run", "circle_lwr4plus", "--controller", "external_torque", *given]) == 2
    assert capsys.readouterr().err.endswith("no controller of these runs names it; they name mine\n")
    with pytest.raises(SurgsimError, match="--external lab: no controller"):
        surgsim.run("circle_lwr4plus", externals={"lab": "false"})


def test_what_cannot_be_started_declares_nothing():
    made = load_scenario("circle_lwr4plus", controller="external_torque", assignments=short_run())
    with giving({"mine": "false"}):
        assert externals_of(made) == {"mine": None}
    assert externals_of(load_scenario("circle_lwr4plus")) == {}


def test_from_python():
    run = surgsim.run(
        "circle_lwr4plus",
        controller="external_velocity",
        task={"duration_s": 0.25, "ramp_s": 0.1, "hold_start_s": 0.0, "hold_end_s": 0.0, "radius_m": 0.002},
        externals={"mine": outside.command("ends", 50)},
    )
    assert run.outcome == "external_failed"
