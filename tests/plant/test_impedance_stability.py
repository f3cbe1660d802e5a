"""A resolver around the arm's own impedance: where the two swing together, by a linear model of both.

The model has links, gears, motors and the reference, about the posture in which the circle begins:

    M q'' + b q' = K (θ − q)
    B_s θ'' = K_j (q_d − q) − D_j θ' + f D_j q_d' − K (θ − q) − D_s (θ' − q')
    q_d' = −k pinv(J) J q,    D_j = 2 ζ √(K_j M_jj)

with f = 1 where the torque beside the reference is commanded, and J of the tip and of the shaft's point at
the port. Sampling, delays and the lag of the torque loop are not in it.
"""

import itertools

import mujoco
import numpy as np
import pytest

from surgsim.errors import Outcome
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import simulate
from surgsim.simulate.setup import prepare

STIFF, SOFT = (5000.0,) * 4 + (2000.0,) * 3, (1000.0,) * 7
NUDGE = "{type: push, at: elbow, force_n: [0.0, 0.0, 0.3], start_s: 0.05, duration_s: 0.06, rise_s: 0.02}"


def scenario_of(arm, stiffness, gain, feedforward, **drive):
    drive = {"command": "joint_impedance", "impedance_stiffness_nm_per_rad": list(stiffness), **drive}
    return load_scenario(
        f"circle_{arm}",
        controller="joint_impedance",
        assignments=[
            f"robot.drive={drive}".replace("'", ""),
            f"controller.torque_law={{type: joint_reference, feedforward: {feedforward}}}",
            "controller.evaluate_at=measured",
            f"controller.resolver={{type: pinv, k_tip: {gain}, k_rcm: {gain}}}",
            f"disturbances=[{NUDGE}]",
            "task.hold_start_s=9.0",
            "theatre=false",
        ],
    )


def predicted(arm, stiffness, gain, feedforward, **drive):
    """Growth [1/s] and frequency [Hz] of the slowest oscillation to decay, or the fastest to grow."""
    scenario = scenario_of(arm, stiffness, gain, feedforward, **drive)
    setup = prepare(scenario)
    drive, scene, n = scenario.robot.drive, setup.arm.scene, setup.q_start.size
    model, data = scene.model, mujoco.MjData(scene.model)
    data.qpos[scene.qpos_ids] = setup.q_start
    mujoco.mj_forward(model, data)
    whole = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, whole)
    whole = whole[np.ix_(scene.dof_ids, scene.dof_ids)]
    appearing = np.array(drive.rotor_inertia_kg_m2) / drive.inertia_shaping
    M, b = whole - np.diag(model.dof_armature[scene.dof_ids]), np.diag(model.dof_damping[scene.dof_ids])
    K, B, K_j = (np.diag(values) for values in (drive.stiffness_nm_per_rad, appearing, stiffness))
    D_s = 2.0 * drive.loop_damping_ratio * np.sqrt(K * B)
    D_j = 2.0 * drive.impedance_damping_ratio * np.sqrt(K_j * np.diag(np.diag(whole)))
    reference = -gain * _projector(setup, data, np.array(scenario.trocar.position_m))
    zero, one = np.zeros((n, n)), np.eye(n)
    f = 1.0 if feedforward == "damping" else 0.0
    motor = [K - K_j + f * D_j @ reference, D_s, -K, -D_j - D_s, K_j]
    A = np.block(
        [
            [zero, one, zero, zero, zero],
            [np.linalg.solve(M, block) for block in (-K, -b, K, zero, zero)],
            [zero, zero, zero, one, zero],
            [np.linalg.solve(B, block) for block in motor],
            [reference, zero, zero, zero, zero],
        ]
    )
    modes = np.linalg.eigvals(A)
    swinging = modes[(modes.imag > 6.0) & (modes.imag < 90.0)]
    slowest = swinging[np.argmax(swinging.real)]
    return float(slowest.real), float(slowest.imag / (2.0 * np.pi))


def _projector(setup, data, port):
    """pinv(J) J of the tip and of the shaft's point at the port, across the shaft (n, n)."""
    scene, across = setup.arm.scene, np.zeros((3, setup.arm.scene.model.nv))
    tip = setup.arm.kinematics(setup.q_start).Jv_WT
    body = int(scene.model.site_bodyid[scene.tip_site])
    mujoco.mj_jac(scene.model, data, across, None, port, body)
    axis = data.site_xmat[scene.tip_site].reshape(3, 3)[:, 2]
    J = np.vstack([tip, np.linalg.svd(axis[None])[2][1:] @ across[:, scene.dof_ids]])
    return np.linalg.pinv(J) @ J


def seen(arm, stiffness, gain, feedforward, between_s):
    """The same of a run without dry friction, from the peaks of joint 2's velocity, and how it ends."""
    trace = simulate(scenario_of(arm, stiffness, gain, feedforward, coulomb_nm=0.0))
    t, x = trace["t_s"], trace.block("v")[:, 1]
    up = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    peaks = np.array([np.abs(x[a:b]).max() for a, b in itertools.pairwise(up)])
    inside = (t[up[:-1]] > between_s[0]) & (t[up[:-1]] < between_s[1])
    growth = np.polyfit(t[up[:-1]][inside], np.log(peaks[inside]), 1)[0]
    return growth, 1.0 / np.diff(t[up])[inside].mean(), trace.meta.ending.outcome


@pytest.mark.parametrize(
    ("arm", "stiffness", "gain", "feedforward", "between_s"),
    [
        ("fr3", STIFF, 20.0, "damping", (0.4, 1.9)),
        ("iiwa14", STIFF, 20.0, "damping", (0.3, 1.5)),
        ("panda", SOFT, 20.0, "none", (1.0, 5.0)),
    ],
)
def test_a_gain_past_what_the_gears_bear_swings_as_predicted(arm, stiffness, gain, feedforward, between_s):
    growth, frequency = predicted(arm, stiffness, gain, feedforward)
    found, hz, outcome = seen(arm, stiffness, gain, feedforward, between_s)
    assert growth > 1.0
    assert found == pytest.approx(growth, abs=1.0)
    assert hz == pytest.approx(frequency, rel=0.1)
    assert outcome is not Outcome.COMPLETED


@pytest.mark.parametrize(("arm", "gain"), [("fr3", 5.0), ("panda", 5.0)])
def test_a_smaller_gain_decays(arm, gain):
    assert predicted(arm, STIFF, gain, "damping")[0] < -1.0
    trace = simulate(scenario_of(arm, STIFF, gain, "damping", coulomb_nm=0.0))
    speed = np.abs(trace.block("v")).max(axis=1)
    assert speed[4000:8000].max() < 0.02 * speed[:1000].max()


def test_on_stiffer_gears_the_same_gain_decays():
    """It is the gears' springs that take the damping, which is the motors', from the links."""
    rates = [
        predicted("fr3", STIFF, 20.0, "damping", stiffness_nm_per_rad=[stiffness] * 7)[0]
        for stiffness in (1e4, 3e4, 1e6)
    ]
    assert rates[0] > rates[1] > rates[2]
    assert rates[2] < -1.0
