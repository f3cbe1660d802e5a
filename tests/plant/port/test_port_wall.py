"""The wall under the cannula: statics, rest, breathing, and what the configuration refuses."""

import mujoco
import numpy as np
import pytest
from pydantic import ValidationError

from surgsim.models.build import build
from surgsim.models.config import InstrumentConfig, RobotConfig, SceneConfig, TrocarConfig, WallConfig

CLEARANCE_M = 0.00045
K_CONTACT = 20000.0


@pytest.mark.parametrize("stiffness", [300.0, 1000.0, 3000.0])
@pytest.mark.parametrize("degrees", [0.0, 37.0, 250.0])
def test_a_lateral_force_displaces_the_cannula_by_force_over_stiffness_after_the_clearance(
    rig, stiffness, degrees
):
    """Statics from outside: springs in series beyond the clearance, and balance of all torques on the arm."""
    made = rig(lateral_stiffness_n_per_m=stiffness, axial_stiffness_n_per_m=stiffness, seal_friction_n=0.0)
    direction = made.axes() @ [np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0.0]
    made.stiffness, made.damping = 30.0, 8.0
    made.push = lambda t: 8.0 * direction * min(1.0, t / 0.5)
    made.run(5.0)
    force, moved = made.port.force(), made.port.position() - made.port.rest()
    away = made.shaft()[0] - moved  # from the shaft to the place of rest
    u = made.shaft_axis()
    beyond = np.linalg.norm(away - u * (u @ away)) - CLEARANCE_M
    assert np.linalg.norm(force) > 3.0
    assert np.linalg.norm(force) == pytest.approx(beyond / (1 / stiffness + 1 / K_CONTACT), rel=1e-4)
    np.testing.assert_allclose(moved, force / stiffness, atol=1e-3 * np.linalg.norm(moved))
    model, data, body = made.scene.model, made.data, made.scene.model.body("instrument").id
    at_rest, at_cannula = np.zeros((2, 3, model.nv))
    mujoco.mj_jac(model, data, at_rest, None, made.port.rest(), body)
    mujoco.mj_jac(model, data, at_cannula, None, made.port.position(), body)
    torque = (at_rest.T @ (8.0 * direction) - at_cannula.T @ force)[:7] + 30.0 * (made.q - data.qpos[:7])
    np.testing.assert_allclose(torque, 0.0, atol=0.01)


def test_an_undisturbed_cannula_rests_at_the_configured_place_whatever_its_weight_and_axis(rig):
    made = rig(mass_kg=0.2)
    made.run(0.5)
    np.testing.assert_allclose(made.port.position(), made.port.rest(), atol=1e-9)
    np.testing.assert_allclose(made.port.rest(), made.data.site_xpos[made.scene.trocar_site], atol=1e-12)


def test_a_pushed_cannula_comes_back_as_its_spring_and_damper_say(rig):
    """Independent: the damped oscillator's closed form; inside the clearance the shaft is out of the way."""
    made = rig(1e-4, lateral_damping_n_s_per_m=2.0, seal_friction_n=0.0)
    made.reset(cannula=(0.0004, 0.0, 0.0))
    x = np.array(made.run(0.03, lambda: made.data.qpos[made.scene.cannula_qpos_ids[0]]))
    t = 1e-4 * np.arange(1, len(x) + 1)
    decay, wave = 2.0 / (2 * 0.05), np.sqrt(1000.0 / 0.05 - (2.0 / (2 * 0.05)) ** 2)
    expected = 0.0004 * np.exp(-decay * t) * (np.cos(wave * t) + decay / wave * np.sin(wave * t))
    np.testing.assert_allclose(x, expected, atol=4e-6)


def _breath(axis, amplitude_m=0.005, rate_hz=0.5):
    w = 2 * np.pi * rate_hz

    def rest(t):
        return amplitude_m * (1 - np.cos(w * t)) / 2 * axis, amplitude_m * w * np.sin(w * t) / 2 * axis

    return rest


def test_breathing_moves_the_free_cannula_with_its_place_of_rest(rig):
    made = rig(seal_friction_n=0.0)
    axis = made.axes()[:, 2]
    made.rest = _breath(axis)
    made.reset()
    home = made.port.rest()
    seen = np.array(made.run(1.0, lambda: made.port.position() - made.port.rest()))
    np.testing.assert_allclose(made.port.rest() - home, 0.005 * axis, atol=1e-9)
    assert np.abs(seen).max() < 0.05 * 0.005  # inertia alone: m a / K = 2.5e-6 m, and one step of lag


def test_sideways_breathing_drags_the_shaft(rig):
    """The clearance is used up, then the wall pulls; the arm, springy, is carried along."""
    made = rig()
    made.stiffness, made.damping = 100.0, 10.0
    across = made.axes()[:, 0]
    made.rest = _breath(across)
    made.reset()
    made.run(1.0)
    force = made.port.force() @ across
    assert force < -0.1  # the shaft holds the wall back
    away = made.shaft()[0]
    assert np.linalg.norm(away) > CLEARANCE_M
    shaft_way = 0.005 - (made.port.rest() - made.port.position()) @ across - away @ across
    assert shaft_way > 0.001


def test_moving_the_rest_place_equals_moving_the_world(rig):
    """A rest place displaced for good is the same as a port configured there."""
    shift = 0.003
    moved, there = rig(), rig(offset_m=(shift, 0.0, 0.0))
    offset = there.port.rest() - moved.port.rest()
    moved.rest = lambda t: (offset, np.zeros(3))
    moved.reset(cannula=tuple(moved.axes().T @ offset))
    there.reset()
    assert np.linalg.norm(offset) == pytest.approx(shift)
    for made in (moved, there):
        made.run(0.3)
    np.testing.assert_allclose(moved.port.force(), there.port.force(), atol=1e-9)
    np.testing.assert_allclose(moved.data.qpos[:7], there.data.qpos[:7], atol=1e-12)
    assert np.linalg.norm(moved.port.force()) > 0.5


def test_an_ideal_port_moves_and_pushes_nothing(rig):
    made = rig(ideal=True)
    made.port.move(np.array([0.001, 0.0, 0.002]), np.zeros(3))
    mujoco.mj_step1(made.scene.model, made.data)
    made.port.act()
    np.testing.assert_array_equal(made.port.force(), 0.0)
    np.testing.assert_array_equal(made.data.qfrc_applied, 0.0)
    np.testing.assert_allclose(made.port.position(), made.data.site_xpos[made.scene.trocar_site], atol=1e-12)
    made.port.reset()
    np.testing.assert_allclose(made.port.rest(), made.scene.model.body("port").pos, atol=1e-12)


def test_reset_forgets(rig):
    made = rig()
    made.push = lambda t: made.axes() @ [4.0, 1.0, 2.0]
    first = np.array(made.run(0.2, lambda: made.data.qpos.copy()))
    made.reset()
    np.testing.assert_array_equal(np.array(made.run(0.2, lambda: made.data.qpos.copy())), first)


def _config(**wall):
    trocar = TrocarConfig(position_m=(0.1, 0.5, 0.25), axis=(0.0, -0.3, 1.0), wall=WallConfig(**wall))
    return SceneConfig(robot=RobotConfig(name="lwr4plus"), trocar=trocar)


@pytest.mark.parametrize("drawn", [True, False])
def test_the_wall_adds_a_cannula_with_three_slides_and_nothing_else(drawn):
    walled = build(_config(), drawn=drawn)
    ideal = build(
        _config().model_copy(update={"trocar": TrocarConfig(position_m=(0.1, 0.5, 0.25))}), drawn=drawn
    )
    model = walled.model
    assert (model.nv, model.nbody, model.ngeom) == (
        ideal.model.nv + 3,
        ideal.model.nbody + 1,
        ideal.model.ngeom,
    )
    assert model.body_mass.sum() == pytest.approx(ideal.model.body_mass.sum() + 0.05)
    assert not model.geom_contype.any()
    assert not model.geom_conaffinity.any()
    np.testing.assert_array_equal(walled.dof_ids, ideal.dof_ids)
    assert model.body_mocapid[model.body("port").id] == walled.port_mocap
    assert (model.body_geomnum[model.body("cannula").id] > 0) == drawn
    assert ideal.wall is None
    assert ideal.cannula_dof_ids.size == 0


def test_a_timestep_too_long_for_the_contact_is_refused():
    with pytest.raises(
        ValidationError, match=r"timestep of at most 0\.00123 s .* mass_kg 0\.05, not 0\.002 s"
    ):
        SceneConfig(**{**dict(_config()), "timestep_s": 0.002})


def test_the_longest_timestep_allowed_is_stable(rig):
    """At the bound a struck cannula comes to rest on the shaft."""
    made = rig(0.0012, contact_stiffness_n_per_m=20000.0, seal_friction_n=0.0, lateral_damping_n_s_per_m=0.0)
    made.reset(cannula=(0.003, 0.0, 0.0))
    peak = np.array(made.run(2.0, lambda: abs(made.data.qpos[made.scene.cannula_qpos_ids[0]])))
    assert peak.max() <= 0.003
    assert peak[-200:].max() < 0.001


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"instrument": None}, "trocar.wall needs an instrument"),
        ({"instrument": InstrumentConfig(shaft_diameter_m=0.009)}, "must be below the bore"),
    ],
)
def test_a_wall_without_a_shaft_that_fits_is_refused(changes, message):
    with pytest.raises(ValidationError, match=message):
        SceneConfig(**{**dict(_config()), **changes})


@pytest.mark.parametrize(
    "key", ["mass_kg", "lateral_stiffness_n_per_m", "contact_stiffness_n_per_m", "tear_force_n"]
)
def test_a_wall_of_nothing_is_refused(key):
    with pytest.raises(ValidationError, match=key):
        WallConfig(**{key: 0.0})
