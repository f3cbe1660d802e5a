"""Composition of arm, instrument, port and theatre."""

import mujoco
import numpy as np
import pytest
from pydantic import ValidationError

from surgsim.errors import SurgsimError
from surgsim.models.build import Scene, build, build_arm
from surgsim.models.config import InstrumentConfig, RobotConfig, SceneConfig, TrocarConfig
from surgsim.models.folders import robot_names
from surgsim.models.instrument import rod_masses

ROBOT = RobotConfig(name="lwr4plus")
TROCAR = TrocarConfig(position_m=(0.1, 0.5, 0.25), axis=(0.0, -0.3, 1.0))
Q = np.radians((-35, 10, -55, -95, 5, 60, 20))
MASS_KG = {"fr3": 17.8914010262, "iiwa14": 29.9, "lwr4plus": 16.0, "panda": 16.691901}
WRIST_TO_FLANGE_M = {"fr3": 0.107, "iiwa14": 0.126, "lwr4plus": 0.078, "panda": 0.107}


def _config(**changes: object) -> SceneConfig:
    return SceneConfig(**{"robot": ROBOT, "trocar": TROCAR, "theatre": False, **changes})


def _at(scene: Scene, q: np.ndarray = Q) -> mujoco.MjData:
    data = mujoco.MjData(scene.model)
    data.qpos[scene.qpos_ids] = q
    mujoco.mj_forward(scene.model, data)
    return data


def _z(data: mujoco.MjData, site: int) -> np.ndarray:
    return data.site_xmat[site].reshape(3, 3)[:, 2]


@pytest.fixture(scope="module", params=robot_names())
def robot(request) -> RobotConfig:
    return RobotConfig(name=request.param)


@pytest.fixture(scope="module", params=[False, True], ids=["bare", "theatre"])
def scene(robot, request) -> Scene:
    return build(_config(robot=robot, theatre=request.param))


def test_names_are_plain_and_ids_point_at_them(scene):
    model = scene.model
    for i in range(7):
        assert model.joint(f"joint{i + 1}").qposadr[0] == scene.qpos_ids[i]
        assert model.joint(f"joint{i + 1}").dofadr[0] == scene.dof_ids[i]
        assert model.actuator(f"motor{i + 1}").id == scene.actuator_ids[i]
        assert model.actuator_trnid[scene.actuator_ids[i], 0] == model.joint(f"joint{i + 1}").id
        assert model.body(f"link{i + 1}").id > 0
    for name in ("flange", "tip", "shaft_entry", "trocar"):
        assert model.site(name).id == getattr(scene, f"{name}_site")


def test_options(scene):
    assert scene.model.opt.timestep == 0.001
    assert scene.model.opt.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    np.testing.assert_array_equal(scene.model.opt.gravity, (0, 0, -9.81))
    assert build(_config(timestep_s=0.0005)).model.opt.timestep == 0.0005


def test_nothing_touches_and_only_the_arm_has_mass(robot, scene):
    assert not scene.model.geom_contype.any()
    assert not scene.model.geom_conaffinity.any()
    assert scene.model.body_mass.sum() == pytest.approx(MASS_KG[robot.name] + 0.35, abs=1e-9)
    assert scene.model.nv == scene.model.nu == 7


def test_tip_and_shaft_entry_lie_on_the_flange_s_axis(scene):
    data = _at(scene)
    axis, flange = _z(data, scene.flange_site), data.site_xpos[scene.flange_site]
    np.testing.assert_allclose(data.site_xpos[scene.shaft_entry_site], flange + 0.04 * axis, atol=1e-12)
    np.testing.assert_allclose(data.site_xpos[scene.tip_site], flange + 0.44 * axis, atol=1e-12)
    np.testing.assert_allclose(_z(data, scene.tip_site), axis, atol=1e-12)
    np.testing.assert_allclose(_z(data, scene.shaft_entry_site), axis, atol=1e-12)


def test_trocar_is_where_the_config_says_and_points_along_its_axis(scene):
    data = _at(scene)
    np.testing.assert_allclose(data.site_xpos[scene.trocar_site], TROCAR.position_m, atol=1e-12)
    axis = np.array(TROCAR.axis) / np.linalg.norm(TROCAR.axis)
    np.testing.assert_allclose(_z(data, scene.trocar_site), axis, atol=1e-12)


def test_trocar_follows_the_mocap_body(scene):
    data = mujoco.MjData(scene.model)
    data.mocap_pos[scene.port_mocap] += (0.01, 0.0, 0.02)
    mujoco.mj_forward(scene.model, data)
    moved = np.add(TROCAR.position_m, (0.01, 0.0, 0.02))
    np.testing.assert_allclose(data.site_xpos[scene.trocar_site], moved, atol=1e-12)


def test_simulated_arm_and_nominal_arm_are_the_same(robot, scene):
    nominal = build_arm(_config(robot=robot))
    a, b = _at(scene), _at(nominal)
    np.testing.assert_allclose(a.qfrc_bias[scene.dof_ids], b.qfrc_bias[nominal.dof_ids], atol=1e-12)
    np.testing.assert_allclose(a.site_xpos[scene.tip_site], b.site_xpos[nominal.tip_site], atol=1e-12)
    assert nominal.trocar_site is None
    assert nominal.port_mocap is None
    assert nominal.model.ngeom == 0
    assert nominal.model.opt.timestep == scene.model.opt.timestep


def test_arrays_handed_out_are_read_only(scene):
    limits = scene.limits
    arrays = [scene.qpos_ids, scene.dof_ids, scene.actuator_ids, limits.q_min, limits.q_max]
    arrays += [limits.velocity, limits.acceleration, limits.torque, limits.jerk, limits.torque_rate]
    for array in arrays:
        assert array.shape == (7,)
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def _bytes(scene):
    """The compiled model, whole."""
    buffer = np.empty(mujoco.mj_sizeModel(scene.model), dtype=np.uint8)
    mujoco.mj_saveModel(scene.model, None, buffer)
    return buffer.tobytes()


@pytest.mark.parametrize("theatre", [False, True])
def test_the_same_config_gives_the_same_hash(theatre):
    config = _config(theatre=theatre)
    assert _bytes(build(config)) == _bytes(build(config))
    assert _bytes(build(config)) != _bytes(build(_config(theatre=theatre, timestep_s=0.002)))


@pytest.mark.parametrize("theatre", [False, True])
def test_the_saved_model_loads_again(theatre):
    class Keep:
        def modify(self, spec: mujoco.MjSpec) -> None:
            self.spec = spec

    keep = Keep()
    scene = build(_config(theatre=theatre), [keep])
    again = mujoco.MjModel.from_xml_string(keep.spec.to_xml())
    assert (again.nbody, again.ngeom, again.nsite) == (
        scene.model.nbody,
        scene.model.ngeom,
        scene.model.nsite,
    )
    assert again.actuator("motor3").trnid[0] == again.joint("joint3").id


def test_without_an_instrument_the_tip_is_the_flange_and_the_shaft_starts_at_the_wrist(robot):
    scene = build(_config(robot=robot, instrument=None))
    data = _at(scene)
    flange = data.site_xpos[scene.flange_site]
    np.testing.assert_allclose(data.site_xpos[scene.tip_site], flange, atol=1e-12)
    wrist = flange - WRIST_TO_FLANGE_M[robot.name] * _z(data, scene.flange_site)
    np.testing.assert_allclose(data.site_xpos[scene.shaft_entry_site], wrist, atol=1e-12)
    assert scene.model.body_mass.sum() == pytest.approx(MASS_KG[robot.name], abs=1e-9)


@pytest.mark.parametrize(("shaft", "adapter"), [(0.15, 0.01), (0.3, 0.06), (0.6, 0.2)])
def test_lengths_of_the_instrument_move_the_tip(shaft, adapter):
    instrument = InstrumentConfig(
        shaft_length_m=shaft, adapter_length_m=adapter, shaft_diameter_m=0.005, com_m=0.8 * adapter
    )
    scene = build_arm(_config(instrument=instrument))
    data = _at(scene)
    flange = data.site_xpos[scene.flange_site]
    assert np.linalg.norm(data.site_xpos[scene.tip_site] - flange) == pytest.approx(shaft + adapter)
    assert np.linalg.norm(data.site_xpos[scene.shaft_entry_site] - flange) == pytest.approx(adapter)


@pytest.mark.parametrize("com", [0.02, 0.1, 0.24])
def test_inertia_of_the_instrument_is_that_of_its_config_and_consistent(com):
    config = InstrumentConfig(com_m=com, mass_kg=0.5)
    model = build_arm(_config(instrument=config)).model
    body = model.body("instrument").id
    assert model.body_mass[body] == pytest.approx(0.5)
    np.testing.assert_allclose(model.body_ipos[body], (0, 0, com), atol=1e-12)
    moments = model.body_inertia[body]
    assert (moments.sum() / 2 - moments > 0).all()
    # Independent check: the same two rods as MuJoCo geoms.
    adapter, shaft = rod_masses(config)
    rods = mujoco.MjModel.from_xml_string(
        f"""<mujoco><worldbody><body>
        <geom type="cylinder" size="0.026 0.02" pos="0 0 0.02" mass="{adapter}"/>
        <geom type="cylinder" size="0.004 0.2" pos="0 0 0.24" mass="{shaft}"/>
        </body></worldbody></mujoco>"""
    )
    np.testing.assert_allclose(np.sort(moments), np.sort(rods.body_inertia[1]), rtol=1e-9)
    np.testing.assert_allclose(rods.body_ipos[1], (0, 0, com), atol=1e-9)


def test_a_centre_of_mass_outside_the_instrument_is_refused():
    with pytest.raises(ValidationError, match=r"com_m 0\.2 cannot be reached .* from 0\.02 to 0\.14"):
        InstrumentConfig(shaft_length_m=0.2, com_m=0.2)


def test_an_unknown_robot_is_refused():
    config = SceneConfig.model_construct(
        robot=RobotConfig.model_construct(name="lwr4pluss", base_position_m=(0, 0, 0), base_yaw_rad=0.0),
        instrument=None,
        trocar=None,
        theatre=False,
        timestep_s=0.001,
    )
    with pytest.raises(SurgsimError, match=r"^'lwr4pluss' is not a robot\. Known: .* mean 'lwr4plus'\?$"):
        build(config)


def test_robot_names():
    assert robot_names() == ["fr3", "iiwa14", "lwr4plus", "panda"]
    assert not {"instruments", "trocar", "theatre"} & set(robot_names())


def test_base_pose_moves_and_turns_the_arm():
    config = RobotConfig(name="lwr4plus", base_position_m=(0.1, -0.2, 0.3), base_yaw_rad=np.pi / 2)
    at_origin, moved = build_arm(_config()), build_arm(_config(robot=config))
    x, y, z = _at(at_origin).site_xpos[at_origin.tip_site]
    expected = np.array([-y + 0.1, x - 0.2, z + 0.3])
    np.testing.assert_allclose(_at(moved).site_xpos[moved.tip_site], expected, atol=1e-12)


def test_modifiers_act_on_the_simulated_model_in_order():
    class Payload:
        def modify(self, spec: mujoco.MjSpec) -> None:
            spec.body("link7").mass += 0.2

    class Double:
        def modify(self, spec: mujoco.MjSpec) -> None:
            spec.body("link7").mass *= 2

    link7 = build(_config(), [Payload(), Double()]).model.body("link7").mass[0]
    assert link7 == pytest.approx((0.25 + 0.2) * 2)


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (0.2, -0.3, 1.0), (-0.5, 0.4, 0.8)])
@pytest.mark.parametrize("base", [(0.0, 0.0, 0.0), (0.9, 0.9, 0.1)])
def test_the_abdomen_s_skin_passes_through_the_port_normal_to_its_axis(axis, base):
    trocar = TrocarConfig(position_m=(0.1, 0.5, 0.25), axis=axis)
    robot = RobotConfig(name="lwr4plus", base_position_m=base)
    scene = build(_config(robot=robot, trocar=trocar, theatre=True))
    data = _at(scene)
    geom = scene.model.geom("abdomen")
    turn = data.geom_xmat[geom.id].reshape(3, 3)
    skin = turn.T @ (np.array(trocar.position_m) - data.geom_xpos[geom.id]) / geom.size
    assert np.linalg.norm(skin) == pytest.approx(1)
    normal = turn @ (skin / geom.size)
    np.testing.assert_allclose(np.cross(normal, axis), 0, atol=1e-9)
    assert normal @ axis > 0


def test_the_theatre_has_its_cameras_with_and_without_a_port():
    for trocar in (TROCAR, None):
        model = build(_config(trocar=trocar, theatre=True)).model
        assert {model.camera(i).name for i in range(model.ncam)} == {"overview", "port_closeup"}


def test_the_table_stands_on_the_floor():
    model = build(_config(theatre=True)).model
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    foot = model.geom("foot")
    assert data.geom_xpos[foot.id][2] - foot.size[2] == pytest.approx(-0.75)
