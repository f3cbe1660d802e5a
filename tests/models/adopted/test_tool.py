"""An instrument from a file, and a holder, put shaft and tip where they say."""

import mujoco
import numpy as np
import pytest
from pydantic import ValidationError

from surgsim.metrics.catalog import compute_metrics
from surgsim.models.arm import ArmModel
from surgsim.models.build import build, build_arm
from surgsim.models.config import InstrumentConfig, RobotConfig, SceneConfig
from surgsim.resources import resource_dir
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import simulate

ROBOT = RobotConfig(name="lwr4plus")
Q = np.array([0.3, 0.5, -0.2, -1.1, 0.4, 0.9, 0.7])
TOOL = """
<mujoco>
  <compiler angle="degree"/>
  <worldbody>
    <body name="clamp" pos="1 2 3">
      <inertial pos="0.01 0 0.03" mass="0.2" diaginertia="2e-4 3e-4 1e-4"/>
      <geom type="box" size=".02 .02 .03" pos="0 0 .03"/>
      <body name="rod" pos="0.03 0.01 0.05" euler="0 25 0">
        <inertial pos="0 0 0.15" mass="0.1" diaginertia="8e-4 8e-4 1e-6"/>
        <geom type="cylinder" size=".0025 .15" pos="0 0 .17"/>
        <site name="start" pos="0 0 0.02"/><site name="end" pos="0 0 0.32"/>
        <body pos="0 0 .32">
          <joint name="jaw" axis="0 1 0"/>
          <inertial pos="0 0 .01" mass="0.01" diaginertia="1e-6 1e-6 1e-6"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
SITES = {"shaft_entry_site": "start", "tip_site": "end"}


@pytest.fixture
def tool(tmp_path):
    path = tmp_path / "tool.xml"
    path.write_text(TOOL)
    return path


def _config(**instrument) -> SceneConfig:
    return SceneConfig(robot=ROBOT, instrument=InstrumentConfig(**instrument), theatre=False)


def test_shaft_and_tip_are_where_the_file_says(tool):
    config = _config(mjcf=str(tool), shaft_diameter_m=0.005, **SITES)
    scene = build(config)
    model, data = scene.model, mujoco.MjData(scene.model)
    data.qpos[scene.qpos_ids] = Q
    mujoco.mj_forward(model, data)
    R = data.site_xmat[scene.flange_site].reshape(3, 3)
    angle = np.deg2rad(25.0)
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    for site, z in ((scene.shaft_entry_site, 0.02), (scene.tip_site, 0.32)):
        place = np.array([0.03, 0.01, 0.05]) + turn @ [0.0, 0.0, z]
        np.testing.assert_allclose(
            data.site_xpos[site], data.site_xpos[scene.flange_site] + R @ place, atol=1e-12
        )
        np.testing.assert_allclose(data.site_xmat[site].reshape(3, 3)[:, 2], R @ turn[:, 2], atol=1e-12)
    assert config.instrument.shaft_length_m == pytest.approx(0.3)
    body = model.body("instrument")
    assert body.mass[0] == pytest.approx(0.31)


def test_mass_and_inertia_are_those_of_the_file_on_the_arm(tool):
    """The arm's inertia with the tool, against the same bodies attached by MuJoCo itself."""
    arm = ArmModel(_config(mjcf=str(tool), shaft_diameter_m=0.005, **SITES))
    bare = ArmModel(SceneConfig(robot=ROBOT, instrument=None))
    spec = mujoco.MjSpec.from_string(TOOL)
    for joint in list(spec.joints):
        spec.delete(joint)
    own = spec.compile()
    data = mujoco.MjData(own)
    mujoco.mj_kinematics(own, data)
    mujoco.mj_comPos(own, data)
    kin = bare.kinematics(Q)
    R_WE, p_WE = kin.R_WT, kin.p_WT
    M = bare.dynamics(Q, np.zeros(7)).mass_matrix
    for body in range(1, own.nbody):  # M gains J_v^T m J_v + J_w^T I J_w of each
        r = R_WE @ (data.xipos[body] - data.xpos[1])
        Jv = kin.Jv_WT - np.cross(r[:, None] * np.ones(7), kin.Jw_WT, axis=0)
        turn = R_WE @ data.ximat[body].reshape(3, 3)
        inertia = turn @ np.diag(own.body_inertia[body]) @ turn.T
        M = M + own.body_mass[body] * Jv.T @ Jv + kin.Jw_WT.T @ inertia @ kin.Jw_WT
    assert np.linalg.norm(p_WE) > 0.1
    np.testing.assert_allclose(arm.dynamics(Q, np.zeros(7)).mass_matrix, M, atol=1e-12)


def test_a_holder_moves_and_turns_the_shipped_instrument():
    place, turn = (0.05, -0.02, 0.03), (np.cos(0.2), 0.0, np.sin(0.2), 0.0)
    plain, held = (
        ArmModel(_config(**more)) for more in ({}, {"holder": {"position_m": place, "quaternion_wxyz": turn}})
    )
    flange = ArmModel(SceneConfig(robot=ROBOT, instrument=None)).kinematics(Q)
    axis = np.array([np.sin(0.4), 0.0, np.cos(0.4)])
    expected = flange.p_WT + flange.R_WT @ (np.array(place) + 0.44 * axis)
    np.testing.assert_allclose(held.kinematics(Q).p_WT, expected, atol=1e-12)
    np.testing.assert_allclose(held.kinematics(Q).R_WT[:, 2], flange.R_WT @ axis, atol=1e-12)
    assert plain.rolls_shaft
    assert not held.rolls_shaft
    assert held.redundancy(True) == plain.redundancy(True) + 1


@pytest.mark.parametrize("held", [False, True])
def test_the_port_is_held_with_a_tool_of_ones_own(tool, held):
    instrument = {"mjcf": str(tool), "shaft_diameter_m": 0.005, **SITES}
    if held:
        instrument["holder"] = {"position_m": [0.0, 0.03, 0.02], "quaternion_wxyz": [0.98, 0.2, 0.0, 0.0]}
    scenario = load_scenario(
        {
            "name": "own_tool",
            "robot": {"name": "lwr4plus"},
            "instrument": instrument,
            "trocar": {"position_m": [0.0, 0.55, 0.2]},
            "theatre": False,
            "task": {
                "type": "circle",
                "radius_m": 0.01,
                "start_m": [0.01, 0.55, 0.08],
                "duration_s": 3.0,
                "ramp_s": 0.5,
            },
            "controller": "rcm_inverse_dynamics",
        }
    )
    again = load_scenario(scenario.resolved())
    assert again.sha256() == scenario.sha256()
    trace = simulate(scenario)
    metrics = compute_metrics(trace)
    assert trace.meta.ending.outcome.name == "COMPLETED"
    assert metrics["rcm_error_max_mm"] < 0.05
    assert metrics["tip_error_max_mm"] < 0.1


def _refused(**instrument) -> str:
    with pytest.raises(ValidationError) as caught:
        InstrumentConfig(**instrument)
    return caught.value.errors()[0]["msg"]


def test_what_is_no_instrument_is_refused(tool, tmp_path):
    path = str(tool)
    assert "no site 'shaft_entry'. Sites: 'start', 'end'." in _refused(mjcf=path)
    assert "0.000 m long" in _refused(mjcf=path, shaft_entry_site="end", tip_site="end")
    assert "mass_kg is read from the instrument's file" in _refused(mjcf=path, mass_kg=1.0, **SITES)
    assert "tip_site is for an instrument from a file" in _refused(tip_site="end")
    assert "cannot be read" in _refused(mjcf=str(tmp_path / "no.xml"))
    before = InstrumentConfig(mjcf=path, **SITES).files_sha256
    tool.write_text(TOOL.replace("0.32", "0.33"))
    assert "has changed" in _refused(mjcf=path, files_sha256=before, **SITES)
    assert InstrumentConfig(mjcf=path, **SITES).shaft_length_m == pytest.approx(0.31)


def test_the_nominal_arm_knows_the_tool(tool):
    scene = build_arm(_config(mjcf=str(tool), shaft_diameter_m=0.005, **SITES))
    assert {"adapter", "shaft"} < set(scene.shapes.names)


@pytest.mark.parametrize("angle", [0, 30])
def test_an_endoscopes_camera_goes_with_it_and_looks_off_its_shaft(angle):
    file = resource_dir("assets") / "instruments" / f"endoscope_{angle}.xml"
    scene = build(_config(mjcf=str(file), shaft_diameter_m=0.01), drawn=False)
    data = mujoco.MjData(scene.model)
    data.qpos[scene.qpos_ids] = Q
    mujoco.mj_kinematics(scene.model, data)
    mujoco.mj_camlight(scene.model, data)
    lens = scene.model.camera("lens").id
    tip, turn = data.site_xpos[scene.tip_site], data.site_xmat[scene.tip_site].reshape(3, 3)
    looks = -data.cam_xmat[lens].reshape(3, 3)[:, 2]
    assert np.linalg.norm(data.cam_xpos[lens] - tip) < 1e-3
    assert np.rad2deg(np.arccos(np.clip(looks @ turn[:, 2], -1.0, 1.0))) == pytest.approx(angle, abs=1e-5)
    if angle:
        assert looks @ turn[:, 1] == pytest.approx(0.5, abs=1e-6)


BENT = TOOL.replace('<site name="end"', '<site name="shaft_end" pos="0 0 0.3"/><site name="end"')


@pytest.mark.parametrize(
    ("tip", "p_ST"), [("0.01 0 0.32", (0.01, 0.0, 0.02)), ("0 -0.015 0.3", (0.0, -0.015, 0.0))]
)
def test_a_tip_off_the_shaft_s_line_stays_where_the_file_has_it(tmp_path, tip, p_ST):
    path = tmp_path / "bent.xml"
    path.write_text(BENT.replace('name="end" pos="0 0 0.32"', f'name="end" pos="{tip}"'))
    config = _config(mjcf=str(path), shaft_diameter_m=0.005, **SITES)
    assert config.instrument.shaft_length_m == pytest.approx(0.28)
    assert config.instrument.tip_from_shaft_m == pytest.approx((np.hypot(*p_ST[:2]), p_ST[2]), abs=1e-12)
    arm = ArmModel(config)
    kin = arm.kinematics(Q)
    flange = ArmModel(SceneConfig(robot=ROBOT, instrument=None)).kinematics(Q)
    angle = np.deg2rad(25.0)
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    for found, place in ((kin.p_WS, [0.0, 0.0, 0.3]), (kin.p_WT, [float(x) for x in tip.split()])):
        expected = flange.p_WT + flange.R_WT @ (np.array([0.03, 0.01, 0.05]) + turn @ place)
        np.testing.assert_allclose(found, expected, atol=1e-12)
    np.testing.assert_allclose(kin.R_WT[:, 2], flange.R_WT @ turn[:, 2], atol=1e-12)
    assert not arm.rolls_shaft


def test_a_shaft_s_end_at_the_tip_is_that_of_a_straight_instrument(tmp_path, tool):
    path = tmp_path / "bent.xml"
    path.write_text(BENT.replace('name="shaft_end" pos="0 0 0.3"', 'name="shaft_end" pos="0 0 0.32"'))
    bent, straight = (
        ArmModel(_config(mjcf=str(file), shaft_diameter_m=0.005, **SITES)) for file in (path, tool)
    )
    assert not bent.is_angled
    np.testing.assert_array_equal(bent.kinematics(Q).Jv_WT, straight.kinematics(Q).Jv_WT)


@pytest.mark.parametrize(
    ("end", "tip", "reason"),
    [
        ('pos="0 0 0.02"', "0 0 0.32", "the shaft from site 'start' to site 'shaft_end' is 0.000 m long"),
        (
            'pos="0 0 0.3"',
            "0.01 0 0.29",
            "10.0 mm behind the shaft's end, site 'shaft_end': it would touch the",
        ),
        ('pos="0 0 0.3" euler="0 30 0"', "0.01 0 0.32", "has its z 30.0 deg off the shaft; it must be along"),
        (
            'pos="0 0 0.3"',
            "0.15 0 0.3",
            "is 0.150 m from the shaft's end, site 'shaft_end'; it must be at most 0.1 m",
        ),
    ],
)
def test_a_shaft_s_end_that_makes_no_sense_is_refused(tmp_path, end, tip, reason):
    path = tmp_path / "bent.xml"
    text = BENT.replace('name="shaft_end" pos="0 0 0.3"', f'name="shaft_end" {end}')
    path.write_text(text.replace('name="end" pos="0 0 0.32"', f'name="end" pos="{tip}"'))
    said = _refused(mjcf=str(path), **SITES)
    assert reason in said
    assert "\n" not in said
    assert "no site 'no'" in _refused(mjcf=str(path), shaft_end_site="no", **SITES)
