"""What moves besides the arm moves in the recording too."""

import numpy as np
import pytest

from surgsim.models.peg_board import PegBoardLayout
from surgsim.plant.props.peg_board import PegBoardConfig
from surgsim.recording.scene import body_poses, rebuild
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import simulate


@pytest.fixture(scope="module")
def trace():
    """A short run on a board that leans, so that its rings slide down to their pegs."""
    scenario = load_scenario(
        "circle_panda",
        controller="rcm_inverse_dynamics",
        assignments=("theatre=false", "task.duration_s=0.3", "task.ramp_s=0.1", "task.radius_m=0.002"),
    )
    board = PegBoardConfig(normal=(0.6, 0.0, 1.0))
    return simulate(scenario.model_copy(update={"props": (board,)}))


def test_rings_are_drawn_where_they_were(trace):
    from surgsim.scenario.schema import Scenario

    scenario = Scenario.model_validate(trace.meta.scenario, strict=False)
    scene = rebuild(scenario)
    rows = np.array([0, len(trace) // 2, len(trace) - 1])
    poses = body_poses(scene, trace, rows)
    for ring in (1, 2, 3):
        body = scene.model.body(f"ring{ring}").id
        path = trace.block(f"ring{ring}")
        np.testing.assert_allclose(poses.position[:, body], path[rows], atol=1e-12)
        np.testing.assert_allclose(
            poses.quaternion[:, body], trace.block(f"ring{ring}_quat")[rows], atol=1e-9
        )
        assert np.linalg.norm(path[-1] - path[0]) > 1e-3


def test_the_trace_begins_with_the_rings_on_their_pegs(trace):
    layout = PegBoardLayout(normal=(0.6, 0.0, 1.0))
    for ring, (x, y) in enumerate(layout.source_m):
        expected = layout.point(x, y, layout.rim_radius_m)
        np.testing.assert_allclose(trace.block(f"ring{ring + 1}")[0], expected, atol=1e-9)
