"""The force-torque sensor at the flange: against MuJoCo's own, known pushes, the wall, its noise."""

import mujoco
import numpy as np
import pytest

from surgsim.errors import SurgsimError
from surgsim.models.build import body_at_flange, build
from surgsim.models.config import RobotConfig, SceneConfig
from surgsim.plant.disturbances.force_torque_sensor import ForceTorqueSensorConfig
from surgsim.plant.disturbances.push import PushConfig
from surgsim.plant.dynamic import DynamicPlantConfig
from surgsim.simulate.loop import Simulation, simulate
from surgsim.simulate.setup import prepare

QUIET = ForceTorqueSensorConfig(force_std_n=0.0, moment_std_nm=0.0)
QUIET_KEYS = "{type: force_torque_sensor, force_std_n: 0, moment_std_nm: 0}"
POSTURE = np.array([1.57, -0.5, 0.2, 1.5, 0.1, -1.0, 0.3])


class _OwnSensors:
    """Adds MuJoCo's sensors of force and torque where the instrument is mounted."""

    def modify(self, spec):
        body = spec.site("tip").parent
        while body.parent.name != spec.site("flange").parent.name:
            body = body.parent
        body.add_site(name="mount")
        for name in ("force", "torque"):
            kind = getattr(mujoco.mjtSensor, f"mjSENS_{name.upper()}")
            spec.add_sensor(name=f"own_{name}", type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="mount")


def test_it_agrees_with_mujocos_own_sensors():
    """They give what the flange does to the instrument in the mount's frame, weight and inertia included."""
    push = PushConfig(at="shaft", distance_m=0.25, force_n=(4.0, -3.0, 2.0), start_s=0.0, duration_s=1.0)
    parts = [config.build(np.random.default_rng(0)) for config in (QUIET, push)]
    config = SceneConfig(robot=RobotConfig(name="lwr4plus"), theatre=False)
    scene = build(config, [*parts, _OwnSensors()])
    model, body, mount = scene.model, body_at_flange(scene), scene.model.site("mount").id
    plant = DynamicPlantConfig().build(scene, 0.001, parts, np.random.SeedSequence(0))
    plant.reset(POSTURE)
    data, weight = plant.data, model.body_subtreemass[body] * model.opt.gravity
    for k in range(60):
        R, p_WM = data.site_xmat[mount].reshape(3, 3).copy(), data.site_xpos[mount].copy()
        p_WT, centre = data.site_xpos[scene.tip_site].copy(), data.subtree_com[body].copy()
        bias = data.qfrc_bias[scene.dof_ids].copy()
        plant.step(np.zeros(7) if k < 30 else bias, np.zeros(7))
        force, torque = R @ data.sensordata[:3], R @ data.sensordata[3:6]
        moment = torque + np.cross(p_WM - p_WT, force) + np.cross(centre - p_WT, weight)
        seen = plant.state().wrench
        # ours is taken after the step, when the velocities have moved on: they are in the inertia's part
        np.testing.assert_allclose(seen.force, -force - weight, atol=1e-3)
        np.testing.assert_allclose(seen.moment, -moment, atol=1e-3)
    assert np.abs(seen.force).max() > 2.0
    assert np.abs(seen.moment).max() > 0.5


def test_at_rest_it_feels_nothing_and_a_push_as_it_is(scenario):
    """A force on the tip has no moment about it; one on the shaft has its lever."""
    push = "{type: push, at: shaft, distance_m: 0.3, force_n: [6, 2, -3], start_s: 1.0, rise_s: 0.5}"
    keys = (
        f"disturbances=[{QUIET_KEYS}, {push}]",
        "task.hold_start_s=4",
        "task.duration_s=1",
        "task.ramp_s=0.3",
    )
    trace = simulate(scenario(*keys, controller="rcm_inverse_dynamics"))
    t, force, moment = trace["t_s"].ravel(), trace.block("flange_force"), trace.block("flange_moment")
    still, pushed = np.searchsorted(t, 0.9), np.searchsorted(t, 3.5)
    assert np.abs(force[still]).max() < 1e-4
    assert np.abs(moment[still]).max() < 1e-4
    shaft = (trace.block("wrist") - trace.block("tip"))[pushed]
    lever = 0.3 * shaft / np.linalg.norm(shaft)
    np.testing.assert_allclose(force[pushed], [6.0, 2.0, -3.0], atol=0.02)
    np.testing.assert_allclose(moment[pushed], np.cross(lever, [6.0, 2.0, -3.0]), atol=0.01)


def test_the_wall_is_felt_at_the_port(scenario):
    """MuJoCo's sensors know nothing of it: its force acts as joint torques."""
    keys = (
        f"disturbances=[{QUIET_KEYS}, {{type: breathing, direction: [1, 0, 0], seen: hidden}}]",
        "trocar.wall={}",
        "task.hold_start_s=2",
        "task.duration_s=1",
        "task.ramp_s=0.3",
    )
    trace = simulate(scenario(*keys, controller="rcm_inverse_dynamics"))
    at = np.argmax(np.linalg.norm(trace.block("trocar_force")[:2000], axis=1))
    wall = -trace.block("trocar_force")[at]
    assert np.linalg.norm(wall) > 2.0
    np.testing.assert_allclose(trace.block("flange_force")[at], wall, atol=0.05)
    lever = (trace.block("trocar") - trace.block("tip"))[at]
    np.testing.assert_allclose(trace.block("flange_moment")[at], np.cross(lever, wall), atol=0.02)


def test_noise_and_bias_are_as_said(scenario):
    """Measured less true: the noise of all ticks, over a bias that the seed draws."""
    noise, bias = "force_std_n: 0.2, moment_std_nm: 0.01", "force_bias_std_n: 1.0, moment_bias_std_nm: 0.1"
    own = f"{{type: force_torque_sensor, {noise}, {bias}}}"
    biases = []
    for seed in (1, 2):
        keys = (f"disturbances=[{own}]", "task.duration_s=3")
        setup = prepare(scenario(*keys, controller="rcm_inverse_dynamics", seed=seed))
        simulation, plant, off = Simulation(setup), setup.plant, []
        for _ in range(1500):
            wrench = plant.state().wrench
            off.append(np.concatenate((wrench.force, wrench.moment)) - plant.hooks.memory_of(2)[6:12])
            simulation.tick()
        off = np.array(off)
        biases.append(off.mean(axis=0))
        np.testing.assert_allclose(off.std(axis=0), [0.2] * 3 + [0.01] * 3, rtol=0.1)
    assert np.abs(biases[0] - biases[1])[:3].max() > 0.2
    assert np.abs(biases[0] - biases[1])[3:].max() > 0.01


def test_without_an_instrument_it_is_refused():
    scene = build(SceneConfig(robot=RobotConfig(name="lwr4plus"), theatre=False, instrument=None))
    with pytest.raises(SurgsimError, match="no instrument at the flange"):
        QUIET.build(np.random.default_rng(0)).attach(scene, 0.001)
