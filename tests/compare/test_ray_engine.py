"""The same suite on a Ray cluster gives the same table. Ray is never started in pytest's own process."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from batches import Here, short_run

from surgsim.cli.main import main
from surgsim.compare import ray_engine
from surgsim.compare.engine import Batch, compare
from surgsim.compare.job import Job, attempt
from surgsim.compare.suite import SuiteConfig
from surgsim.compare.table import MACHINE_COLUMNS, read_table

HEADER = """
import json, os, signal, sys
from pathlib import Path

os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
import ray
from ray._private.state import available_resources_per_node
from ray.cluster_utils import Cluster
from surgsim.compare.engine import Batch, compare
from surgsim.compare.ray_engine import ray_runner
from surgsim.compare.suite import SuiteConfig
"""
TWO_NODES = """
suite, out, kill_at = SuiteConfig.model_validate_json(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
head = {"num_cpus": 1, "include_dashboard": False}
cluster = Cluster(initialize_head=True, head_node_args=head)
second = cluster.add_node(num_cpus=1)
cluster.wait_for_nodes()
runner, killed = ray_runner(cluster.address), []

def report(done, count, outcome):
    free = available_resources_per_node().get(second.node_id, {}).get("CPU", 0.0)
    if done >= kill_at and not killed and free == 0.0:  # it is at work
        cluster.remove_node(second, allow_graceful=False)
        killed.append(done)

table = compare(Batch(suite=suite, folder=Path(), out=out), report, runner)
print(json.dumps({"rows": len(table), "killed": len(killed), "nodes": len(cluster.list_all_nodes())}))
cluster.shutdown()
"""
FAILURES = """
from surgsim.compare.job import Job

jobs = [Job(**job) for job in json.loads(sys.argv[1])]
kill = f"__import__('os').kill(__import__('os').getpid(), {int(signal.SIGKILL)})"
lost = "__import__('surgsim.compare.job').compare.job.Job(scenario_json='{}', folder='x', record=False)"
runner = ray_runner(None)

class Pickled(Job):
    code = ""
    def __reduce__(self):
        return (eval, (self.code,))

class Killer(Pickled):
    code = kill

class Buggy(Pickled):
    code = lost

given = [jobs[0], Killer(**vars(jobs[1])), Buggy(**vars(jobs[2]))]
print(json.dumps({done.index: done.outcome for done in runner(given, 1)}))
"""


def suite(seeds, duration_s):
    return SuiteConfig(
        name="small",
        scenarios=("circle_lwr4plus",),
        controllers=("pinv", "vprnn"),
        seeds=seeds,
        settings=(
            *short_run(duration_s),
            "disturbances=[{type: payload, mass_kg: 0.3, spread: 0.5}]",
        ),
    )


@pytest.fixture
def run_script(tmp_path):
    def run(body, *arguments):
        path = tmp_path / "script.py"
        path.write_text(HEADER + body)
        command = [sys.executable, str(path), *map(str, arguments)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=400)
        assert done.returncode == 0, done.stderr
        (said,) = [line for line in done.stdout.splitlines() if line.startswith("{")]  # ray prints there too
        return json.loads(said)

    return run


def kept(table):
    return repr(table.without(MACHINE_COLUMNS))


def test_a_job_is_done_in_a_folder_of_its_node_and_its_files_come_back(scenario, tmp_path):
    job = Job(scenario_json=scenario().model_dump_json(), folder=str(tmp_path / "nowhere"), record=True)
    kind, text, files = ray_engine.perform(job)
    assert (kind, text) == ("done", "completed")
    assert set(files) == {"scenario.yaml", "metrics.json", "recording.rrd"}
    assert not (tmp_path / "nowhere").exists()


def test_a_bug_on_a_node_reads_as_one_here(tmp_path):
    job = Job(scenario_json="{}", folder=str(tmp_path / "x"), record=False)
    kind, text, files = ray_engine.perform(job)
    assert (kind, files) == ("error", {})
    assert text == attempt(job)[1]
    assert "ValidationError" in text


def test_a_node_without_room_is_an_error_not_a_row(scenario, tmp_path, monkeypatch):
    job = Job(scenario_json=scenario().model_dump_json(), folder=str(tmp_path / "x"), record=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "missing"))
    kind, text, files = ray_engine.perform(job)
    assert (kind, files) == ("disk", {})
    assert text == f"cannot write {tmp_path / 'missing'}: No such file or directory"


def test_an_address_without_the_engine_is_refused(capsys):
    assert main(["compare", "quick", "--address", "127.0.0.1:6379"]) == 2
    assert capsys.readouterr().err == "surgsim: --address is for --engine ray\n"


def test_without_ray_the_message_says_what_to_install(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "ray", None)
    assert main(["compare", "quick", "--engine", "ray"]) == 2
    assert capsys.readouterr().err == "surgsim: --engine ray needs ray: pip install 'surgsim[ray]'\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.needs("ray")
def test_a_cluster_of_two_nodes_gives_the_table_of_one_process(run_script, tmp_path):
    small = suite("0:2", 0.3)
    expected = compare(Batch(suite=small, folder=Path(), out=tmp_path / "here"), runner=Here())
    said = run_script(TWO_NODES, small.model_dump_json(), tmp_path / "ray", 1000)
    assert said == {"rows": 4, "killed": 0, "nodes": 2}
    assert kept(read_table(tmp_path / "ray")) == kept(expected)


@pytest.mark.slow
@pytest.mark.needs("ray")
def test_two_nodes_one_killed_give_the_table_of_one_process(run_script, tmp_path):
    small = suite("0:3", 20.0)  # a shorter run ends before its worker notices the death of its node
    expected = compare(Batch(suite=small, folder=Path(), out=tmp_path / "here"), runner=Here())
    said = run_script(TWO_NODES, small.model_dump_json(), tmp_path / "ray", 1)
    assert said == {"rows": 6, "killed": 1, "nodes": 1}
    assert kept(read_table(tmp_path / "ray")) == kept(expected)


@pytest.mark.needs("ray")
def test_what_fails_on_a_node_is_a_row(run_script, scenario, tmp_path):
    jobs = [
        {
            "scenario_json": scenario(seed=i).model_dump_json(),
            "folder": str(tmp_path / str(i)),
            "record": False,
        }
        for i in range(3)
    ]
    said = run_script(FAILURES, json.dumps(jobs))
    assert said == {"0": "completed", "1": "worker_died", "2": "crashed"}
    details = [
        json.loads((tmp_path / str(i) / "metrics.json").read_text())["outcome"]["detail"] for i in (1, 2)
    ]
    assert details[0] == "WorkerCrashedError"
    assert details[1].startswith("Traceback (most recent call last):\n")
