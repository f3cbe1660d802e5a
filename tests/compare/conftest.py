"""A results directory made up from random numbers: scenarios, controllers, a grid, failures, nulls."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from surgsim.compare.columns import Table
from surgsim.compare.observations import Observations
from surgsim.compare.table import keep_table, schema
from surgsim.metrics.catalog import METRICS
from surgsim.recording.sealed import sealed

PLAIN = {
    "scenarios": ("circle_lwr4plus", "spiral_lwr4plus", "sinusoid_lwr4plus"),
    "controllers": ("vprnn", "gradient", "joint_impedance", "rcm_inverse_dynamics"),
    "folder": "runs/{scenario}/{controller}/p{point}-seed{seed}",
}
AWKWARD = {
    "scenarios": ("circle <b>&amp; co</b>", "spi\"ral's", "säge #1?"),
    "controllers": ("vp<script>alert(1)</script>", 'q"p & co', "a'b</td>", "javascript:alert(1)"),
    "folder": "javascript:x#{point}?/ü %41 & <b>/{controller_index}-{scenario_index}-{seed}",
}
KEY = "disturbances.0.mass_kg"
MASSES = (0.0, 0.2, 0.4)
SPEED = {"tip_error_rms_mm": 1.0, "tip_error_max_mm": 3.0, "rcm_error_rms_mm": 0.5, "rcm_error_max_mm": 1.5}
VERSIONS = {
    "surgsim": "0.1.0",
    "python": "3.11.9",
    "packages": {"mujoco": "4.0.0"},
    "machine": "Linux x86_64",
}


def row_of(**given: Any) -> dict[str, Any]:
    """A row of the table, completed, with `given` values and no other metric."""
    row: dict[str, Any] = dict.fromkeys(schema())
    row.update(suite="made", scenario="s", controller="a", seed=0, parameters="{}", outcome="completed")
    row.update(outcome_t_s=10.0, outcome_detail="", wall_time_s=1.0, scenario_sha256="0" * 64)
    row.update(surgsim_version="0.1.0", commit=None, machine="Linux x86_64", folder="runs/x", recording=None)
    row.update(given)
    row["run_id"] = row["folder"]
    return row


def observations(rows: list[dict[str, Any]]) -> Observations:
    """Observations of `rows`."""
    return Observations.of(Table.of_rows(rows, schema()))


def _outcome(controller: int, mass: float, rng: np.random.Generator) -> str:
    odds = (0.0, 0.1, 0.9 * mass, 0.0)[controller]
    return str(rng.choice(["rcm_limit", "diverged"])) if rng.random() < odds else "completed"


def _metrics(
    controller: int, scenario: int, mass: float, noise: float, rng: np.random.Generator
) -> dict[str, Any]:
    """Errors over three orders of magnitude; the seed's `noise` is common to the controllers."""
    size = (1.0, 1.05, 0.2, 0.005)[controller] * (1 + scenario) * (1 + 4 * mass)
    found: dict[str, Any] = {
        name: factor * size * float(np.exp(0.2 * noise + 0.1 * rng.standard_normal()))
        for name, factor in SPEED.items()
    }
    found["manipulability_mean"] = 0.08 + 0.01 * controller + 0.002 * noise
    found["manipulability_min"] = found["manipulability_mean"] - 0.02
    found["sparc"] = -2.0 - 0.3 * scenario + 0.05 * rng.standard_normal()
    found["saturated_fraction"] = 0.0
    found["control_time_p50_us"] = (60.0, 40.0, 8.0, 25.0)[controller] * float(
        np.exp(0.05 * rng.standard_normal())
    )
    found["convergence_time_s"] = None if controller == 0 else 0.5 + 0.1 * rng.random()
    return found


def make_results(root: Path, names: dict[str, Any] = PLAIN, seeds: int = 10) -> Path:
    """Write the table, suite.json and the folders of the first seed, with files in place of recordings."""
    rng = np.random.default_rng(7)
    rows = []
    for i, scenario in enumerate(names["scenarios"]):
        for seed in range(seeds):
            noise = rng.standard_normal()
            for j, controller in enumerate(names["controllers"]):
                for point, mass in enumerate(MASSES):
                    labels = {"scenario": scenario, "controller": controller, "point": point, "seed": seed}
                    folder = names["folder"].format(**labels, controller_index=j, scenario_index=i)
                    outcome = _outcome(j, mass, rng)
                    values = _metrics(j, i, mass, noise, rng)
                    rows.append(
                        row_of(
                            scenario=scenario,
                            controller=controller,
                            seed=seed,
                            parameters=json.dumps({KEY: mass}),
                            outcome=outcome,
                            success=outcome == "completed",
                            outcome_detail="" if outcome == "completed" else "<i>5.1</i> mm & more",
                            folder=folder,
                            recording=f"{folder}/recording.rrd" if seed == 0 else None,
                            **(values if outcome != "diverged" else dict.fromkeys(METRICS)),
                        )
                    )
                    if seed == 0:
                        (root / folder).mkdir(parents=True, exist_ok=True)
                        (root / folder / "recording.rrd").write_bytes(b"not a recording")
    write_results(root, rows, names)
    return root


def write_results(root: Path, rows: list[dict[str, Any]], names: dict[str, Any] = PLAIN) -> None:
    """Write the table and `suite.json`."""
    root.mkdir(parents=True, exist_ok=True)
    keep_table(root, Table.of_rows(rows, schema()))
    suite = {
        "name": "made",
        "description": "made-up <results> & more",
        "command": "surgsim compare made --seeds 0:10",
        "scenarios": list(names["scenarios"]),
        "controllers": list(names["controllers"]),
        "grid": {KEY: list(MASSES)},
        "seeds": "0:10",
        "provenance": {**VERSIONS, "commit": "0123456789abcdef"},
    }
    (root / "suite.json").write_text(json.dumps(sealed(suite)))


@pytest.fixture(scope="session")
def made_results(tmp_path_factory) -> Callable[..., Path]:
    """Factory of results directories; `awkward` gives names that must be escaped."""
    made: dict[tuple[bool, int], Path] = {}

    def make(awkward: bool = False, seeds: int = 10) -> Path:
        if (awkward, seeds) not in made:
            root = tmp_path_factory.mktemp("made") / "resülts #1"
            made[awkward, seeds] = make_results(root, AWKWARD if awkward else PLAIN, seeds)
        return made[awkward, seeds]

    return make


@pytest.fixture
def runs_of() -> Callable[..., Observations]:
    """Factory of observations from `{controller: {(scenario, seed): value or outcome}}`; tip_error_rms_mm.

    Any difference matters, if not said.
    """

    def make(
        given: dict[str, dict[tuple[str, int], float | str | None]],
        metric: str = "tip_error_rms_mm",
        matters: float = 0.0,
    ):
        rows = []
        for controller, runs in given.items():
            for (scenario, seed), value in runs.items():
                done = not isinstance(value, str)
                outcome = "completed" if done else value
                found = {metric: value if done else 99.0}
                rows.append(
                    row_of(scenario=scenario, controller=controller, seed=seed, outcome=outcome, **found)
                )
        return replace(observations(rows), smallest={metric: matters})

    return make


@pytest.fixture
def rows_of_table() -> Callable[..., Observations]:
    """Factory of observations from rows of the table, completed, with the given values."""

    def make(given: list[dict[str, Any]]) -> Observations:
        return observations([row_of(**row, folder=f"runs/{i}") for i, row in enumerate(given)])

    return make
