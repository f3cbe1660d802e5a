"""The shipped solvers of the QP resolvers in closed loop: the same motion and torques on every scenario.

Quick tests take the scenarios that name a QP, and the circle; slow ones every other, under controller `qp`.
`benchmarks/qp_backends.py` compares whole runs and prints by how much they differ.
"""

import numpy as np
import pytest

from surgsim.control.qp import SHIPPED
from surgsim.errors import Outcome
from surgsim.resources import resource_dir
from surgsim.scenario.load import load_scenario, of_one_arm
from surgsim.simulate.loop import Simulation, simulate
from surgsim.simulate.setup import prepare

FOLDER = resource_dir("scenarios")
EVERY = {str(path): path for path in sorted([*FOLDER.glob("*.yaml"), *FOLDER.glob("safety/*.yaml")])}
FILES = [EVERY[name] for name in of_one_arm(EVERY)]
TICKS = 300
JOINTS_RAD, TORQUE_NM = 1e-9, 1e-6


def names_a_qp(path):
    return load_scenario(str(path)).controller.resolver.type in ("qp", "passive_qp")


def quick(path):
    return names_a_qp(path) or path.stem.startswith("circle")


def case(path):
    return pytest.param(path, id=path.stem, marks=() if quick(path) else pytest.mark.slow)


def motion(path, solver):
    """Joint positions, velocities and torques of the first ticks; the path starts without a rest."""
    scenario = load_scenario(str(path))
    settings = [f"controller.resolver.solver={solver}"]
    if hasattr(scenario.task, "hold_start_s"):
        settings.append("task.hold_start_s=0")
    controller = None if names_a_qp(path) else "qp"
    simulation = Simulation(prepare(load_scenario(str(path), controller=controller, assignments=settings)))
    rows = []
    for _ in range(TICKS):
        simulation.tick()
        state = simulation.state
        rows.append((state.q, state.v, state.tau))
    return np.array(rows), simulation.ended


@pytest.mark.parametrize("path", [case(path) for path in FILES])
def test_the_solvers_move_the_arm_alike(path):
    (ours, ended), *others = (motion(path, solver) for solver in SHIPPED)
    assert np.abs(ours[:, 1]).max() > 1e-4, "the arm moves"
    for other, other_ended in others:
        assert other_ended == ended
        np.testing.assert_allclose(other[:, 0], ours[:, 0], rtol=0, atol=JOINTS_RAD)
        np.testing.assert_allclose(other[:, 2], ours[:, 2], rtol=0, atol=TORQUE_NM)


def test_a_program_without_a_solution_ends_every_run_at_the_same_tick():
    setting = "controller.resolver.solver={}"
    path = str(FOLDER / "safety" / "infeasible.yaml")
    ends = [
        simulate(load_scenario(path, assignments=[setting.format(solver)])).meta.ending for solver in SHIPPED
    ]
    assert [end.outcome for end in ends] == [Outcome.INFEASIBLE] * len(SHIPPED)
    assert len({end.t_s for end in ends}) == 1
    assert len({end.detail for end in ends}) == 1


def test_scenarios_with_a_qp_are_among_the_quick_ones():
    assert {path.stem for path in FILES if names_a_qp(path)} >= {
        "infeasible",
        "peg_and_ring_panda",
        "teleop_free_motion_panda",
        "teleop_tissue_panda",
        "teleop_wall_panda",
        "teleop_workspace_limits_panda",
    }
