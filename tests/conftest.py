"""Shared fixtures: the arm, random problems for resolvers and torque laws, short scenarios, traces."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import outside
import pytest
import usual_arm
from batches import short_run

from surgsim.control.external.given_commands import giving
from surgsim.control.problem import VelocityProblem
from surgsim.control.torque_laws.base import TorqueProblem
from surgsim.errors import Outcome
from surgsim.models.arm import ArmModel
from surgsim.scenario.load import load_scenario
from surgsim.scenario.schema import Scenario
from surgsim.simulate.setup import Setup
from surgsim.trace.trace import Ending, Trace, TraceMeta, base_blocks

pytest_plugins = ["laboratory", "left_out", "warm"]


@pytest.fixture(scope="session", autouse=True)
def _external_controller(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """An external controller `mine`, which shipped controllers name: in every command too, that of the tests.

    Commands read it from a user's own file; that of the person who runs the tests is not read.
    """
    folder = tmp_path_factory.mktemp("config")
    (folder / "surgsim").mkdir()
    (folder / "surgsim" / "external.yaml").write_text(f"mine: {outside.command()}\n", encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch, giving({"mine": outside.command()}):
        patch.setenv("XDG_CONFIG_HOME", str(folder))
        yield


@pytest.fixture(scope="session")
def arm() -> ArmModel:
    """LWR4+ with the default instrument."""
    return usual_arm.usual_arm()


@pytest.fixture(scope="session")
def random_q() -> Callable[[np.random.Generator], np.ndarray]:
    """Joint positions inside the limits and away from singularities of tip and shaft rows."""
    return usual_arm.random_q


@pytest.fixture(scope="session")
def velocity_problem() -> Callable[..., VelocityProblem]:
    """Factory of random velocity problems; the same seed gives the same state and command."""
    return usual_arm.velocity_problem


@pytest.fixture(scope="session")
def torque_problem() -> Callable[..., TorqueProblem]:
    """Factory of random torque problems."""
    return usual_arm.torque_problem


@pytest.fixture(scope="session")
def scenario() -> Callable[..., Scenario]:
    """Factory of scenarios: the shipped circle cut down to a small, short one, then `assignments`."""

    def make(*assignments: str, controller: str | None = None, seed: int | None = None) -> Scenario:
        return load_scenario(
            "circle_lwr4plus", controller=controller, assignments=[*short_run(0.3), *assignments], seed=seed
        )

    return make


@pytest.fixture
def without_scenes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reports that are written meanwhile show no scenes, as where the scenarios are not at hand."""
    monkeypatch.setattr("surgsim.report.scenes.look", lambda scenarios: ())


class _Asked:
    """A resolver in Python that is asked first, and then does what the resolver in its place did."""

    def __init__(self, inner: Any, before: Callable[[int, VelocityProblem], None]) -> None:
        self.inner, self.columns, self.before, self.count = inner, inner.columns, before, -1

    def start(self, problem: VelocityProblem) -> Any:
        return self.inner.start(problem)

    def step(self, problem: VelocityProblem, memory: Any) -> Any:
        self.count += 1
        self.before(self.count, problem)
        return self.inner.step(problem, memory)


@pytest.fixture(scope="session")
def asking() -> Callable[..., Setup]:
    """Factory of setups whose resolver calls `before(tick, problem)` first, which may raise."""

    def make(setup: Setup, before: Callable[[int, VelocityProblem], None]) -> Setup:
        parts = setup.controller.parts
        asked = replace(parts, resolver=_Asked(parts.resolver, before))
        return replace(setup, controller=setup.controller.with_parts(asked))

    return make


@pytest.fixture(scope="session")
def trace_of() -> Callable[..., Trace]:
    """Factory of traces from a few columns or blocks; everything else is NaN, limits are 1 to 5."""

    def make(rows: int, period_s: float = 0.001, outcome: Outcome = Outcome.COMPLETED, **given: Any) -> Trace:
        columns = [column for block in base_blocks(7) for column in block.columns]
        data = np.full((rows, len(columns)), np.nan)
        data[:, columns.index("t_s")] = period_s * np.arange(rows)
        blocks = {block.name: block.columns for block in base_blocks(7)}
        for name, values in given.items():
            places = [columns.index(column) for column in blocks.get(name, (name,))]
            values = np.asarray(values, dtype=float)
            data[:, places] = values[:, None] if values.ndim == 1 else values
        names = ("q_min", "q_max", "velocity", "acceleration", "torque")
        limits = {name: [float(i)] * 7 for i, name in enumerate(names, start=1)}
        limits["q_min"] = [-2.0] * 7
        ending = Ending(outcome=outcome, t_s=period_s * (rows - 1))
        made = {"name": "made", "simulation": {"timestep_s": period_s, "control_period_s": period_s}}
        meta = TraceMeta(scenario=made, control_period_s=period_s, limits=limits, ending=ending)
        return Trace(data, base_blocks(7), meta)

    return make
