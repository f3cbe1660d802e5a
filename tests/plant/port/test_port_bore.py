"""The law of the bore: geometry, clearance, isotropy, seal, and the way in."""

import mujoco
import numpy as np
import pytest

CLEARANCE_M = 0.00045
K_WALL, K_CONTACT = 1000.0, 20000.0


def _placed(rig, cannula, **wall):
    """The force (3,) in the port's frame with the cannula displaced by `cannula` (3,) [m], all at rest."""
    made = rig(**wall)
    made.reset(cannula=cannula)
    return made.axes().T @ made.port.force(), made


@pytest.mark.parametrize("robot", ["lwr4plus", "panda"])
def test_inside_the_clearance_nothing_pushes(rig, robot):
    rng = np.random.default_rng(1)
    made = rig(robot=robot)
    for _ in range(20):
        x, y, z = rng.uniform(-0.7, 0.7, 3) * CLEARANCE_M
        made.reset(cannula=(x, y, z))
        made.port.act()
        np.testing.assert_array_equal(made.port.force(), 0.0)
        np.testing.assert_array_equal(made.data.qfrc_applied, 0.0)


@pytest.mark.parametrize("press_m", [1e-6, 0.0002, 0.002])
def test_beyond_the_clearance_the_force_is_stiffness_times_penetration_the_same_in_every_direction(
    rig, press_m
):
    made = rig()
    forces = []
    for angle in np.radians(np.arange(0.0, 360.0, 7.0)):
        direction = np.array([np.cos(angle), np.sin(angle), 0.0])
        made.reset(cannula=tuple((CLEARANCE_M + press_m) * direction))
        force = made.axes().T @ made.port.force()
        np.testing.assert_allclose(force, -K_CONTACT * press_m * direction, rtol=1e-6, atol=1e-9)
        forces.append(np.linalg.norm(force))
    ripple = np.ptp(forces) / np.mean(forces)
    assert ripple < 1e-9 / press_m * 1e-3  # rounding of a length of 1 m against the penetration


def test_bore_and_shaft_diameters_set_the_clearance(rig):
    assert rig().scene.clearance_m == pytest.approx((0.0089 - 0.008) / 2)


def test_generalized_forces_are_those_of_the_force_and_its_reaction_at_the_cannula(rig):
    """Independent: MuJoCo's Jacobians of the two bodies at the cannula's centre."""
    made = rig()
    made.reset(cannula=(0.0011, -0.0007, 0.0003))
    made.data.qvel[:] = 0.02 * np.random.default_rng(0).standard_normal(made.scene.model.nv)
    mujoco.mj_step1(made.scene.model, made.data)
    made.port.act()
    model, data, centre = made.scene.model, made.data, made.port.position()
    shaft, cannula = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, shaft, None, centre, model.body("instrument").id)
    mujoco.mj_jac(model, data, cannula, None, centre, model.body("cannula").id)
    force = made.port.force()
    assert np.linalg.norm(force) > 10
    np.testing.assert_allclose(data.qfrc_applied, (cannula - shaft).T @ force, atol=1e-12)


def test_damping_acts_on_the_rate_of_penetration_and_never_pulls(rig):
    made = rig()
    made.reset(cannula=(0.001, 0.0, 0.0))
    speeds = np.linspace(-2.0, 2.0, 9)
    seen = []
    for speed in speeds:
        made.data.qvel[made.scene.cannula_dof_ids[0]] = speed
        mujoco.mj_step1(made.scene.model, made.data)
        seen.append(-float(made.axes()[:, 0] @ made.port.force()))
    expected = np.maximum(0.0, K_CONTACT * (0.001 - CLEARANCE_M) + 15.0 * speeds)
    np.testing.assert_allclose(seen, expected, rtol=1e-9, atol=1e-12)
    assert expected[0] == 0.0


def test_force_reads_and_changes_nothing(rig):
    made = rig()
    made.push = lambda t: made.axes()[:, 2] * 3.0
    made.run(0.05)
    before = made.port.force()
    applied = made.data.qfrc_applied.copy()
    np.testing.assert_array_equal(made.port.force(), before)
    np.testing.assert_array_equal(made.data.qfrc_applied, applied)
    made.port.act()
    inside = made.port.bore.acting.contact_cannula + made.port.bore.acting.seal_cannula
    np.testing.assert_allclose(made.axes() @ inside, before, atol=1e-12)


def _slide(rig, target_n, **wall):
    """The rig with its arm limp, pushed along the shaft by a force that grows to `target_n` in 0.2 s."""
    made = rig(seal_friction_n=2.0, **wall)
    axis = made.axes()[:, 2]
    made.stiffness, made.damping = 0.0, 5.0
    made.push = lambda t: axis * target_n * min(1.0, t / 0.2)
    return made


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_seal_sticks_below_its_friction_without_creep(rig, sign):
    made = _slide(rig, 1.6 * sign)
    start = made.shaft()[1]
    made.run(2.0)
    for _ in range(3):
        made.run(0.5)
        stretch = made.port.force() @ made.shaft_axis() / 20000.0
        assert made.shaft()[1] - start + stretch == pytest.approx(0.0, abs=1e-9)  # all of the way is elastic
    assert -made.port.force() @ made.shaft_axis() == pytest.approx(1.6 * sign, rel=0.02)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_sliding_seal_resists_with_its_friction_and_gives_no_energy(rig, sign):
    made = _slide(rig, 6.0 * sign)
    start = made.shaft()[1]
    made.run(0.3)
    losses = np.array(made.run(0.5, lambda: made.term("friction_loss")))
    speed = made.data.qvel[made.scene.dof_ids]
    assert np.linalg.norm(speed) > 0.01
    travel = made.shaft()[1] - start
    assert abs(travel) > 0.005
    assert made.port.force() @ made.shaft_axis() == pytest.approx(-2.0 * sign, rel=1e-6)
    assert (np.diff(losses) >= 0.0).all()
    assert losses[-1] == pytest.approx(2.0 * abs(travel), rel=0.05)


def test_the_seal_s_friction_turns_with_the_motion(rig):
    """Back and forth: the work over whole periods is the friction's times the way, never given back."""
    made = rig(seal_friction_n=2.0)
    axis = made.axes()[:, 2]
    made.stiffness, made.damping = 50.0, 2.0
    made.push = lambda t: axis * 8.0 * np.sin(2 * np.pi * t)
    seen = np.array(
        made.run(3.0, lambda: (made.shaft()[1], made.term("friction_loss"), made.port.bore.acting.stored[1]))
    )
    way, loss, stored = np.abs(np.diff(seen[:, 0])).sum(), seen[:, 1], seen[:, 2]
    assert way > 0.02
    assert 0.7 * 2.0 * way < loss[-1] < 1.01 * 2.0 * way
    dissipated = loss - stored
    assert (np.maximum.accumulate(dissipated) - dissipated).max() < 1e-6


def test_roll_about_the_shaft_is_free(rig):
    made = rig()
    made.reset(cannula=(0.0, 0.0, 0.0))
    made.data.qvel[made.scene.dof_ids[6]] = 1.0  # joint 7 turns about the shaft
    mujoco.mj_step1(made.scene.model, made.data)
    made.port.act()
    np.testing.assert_allclose(made.port.force(), 0.0, atol=1e-9)


def _above(rig, lateral_m, gap_m=0.004):
    """An arm with its tip `gap_m` above the port's centre and `lateral_m` beside its axis."""
    return rig(offset_m=(lateral_m, 0.0, 0.18 + gap_m), seal_friction_n=0.0)


@pytest.mark.parametrize("lateral_m", [0.0, 0.002, 0.02])
def test_a_shaft_outside_is_not_touched(rig, lateral_m):
    made = _above(rig, lateral_m)
    made.port.act()
    np.testing.assert_array_equal(made.port.force(), 0.0)
    assert not made.port.engaged


def _insert(made, way_m=0.03, seconds=1.0):
    """Drive the tip along the port's axis; returns the force's magnitude at each step (n,)."""
    model, data = made.scene.model, made.data
    jac = np.zeros((3, model.nv))
    axis = -made.axes()[:, 2]
    turn = np.zeros((3, model.nv))
    made.stiffness, made.damping = 2000.0, 60.0

    def look():
        mujoco.mj_jacSite(model, data, jac, turn, made.scene.tip_site)
        J = np.vstack([jac, turn])[:, made.scene.dof_ids]
        speed = np.concatenate([axis * way_m / seconds, np.zeros(3)])
        made.q = made.q + model.opt.timestep * np.linalg.pinv(J) @ speed
        return np.linalg.norm(made.port.force())

    return np.array(made.run(seconds, look))


def test_a_slightly_misaligned_tip_finds_its_way_in(rig):
    made = _above(rig, 0.0025)
    forces = _insert(made)
    assert made.port.engaged
    assert forces.max() > 0.5  # the funnel pushed
    away, _ = made.shaft()
    assert CLEARANCE_M < np.linalg.norm(away) < CLEARANCE_M + 0.002
    assert np.abs(np.diff(forces)).max() < 0.5  # no jump on the way


def test_a_tip_beside_the_mouth_stays_outside(rig):
    made = _above(rig, 0.006)
    forces = _insert(made)
    assert not made.port.engaged
    np.testing.assert_array_equal(forces, 0.0)
