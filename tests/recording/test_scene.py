import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose
from rerun.chunk import RrdReader

from surgsim.recording.scene import body_poses, rcm_errors, rebuild, sampled_rows, scenario_of
from surgsim.recording.shapes import Triangles, geom_triangles
from surgsim.recording.write import write_recording
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import simulate
from surgsim.trace.trace import Trace


def volume(surface: Triangles) -> float:
    """Signed volume inside a closed surface: positive when its faces are counter-clockwise from outside."""
    a, b, c = (surface.points[surface.faces[:, i]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


@pytest.mark.parametrize(
    ("xml", "expected"),
    [
        ('type="box" size="0.1 0.2 0.3"', 8 * 0.1 * 0.2 * 0.3),
        ('type="sphere" size="0.2"', 4 / 3 * np.pi * 0.2**3),
        ('type="ellipsoid" size="0.1 0.2 0.3"', 4 / 3 * np.pi * 0.1 * 0.2 * 0.3),
        ('type="cylinder" size="0.1 0.3"', np.pi * 0.1**2 * 0.6),
        ('type="capsule" size="0.1 0.3"', np.pi * 0.1**2 * 0.6 + 4 / 3 * np.pi * 0.1**3),
        ('type="mesh" mesh="m"', 1 / 6),
    ],
)
def test_shapes_are_closed_outward_and_where_the_geom_is(xml: str, expected: float) -> None:
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset><worldbody>'
        f'<geom {xml} pos="0.5 -1 2" quat="0.3 0.5 -0.2 0.8"/></worldbody></mujoco>'
    )
    surface = geom_triangles(model, 0)
    assert surface is not None
    assert volume(surface) == pytest.approx(expected, rel=0.02)
    assert_allclose(np.linalg.norm(surface.normals, axis=1), 1.0, atol=1e-6)
    a, b, c = (surface.points[surface.faces[:, i]] for i in range(3))
    across = np.cross(b - a, c - a)
    solid = np.linalg.norm(across, axis=1) > 1e-12
    agreement = np.einsum("ij,ikj->ik", across, surface.normals[surface.faces])[solid]
    assert (agreement > 0.0).all()
    if "mesh" not in xml:
        middle = (surface.points.min(axis=0) + surface.points.max(axis=0)) / 2
        assert_allclose(middle, model.geom_pos[0], atol=2e-3)


def test_poses_are_those_of_the_run(trace: Trace) -> None:
    """The rebuilt scene puts tip and trocar where the trace has them, also when the trocar moves."""
    scene = rebuild(scenario_of(trace))
    data = trace.data.copy()
    first = trace.columns.index("trocar_x_m")
    data[:, first : first + 3] += np.linspace(0.0, 0.01, len(trace))[:, None]
    moved = Trace(data, trace.blocks, trace.meta)
    rows = sampled_rows(len(trace), 0.1)
    poses = body_poses(scene, moved, rows)
    assert_allclose(in_world(scene.model, poses, scene.tip_site), moved.block("tip")[rows], atol=1e-9)
    assert_allclose(in_world(scene.model, poses, scene.trocar_site), moved.block("trocar")[rows], atol=1e-9)


def in_world(model: mujoco.MjModel, poses, site: int) -> np.ndarray:
    body, points = model.site_bodyid[site], []
    for origin, quaternion in zip(poses.position[:, body], poses.quaternion[:, body], strict=True):
        turned = np.zeros(3)
        mujoco.mju_rotVecQuat(turned, model.site_pos[site], quaternion)
        points.append(origin + turned)
    return np.array(points)


def test_rcm_error_vectors_have_the_length_of_the_column(trace: Trace) -> None:
    vectors = rcm_errors(*(trace.block(name) for name in ("tip", "wrist", "trocar")), angled=False)
    assert_allclose(np.linalg.norm(vectors, axis=1), trace["rcm_error_m"], atol=1e-12)
    assert np.abs(vectors).max() > 1e-6


@pytest.mark.parametrize(
    ("count", "share", "expected"), [(10, 0.25, [0, 4, 8, 9]), (1, 0.05, [0]), (3, 2, [0, 1, 2])]
)
def test_sampled_rows(count: int, share: float, expected: list[int]) -> None:
    assert sampled_rows(count, share).tolist() == expected


def test_the_scene_is_recorded(recording) -> None:
    paths = {chunk.entity_path for chunk in RrdReader(recording).stream()}
    bodies = {"world", "base", *(f"link{i}" for i in range(1, 8)), "instrument", "port", "patient"}
    assert {f"/scene/{body}" for body in bodies} <= paths
    assert {"/scene/desired_path", "/scene/actual_path", "/scene/tip", "/scene/rcm_error_x20"} <= paths
    assert {"/signal_limits/q", "/signal_limits/v", "/signal_limits/tau", "/errors_mm", "/log"} <= paths
    assert RrdReader(recording).blueprints()


def test_the_rcm_error_s_arrow_of_an_angled_tip_goes_to_the_shaft(tmp_path) -> None:
    assignments = ["instrument={name: hook_30}", "task.duration_s=2.0", "task.hold_end_s=0.0"]
    trace = simulate(load_scenario("circle_lwr4plus", controller="vprnn", assignments=assignments))
    write_recording(tmp_path / "recording.rrd", trace, {})
    chunks = RrdReader(tmp_path / "recording.rrd").stream().filter(content=["/scene/rcm_error_x20"])
    batches = [chunk.to_record_batch() for chunk in chunks]
    (drawn,) = [b.column("Arrows3D:vectors") for b in batches if "Arrows3D:vectors" in b.schema.names]
    vectors = np.array(drawn.to_pylist(), dtype=float).reshape(-1, 3) / 20.0
    rate = scenario_of(trace).recording.scene_rate_hz
    rows = sampled_rows(len(trace), rate * trace.meta.control_period_s)
    expected = trace["rcm_error_m"][rows]
    assert expected.max() > 1e-3
    assert_allclose(np.linalg.norm(vectors, axis=1), expected, rtol=1e-5, atol=1e-9)
