"""Shared fixtures: the arm, random problems for resolvers and torque laws, short scenarios, traces."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from surgsim.control.problem import Resolution, VelocityProblem, velocity_bounds
from surgsim.control.rcm import rcm_kinematics
from surgsim.control.torque_laws.base import TorqueProblem
from surgsim.errors import Outcome
from surgsim.models.arm import ArmModel, Kinematics
from surgsim.models.config import RobotConfig, SceneConfig
from surgsim.scenario.load import load_scenario
from surgsim.scenario.schema import Scenario
from surgsim.tasks.base import TipCommand
from surgsim.trace.trace import BASE_BLOCKS, Ending, Trace, TraceMeta

pytest_plugins = ["left_out"]

SHORT = (
    "theatre=false",
    "task.duration_s=0.3",
    "task.ramp_s=0.1",
    "task.hold_start_s=0",
    "task.hold_end_s=0",
    "task.radius_m=0.002",
)


@pytest.fixture(scope="session")
def arm() -> ArmModel:
    """LWR4+ with the default instrument."""
    return ArmModel(SceneConfig(robot=RobotConfig(name="lwr4plus")))


@pytest.fixture(scope="session")
def random_q(arm) -> Callable[[np.random.Generator], np.ndarray]:
    """Joint positions inside the limits and away from singularities of tip and shaft rows."""

    def draw(rng: np.random.Generator) -> np.ndarray:
        while True:
            q = 0.85 * rng.uniform(arm.limits.q_min, arm.limits.q_max)
            kin = arm.kinematics(q)
            rcm = rcm_kinematics(kin, kin.p_WT - 0.2 * kin.R_WT[:, 2], np.zeros(3))
            if np.linalg.svd(np.vstack([kin.Jv_WT, rcm.jacobian]), compute_uv=False)[-1] > 0.05:
                return q

    return draw


def _trocar_point(kin: Kinematics, rng: np.random.Generator, rcm_error_m: float) -> np.ndarray:
    """A point at distance `rcm_error_m` from the shaft, 5 to 30 cm above the tip."""
    angle = rng.uniform(0.0, 2.0 * np.pi)
    normal = kin.R_WT @ np.array([np.cos(angle), np.sin(angle), 0.0])
    return kin.p_WT - rng.uniform(0.05, 0.3) * kin.R_WT[:, 2] + rcm_error_m * normal


@pytest.fixture(scope="session")
def velocity_problem(arm, random_q) -> Callable[..., VelocityProblem]:
    """Factory of random velocity problems; the same seed gives the same state and command."""

    def make(
        seed: int,
        *,
        trocar: bool = True,
        t_s: float = 0.0,
        dt_s: float = 0.001,
        rcm_error_m: float = 0.002,
        trocar_speed: float = 0.01,
        speed: float = 0.02,
        q: np.ndarray | None = None,
    ) -> VelocityProblem:
        rng = np.random.default_rng(seed)
        q = random_q(rng) if q is None else q
        kin = arm.kinematics(q)
        p_WC = _trocar_point(kin, rng, rcm_error_m) if trocar else np.full(3, np.nan)
        v_WC = trocar_speed * rng.standard_normal(3) if trocar else np.full(3, np.nan)
        lower, upper = velocity_bounds(q, arm.limits, 10.0)
        return VelocityProblem(
            t_s=t_s,
            dt_s=dt_s,
            q=q,
            v=0.1 * rng.standard_normal(7),
            kin=kin,
            command=TipCommand(
                p_WTd=kin.p_WT + 0.001 * rng.standard_normal(3),
                v_WTd=speed * rng.standard_normal(3),
                a_WTd=0.1 * rng.standard_normal(3),
            ),
            rcm=rcm_kinematics(kin, p_WC, v_WC) if trocar else None,
            p_WC=p_WC,
            v_WC=v_WC,
            lower=lower,
            upper=upper,
            limits=arm.limits,
            position_gain_per_s=10.0,
        )

    return make


@pytest.fixture(scope="session")
def torque_problem(arm, velocity_problem) -> Callable[..., TorqueProblem]:
    """Factory of random torque problems."""

    def make(seed: int, *, trocar: bool = True) -> TorqueProblem:
        p = velocity_problem(seed, trocar=trocar)
        rng = np.random.default_rng(seed + 1000)
        return TorqueProblem(
            t_s=0.1,
            dt_s=p.dt_s,
            q=p.q,
            v=p.v,
            tau_measured=rng.standard_normal(7),
            kin=p.kin,
            dyn=arm.dynamics(p.q, p.v),
            rcm=p.rcm,
            p_WC=p.p_WC,
            v_WC=p.v_WC,
            command=p.command,
            resolution=Resolution(qdot=0.1 * rng.standard_normal(7), residual=0.0),
            q_ref=p.q + 0.01 * rng.standard_normal(7),
        )

    return make


@pytest.fixture(scope="session")
def scenario() -> Callable[..., Scenario]:
    """Factory of scenarios: the shipped circle cut down to a small, short one, then `assignments`."""

    def make(*assignments: str, controller: str | None = None, seed: int | None = None) -> Scenario:
        return load_scenario(
            "circle_lwr4plus", controller=controller, assignments=[*SHORT, *assignments], seed=seed
        )

    return make


@pytest.fixture(scope="session")
def trace_of() -> Callable[..., Trace]:
    """Factory of traces from a few columns or blocks; everything else is NaN, limits are 1 to 5."""

    def make(rows: int, period_s: float = 0.001, outcome: Outcome = Outcome.COMPLETED, **given: Any) -> Trace:
        columns = [column for block in BASE_BLOCKS for column in block.columns]
        data = np.full((rows, len(columns)), np.nan)
        data[:, columns.index("t_s")] = period_s * np.arange(rows)
        blocks = {block.name: block.columns for block in BASE_BLOCKS}
        for name, values in given.items():
            places = [columns.index(column) for column in blocks.get(name, (name,))]
            values = np.asarray(values, dtype=float)
            data[:, places] = values[:, None] if values.ndim == 1 else values
        names = ("q_min", "q_max", "velocity", "acceleration", "torque")
        limits = {name: [float(i)] * 7 for i, name in enumerate(names, start=1)}
        limits["q_min"] = [-2.0] * 7
        ending = Ending(outcome=outcome, t_s=period_s * (rows - 1))
        meta = TraceMeta(scenario={"name": "made"}, control_period_s=period_s, limits=limits, ending=ending)
        return Trace(data, BASE_BLOCKS, meta)

    return make
