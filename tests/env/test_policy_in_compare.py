"""A policy's run in a worker process of a comparison."""

import json

import pytest

from surgsim.compare.job import Job
from surgsim.compare.workers import run_jobs
from surgsim.control.policies import registry
from surgsim.env import register_policy
from surgsim.metrics.catalog import compute_metrics
from surgsim.metrics.timing import TIMING_METRICS
from surgsim.simulate.loop import simulate


def test_a_worker_finds_installed_policies_and_says_which_it_cannot_know(scenario, tmp_path, monkeypatch):
    monkeypatch.setattr(registry, "_registered", {})
    register_policy("here", lambda observation: 0.0 * observation["tip_error"])
    shipped = scenario(controller="policy_proportional")
    ours = scenario("controller.resolver.name=here", controller="policy_proportional")
    assert simulate(ours).meta.ending.outcome.name == "COMPLETED"
    jobs = [
        Job(scenario_json=made.model_dump_json(), folder=str(tmp_path / name), record=False)
        for name, made in (("shipped", shipped), ("ours", ours))
    ]
    assert {done.index: done.outcome for done in run_jobs(jobs, 1)} == {0: "completed", 1: "refused"}
    summary = json.loads((tmp_path / "shipped" / "metrics.json").read_text())
    assert summary["controller"] == "policy_proportional"
    for name, value in compute_metrics(simulate(shipped)).items():
        if name not in TIMING_METRICS:
            expected = None if value is None else pytest.approx(value, rel=1e-12)
            assert summary["metrics"][name] == expected, name
    detail = json.loads((tmp_path / "ours" / "metrics.json").read_text())["outcome"]["detail"]
    assert detail.startswith("'here' is not a policy. Known: damping, proportional.")
    assert "entry point" in detail
