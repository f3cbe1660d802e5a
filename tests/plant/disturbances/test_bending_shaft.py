"""A shaft that bends: its deflections against beam theory, its swinging, and what counts as true."""

from itertools import pairwise

import mujoco
import numpy as np
import pytest

from surgsim.errors import Outcome, ScenarioError, SurgsimError
from surgsim.models.bending import BEND_JOINTS
from surgsim.models.build import build, build_arm
from surgsim.models.config import InstrumentConfig, RobotConfig, SceneConfig, TrocarConfig, WallConfig
from surgsim.plant.disturbances.bending_shaft import BendingShaftConfig
from surgsim.plant.disturbances.push import BODY, DISTANCE, SITE, PushConfig
from surgsim.plant.dynamic import DynamicPlant
from surgsim.recording.scene import body_poses, rebuild
from surgsim.simulate.loop import Simulation, simulate
from surgsim.simulate.setup import prepare
from surgsim.spatial import shaft_distance

Q = np.array([1.6, -0.4, 0.2, 1.5, 0.1, -1.0, 0.3])
STEEL = np.pi / 64.0 * 200e9 * (0.008**4 - 0.006**4)
TUBES = (
    (BendingShaftConfig(), STEEL),
    (
        BendingShaftConfig(outer_diameter_m=0.005, inner_diameter_m=0.004),
        np.pi / 64.0 * 200e9 * (0.005**4 - 0.004**4),
    ),
    (
        BendingShaftConfig(outer_diameter_m=0.0084, inner_diameter_m=0.0064, young_pa=45e9),
        np.pi / 64.0 * 45e9 * (0.0084**4 - 0.0064**4),
    ),
)
STATIC = BendingShaftConfig(level="static")
tubes = pytest.mark.parametrize(("config", "rigidity"), TUBES, ids=["8/6", "5/4", "composite"])


def scene_of(config=None, *, h=0.0005, length=0.4, port=None, mass=0.35):
    parts = [] if config is None else [config.build(np.random.default_rng(0))]
    tool = InstrumentConfig(shaft_length_m=length, mass_kg=mass)
    made = SceneConfig(
        robot=RobotConfig(name="lwr4plus"), instrument=tool, trocar=port, theatre=False, timestep_s=h
    )
    return build(made, parts), parts


def beam(load, at, length):
    """Deflection [m/N] and slope at `at` of a cantilever of E I = 1 under a unit force at `load`."""
    near = min(load, at)
    slope = load * near - 0.5 * near**2
    return 0.5 * load * near**2 - near**3 / 6.0 + (at - near) * slope, slope


class Held:
    """A scene without weight whose arm is held, and its shaft at rest under forces across it."""

    def __init__(self, scene):
        self.scene, self.model = scene, scene.model
        self.model.opt.gravity[:] = 0.0
        self.data = mujoco.MjData(self.model)
        self.data.qpos[scene.qpos_ids] = Q
        first = int(scene.dof_ids[-1]) + 1
        self.bends = slice(first, first + len(BEND_JOINTS))
        names = BEND_JOINTS if self.model.nv > 10 else ()
        joints = [self.model.joint(name) for name in names]
        self.stiffness = np.array([float(np.ravel(joint.stiffness)[0]) for joint in joints])
        mujoco.mj_forward(self.model, self.data)
        self.axes = self.data.site_xmat[scene.shaft_entry_site].reshape(3, 3).copy()
        self.entry = self.data.site_xpos[scene.shaft_entry_site].copy()

    def point(self, a, length):
        """A point of the shaft `a` from its entry, and the body that it is on."""
        part = PushConfig(at="shaft", distance_m=length - a).build(np.random.default_rng(0))
        part.attach(self.scene, 0.001)
        gains, data = part.gains, self.data
        site = int(gains[SITE])
        back = gains[DISTANCE] * data.site_xmat[site].reshape(3, 3)[:, 2]
        return data.site_xpos[site] - back, int(gains[BODY])

    def load(self, forces, length):
        """Bend under `forces`, pairs of a place and a vector in the entry's axes."""
        jacobian = np.zeros((3, self.model.nv))
        for _ in range(20):
            torque = np.zeros(len(BEND_JOINTS))
            for a, force in forces:
                mujoco.mj_jac(self.model, self.data, jacobian, None, *self.point(a, length))
                torque += jacobian[:, self.bends].T @ (self.axes @ force)
            self.data.qpos[self.bends] = torque / self.stiffness
            mujoco.mj_forward(self.model, self.data)

    def deflection(self, a, length):
        """Across the straight shaft (3,) [m], in the entry's axes."""
        return self.axes.T @ (self.point(a, length)[0] - self.entry) * (1.0, 1.0, 0.0)


@tubes
@pytest.mark.parametrize("length", [0.4, 0.3, 0.18])
@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (0.6, -0.8, 0.0)])
def test_a_force_at_the_tip_deflects_it_as_a_beam(config, rigidity, length, direction):
    held = Held(scene_of(config, length=length, h=0.0001)[0])
    force = 0.02 * np.array(direction)  # so small that the beam's theory is linear
    held.load([(length, force)], length)
    np.testing.assert_allclose(
        held.deflection(length, length), length**3 / (3.0 * rigidity) * force, rtol=1e-4, atol=1e-9
    )
    turned = held.axes.T @ held.data.site_xmat[held.scene.tip_site].reshape(3, 3)[:, 2]
    slope = length**2 / (2.0 * rigidity)
    np.testing.assert_allclose(turned[:2], slope * force[:2], rtol=1e-4, atol=1e-12)


def test_the_stiffness_of_three_tubes_at_three_lengths():
    """3 E I / L^3 in N/mm, as a handbook gives it."""
    wanted = {0.4: (1.29, 0.17, 0.34), 0.3: (3.05, 0.40, 0.81), 0.18: (14.1, 1.86, 3.75)}
    for length, row in wanted.items():
        for (config, _), stiffness in zip(TUBES, row, strict=True):
            held = Held(scene_of(config, length=length, h=0.0001)[0])
            held.load([(length, np.array([0.01, 0.0, 0.0]))], length)
            assert 1e-3 * 0.01 / held.deflection(length, length)[0] == pytest.approx(stiffness, rel=0.02)


@tubes
@pytest.mark.parametrize("port", [0.2, 0.22, 0.26, 0.3, 0.35, 0.38])
def test_a_force_at_the_port_and_one_at_the_tip_deflect_both_places(config, rigidity, port):
    length = 0.4
    held = Held(scene_of(config)[0])
    tip_force, port_force = np.array([0.02, 0.0, 0.0]), np.array([0.0, 0.03, 0.0])
    held.load([(length, tip_force), (port, port_force)], length)
    for a in (port, length):
        wanted = (
            np.array([0.02 * beam(length, a, length)[0], 0.03 * beam(port, a, length)[0], 0.0]) / rigidity
        )
        np.testing.assert_allclose(held.deflection(a, length), wanted, rtol=0.02, atol=2e-9)
    turned = held.axes.T @ held.data.site_xmat[held.scene.tip_site].reshape(3, 3)[:, 2]
    slopes = (
        np.array([0.02 * beam(length, length, length)[1], 0.03 * beam(port, length, length)[1]]) / rigidity
    )
    np.testing.assert_allclose(turned[0], slopes[0], rtol=1e-3)
    np.testing.assert_allclose(turned[1], slopes[1], rtol=0.05)


@pytest.mark.parametrize("h", [0.001, 0.0005, 0.00025])
@pytest.mark.parametrize(("config", "rigidity"), TUBES[:2], ids=["8/6", "5/4"])
def test_it_swings_at_a_cantilevers_frequency(config, rigidity, h):
    """That of the even mass of the shaft, less the little that a step of this length slows it."""
    scene, _ = scene_of(config.model_copy(update={"damping_ratio": 0.0}), h=h)
    held = Held(scene)
    scene.model.dof_armature[scene.dof_ids] = 1e9
    held.load([(0.4, np.array([0.02, 0.0, 0.0]))], 0.4)
    seen = []
    for _ in range(round(0.5 / h)):
        mujoco.mj_step(scene.model, held.data)
        mujoco.mj_kinematics(scene.model, held.data)
        seen.append(held.deflection(0.4, 0.4)[0])
    shaft_kg = 0.35 * (0.10 - 0.02) / (0.24 - 0.02)  # of two rods with the instrument's centre of mass
    w = 3.516 * np.sqrt(rigidity / (shaft_kg * 0.4**3))
    assert _frequency(np.array(seen), h) == pytest.approx(2.0 / h * np.arctan(0.5 * w * h), rel=2e-3)
    assert w * h < 0.3
    late, early = np.array(seen)[-round(0.1 / h) :], np.array(seen)[: round(0.1 / h)]
    assert np.abs(late).max() == pytest.approx(np.abs(early).max(), rel=0.03)  # nothing damps it


def _frequency(x, h):
    """Mean angular frequency, from the first to the last upward passage through zero [rad/s]."""
    up = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    exact = up + x[up] / (x[up] - x[up + 1])
    return float(2.0 * np.pi * (len(exact) - 1) / (h * (exact[-1] - exact[0])))


@pytest.mark.parametrize("h", [0.001, 0.00025])
def test_its_first_mode_is_damped_as_said(h):
    scene, _ = scene_of(BendingShaftConfig(damping_ratio=0.03), h=h)
    held = Held(scene)
    scene.model.dof_armature[scene.dof_ids] = 1e9
    held.load([(0.4, np.array([0.02, 0.0, 0.0]))], 0.4)
    seen = []
    for _ in range(round(0.3 / h)):
        mujoco.mj_step(scene.model, held.data)
        mujoco.mj_kinematics(scene.model, held.data)
        seen.append(held.deflection(0.4, 0.4)[0])
    x = np.array(seen)
    peaks = x[1:-1][(x[1:-1] > x[:-2]) & (x[1:-1] >= x[2:]) & (x[1:-1] > 0.0)]
    decrement = np.log(peaks[1] / peaks[8]) / 7.0
    assert decrement / (2.0 * np.pi) == pytest.approx(0.03, rel=0.08)


@pytest.mark.parametrize(("h", "settling"), [(0.001, 0.002), (0.001, 0.005), (0.00025, 0.005), (0.001, 0.01)])
@tubes
def test_a_static_shaft_goes_to_the_beams_shape_as_two_equal_lags_and_does_not_swing(
    config, rigidity, h, settling
):
    """Under a force that is there from the start, as 1 - (1 + t/T) exp(-t/T) but for what a step is late."""
    scene, _ = scene_of(config.model_copy(update={"level": "static", "settling_s": settling}), h=h)
    held = Held(scene)
    scene.model.dof_armature[scene.dof_ids] = 1e9
    body = int(scene.model.site_bodyid[scene.tip_site])
    force, seen = np.array([0.02, 0.0, 0.0]), []
    for _ in range(round(14 * settling / h)):
        torque = np.zeros(scene.model.nv)
        tip = held.data.site_xpos[scene.tip_site]
        mujoco.mj_applyFT(scene.model, held.data, held.axes @ force, np.zeros(3), tip, body, torque)
        held.data.qfrc_applied[:] = torque
        mujoco.mj_step(scene.model, held.data)
        mujoco.mj_kinematics(scene.model, held.data)
        seen.append(held.deflection(0.4, 0.4)[0])
    x = np.array(seen) / (force[0] * 0.4**3 / (3.0 * rigidity))
    n, pole = np.arange(1, len(x) + 1), (2.0 * settling - h) / (2.0 * settling + h)
    first = 1.0 / (settling / h + 0.5) ** 2
    np.testing.assert_allclose(x, 1.0 - pole**n * (1.0 + ((1.0 - first) / pole - 1.0) * n), atol=5e-4)
    assert x[-1] == pytest.approx(1.0, abs=3e-4)
    t = h * n / settling
    np.testing.assert_allclose(x, 1.0 - (1.0 + t) * np.exp(-t), atol=0.4 * h / settling)


@pytest.mark.parametrize("config", [BendingShaftConfig(), STATIC], ids=["dynamic", "static"])
def test_straight_it_has_the_inertia_of_the_rigid_instrument(config):
    (bent, _), (stiff, _) = scene_of(config), scene_of()
    held, plain = [], []
    for scene, found in ((bent, held), (stiff, plain)):
        data = mujoco.MjData(scene.model)
        data.qpos[scene.qpos_ids] = Q
        data.qvel[scene.dof_ids] = np.linspace(-0.5, 0.7, 7)
        mujoco.mj_forward(scene.model, data)
        M = np.zeros((scene.model.nv, scene.model.nv))
        mujoco.mj_fullM(scene.model, data, M)
        found += [M[:7, :7], data.qfrc_bias[:7], data.site_xpos[scene.tip_site], data.subtree_com[0]]
    for one, other in zip(held, plain, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)


def test_the_controllers_model_stays_as_it_is(scenario):
    bent = prepare(scenario("disturbances=[{type: bending_shaft}]"))
    assert bent.arm.scene.model.nv == 7
    assert bent.scene.model.nv == 7 + len(BEND_JOINTS)
    assert bent.arm.scene is build_arm(scenario().scene)


def test_the_weight_of_a_static_shaft_moves_the_arm_as_that_of_a_rigid_one():
    """What `hang` adds is felt by the shaft's own joints alone."""
    moved = []
    for config in (STATIC, BendingShaftConfig(level="static", young_pa=1e13)):
        plant = _plant(0.0005, ledger=False, config=config)
        plant.reset(Q)
        hold = plant.world.tau.copy()
        for _ in range(100):
            plant.step(hold, np.zeros(7))
        moved.append(plant.truth().q)
    np.testing.assert_allclose(moved[0], moved[1], atol=1e-9)
    np.testing.assert_allclose(moved[0], Q, atol=1e-9)


def _plant(h, *, wall=None, ledger=True, config=None, aside=0.0):
    axis_home = Held(scene_of(h=h)[0])
    place = axis_home.entry + axis_home.axes @ [aside, 0.0, 0.22]
    port = TrocarConfig(position_m=tuple(place), axis=tuple(-axis_home.axes[:, 2]), wall=wall)
    scene, parts = scene_of(config or BendingShaftConfig(), h=h, port=port)
    return DynamicPlant(scene, 0.001, parts, energy_ledger=ledger)


@pytest.mark.parametrize("config", [BendingShaftConfig(), STATIC], ids=["dynamic", "static"])
@pytest.mark.parametrize("wall", [None, WallConfig()], ids=["ideal", "wall"])
def test_energy_only_falls_where_nothing_drives_it(wall, config):
    """The arm falls through the port, which bends the shaft; what the ledger cannot explain is small."""
    risen = []
    for h in (0.0005, 0.00025):
        plant = _plant(h, wall=wall, config=config)
        plant.reset(Q)
        names = [name for block in plant.columns for name in block.columns]
        rows = []
        for _ in range(250):
            plant.step(np.zeros(7), np.zeros(7))
            rows.append(dict(zip(names, plant.truth().values, strict=True)))
        total = np.array([sum(r[f"energy_{k}_j"] for k in ("kinetic", "potential", "spring")) for r in rows])
        stored = np.array([r["energy_contact_stored_j"] for r in rows])
        total = total + stored
        residual = np.abs([r["energy_residual_j"] for r in rows]).max()
        kinetic = max(r["energy_kinetic_j"] for r in rows)
        assert kinetic > 10.0
        assert wall is None or max(r["energy_spring_j"] for r in rows) > 0.1
        risen.append((max(0.0, float((total - np.minimum.accumulate(total)).max())), residual / kinetic))
    assert max(rise for rise, _ in risen) < 1e-9
    assert risen[0][1] < 5e-4
    assert risen[1][1] < 0.6 * risen[0][1]  # of first order: Coriolis forces, as of the rigid arm


@pytest.mark.parametrize("config", [BendingShaftConfig(damping_ratio=0.0), STATIC], ids=["dynamic", "static"])
def test_the_run_begins_at_rest_under_its_own_weight(config):
    plant = _plant(0.0005, ledger=False, config=config)
    plant.reset(Q)
    start = plant.truth()
    straight = Held(scene_of()[0])
    sag = straight.axes.T @ (start.p_WT - straight.data.site_xpos[straight.scene.tip_site])
    shaft_kg = 0.35 * (0.10 - 0.02) / (0.24 - 0.02)
    across = 9.81 * straight.axes.T @ np.array([0.0, 0.0, -1.0])
    wanted = shaft_kg / 0.4 * across[:2] * 0.4**4 / (8.0 * STEEL)  # q L^4 / 8 E I
    np.testing.assert_allclose(sag[:2], wanted, rtol=0.02)
    hold = plant.world.tau.copy()
    for _ in range(100):
        plant.step(hold, np.zeros(7))
    np.testing.assert_allclose(plant.truth().p_WT, start.p_WT, atol=1e-7)


def test_the_rcm_error_is_the_distance_of_the_bent_shaft():
    """Of its pieces, whatever they are bent by."""
    plant, rng = _plant(0.0005, ledger=False), np.random.default_rng(3)
    plant.reset(Q)
    scene, data = plant._scene, plant.data
    first = int(scene.dof_ids[-1]) + 1
    worst = 0.0
    for _ in range(50):
        data.qpos[first : first + 8] = rng.uniform(-0.02, 0.02, 8)
        plant.see()
        truth = plant.truth()
        joints = [scene.model.joint(name).id for name in BEND_JOINTS[::2]]
        ends = np.array([data.site_xpos[scene.shaft_entry_site], *data.xanchor[joints], truth.p_WT])
        least = min(_segment_distance(truth.p_WC, a, b) for a, b in pairwise(ends))
        error = float(shaft_distance(truth.p_WC, truth.p_WT, truth.p_WR))
        assert error == pytest.approx(least, rel=2e-3, abs=1e-9)
        straight = float(shaft_distance(truth.p_WC, truth.p_WT, ends[0]))
        worst = max(worst, abs(straight - least))
    assert worst > 1e-3  # the line from the entry to the tip would not have told it


def _segment_distance(p, a, b):
    s = np.clip((p - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    return float(np.linalg.norm(p - a - s * (b - a)))


@pytest.mark.parametrize(
    ("config", "h"),
    [(BendingShaftConfig(damping_ratio=0.3), 0.00025), (STATIC, 0.001)],
    ids=["dynamic", "static"],
)
def test_pressed_on_the_wall_it_bends_by_the_walls_force(config, h):
    """The arm is held 3 mm beside the port: wall, shaft and bore are in balance."""
    wall = WallConfig(seal_friction_n=0.0)
    plant = _plant(h, wall=wall, ledger=False, config=config, aside=0.003)
    scene, model = plant._scene, plant._scene.model
    model.dof_armature[scene.dof_ids] = 1e9
    model.opt.gravity[:] = 0.0
    model.qpos_spring[scene.cannula_qpos_ids] = 0.0  # they bear the cannula's weight
    plant.reset(Q)
    for _ in range(1500):
        plant.step(np.zeros(7), np.zeros(7))
    truth = plant.truth()
    held = Held(scene_of()[0])
    push = -(held.axes.T @ truth.f_C)[:2]  # on the shaft
    bent = (held.axes.T @ (truth.p_WT - held.entry))[:2]
    wanted = push * beam(0.22, 0.4, 0.4)[0] / STEEL
    assert np.linalg.norm(push) > 1.0
    np.testing.assert_allclose(bent, wanted, rtol=0.02, atol=2e-6)
    compliance = 1.0 / 1000.0 + 1.0 / 20000.0 + beam(0.22, 0.22, 0.4)[0] / STEEL
    assert np.linalg.norm(push) == pytest.approx((0.003 - scene.clearance_m) / compliance, rel=0.02)


@pytest.mark.parametrize("level", ["dynamic", "static"])
@pytest.mark.parametrize("drive", ["ideal", "real"])
def test_the_timestep_matters_as_little_as_to_a_rigid_shaft(scenario, drive, level):
    """Under tissue; the errors fall with the timestep."""

    def errors(shaft):
        tips = []
        for h in (0.0005, 0.00025, 0.0000625):
            made = scenario(
                f"simulation.timestep_s={h}",
                f"disturbances=[{shaft}{{type: tissue}}]",
                f"robot.drive={drive}",
                controller="joint_impedance",
            )
            trace = simulate(made)
            assert trace.meta.ending.outcome is Outcome.COMPLETED
            tips.append(trace.block("tip"))
        return [np.abs(tip - tips[-1]).max() for tip in tips[:-1]]

    stiff, bent = errors(""), errors(f"{{type: bending_shaft, level: {level}}}, ")
    assert bent[0] < 1.5 * stiff[0]
    assert bent[1] < 0.65 * bent[0]


def test_on_stiff_gears_it_moves_as_on_ideal_drives(scenario):
    """What the drives take the arm's inertia for is what MuJoCo's joints have."""
    stiff = (
        "{stiffness_nm_per_rad: 1.0e8, rotor_inertia_kg_m2: 0.4, inertia_shaping: 1.0, loop_delay_s: 0.0, "
        "loop_cutoff_hz: 1.0e5, coulomb_nm: 0.0}"
    )
    paths = []
    for drive in ("ideal", stiff):
        made = scenario("simulation.timestep_s=0.0005", f"robot.drive={drive}", _SHAFT)
        setup = prepare(made)
        if drive == "ideal":
            setup.scene.model.dof_armature[setup.scene.dof_ids] = 0.4
        setup.plant.reset(setup.q_start)
        hold = setup.plant.world.tau.copy()
        rows = []
        for k in range(300):
            torque = hold + np.array([3.0, 2.0, 1.0, 1.0, 0.5, 0.5, 0.2]) * np.sin(0.06 * k)
            setup.plant.step(torque, np.zeros(7))
            rows.append([*setup.plant.truth().q, *setup.plant.data.qpos[7:15]])
        paths.append(np.array(rows))
    moved = np.ptp(paths[0], axis=0)
    assert (np.abs(paths[1] - paths[0]).max(axis=0) < 0.02 * moved + 1e-6).all()


_SHAFT = "disturbances=[{type: bending_shaft}]"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            (
                _SHAFT,
                "instrument=null",
                "trocar=null",
                "controller=mink",
                "start.q_rad=[1.6, -0.4, 0.2, 1.5, 0.1, -1.0, 0.3]",
                "task.start_m=null",
            ),
            "needs an instrument, and the scenario has none",
        ),
        (
            (_SHAFT, "simulation.timestep_s=0.001", "trocar.wall={}"),
            "the shaft in the wall's bore needs a shorter timestep_s than 0.001: 0.0005 will do",
        ),
        (
            ("disturbances=[{type: bending_shaft}, {type: bending_shaft}]",),
            "the shaft bends already; name it once",
        ),
        (
            ("disturbances=[{type: bending_shaft, inner_diameter_m: 0.008}]",),
            "inner_diameter_m 0.008 must be below the outer one, 0.008",
        ),
        (
            (
                "disturbances=[{type: bending_shaft, young_pa: 1.0e13}]",
                "instrument.shaft_length_m=0.3",
                "instrument.mass_kg=0.2",
            ),
            "the shaft swings at .* Hz, which needs a timestep_s of at most .*, not 0.001",
        ),
        (
            ("disturbances=[{type: bending_shaft, young_pa: 1.0e8}]",),
            "too soft to bear its own weight",
        ),
        (
            ("disturbances=[{type: bending_shaft, level: static, young_pa: 1.0e8}]",),
            "too soft to bear its own weight",
        ),
        (
            ("disturbances=[{type: bending_shaft, level: static, settling_s: 0.0015}]",),
            r"settling_s 0\.0015 must be at least 2 timesteps of 0\.001 s",
        ),
        (
            ("disturbances=[{type: bending_shaft, level: static, settling_s: 0.002}]", "trocar.wall={}"),
            r"a shorter timestep_s than 0\.001: 0\.00025 will do, or a longer settling_s",
        ),
    ],
)
def test_what_cannot_be_is_refused(scenario, changes, message):
    with pytest.raises(SurgsimError, match=message):
        Simulation(prepare(scenario(*changes))).run()


def test_a_tube_must_be_one(scenario):
    with pytest.raises(ScenarioError, match=r"inner_diameter_m 0\.006 must be below the outer one, 0\.005"):
        scenario("disturbances=[{type: bending_shaft, outer_diameter_m: 0.005}]")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ("level: static, damping_ratio: 0.1", "damping_ratio is of a shaft with `level: dynamic`"),
        ("settling_s: 0.01", "settling_s is of a shaft with `level: static`"),
    ],
)
def test_a_key_of_the_other_level_is_refused(scenario, changes, message):
    with pytest.raises(ScenarioError, match=message):
        scenario(f"disturbances=[{{type: bending_shaft, {changes}}}]")


def test_a_push_on_the_shaft_acts_on_the_piece_that_has_the_point():
    held = Held(scene_of(BendingShaftConfig())[0])
    names = [held.model.body(held.point(a, 0.4)[1]).name for a in (0.01, 0.1, 0.2, 0.3, 0.39)]
    assert names == ["instrument", "shaft1", "shaft2", "shaft3", "shaft4"]
    for a in (0.01, 0.1, 0.2, 0.3, 0.39):
        np.testing.assert_allclose(held.point(a, 0.4)[0], held.entry + a * held.axes[:, 2], atol=1e-12)


def test_a_run_can_be_forked_and_its_scene_is_rebuilt(scenario):
    """On real drives, behind a wall: what the shaft does is in MuJoCo's data and in the trace."""
    made = scenario("simulation.timestep_s=0.0005", "robot.drive=real", "trocar.wall={}", _SHAFT)
    one = Simulation(prepare(made))
    one.advance(50)
    other = one.fork()
    for simulation in (one, other):
        simulation.advance(60)
    trace = one.trace()
    assert trace.equals(other.trace())
    rows = np.array([0, 40, len(trace) - 1])
    scene = rebuild(made)
    jaws = body_poses(scene, trace, rows).position[:, scene.model.body("jaws").id]
    np.testing.assert_allclose(jaws, trace.block("tip")[rows], atol=1e-9)
    assert np.abs(trace["bend1_x_rad"]).max() > 1e-6


def test_an_instrument_from_a_file_does_not_bend(scenario, tmp_path):
    file = tmp_path / "hook.xml"
    file.write_text(
        '<mujoco model="hook"><worldbody><body name="hook"><inertial pos="0 0 0.1" mass="0.3" '
        'diaginertia="0.003 0.003 0.0001"/><site name="shaft_entry" pos="0 0 0.04"/>'
        '<site name="tip" pos="0 0 0.44"/></body></worldbody></mujoco>'
    )
    with pytest.raises(SurgsimError, match="is for the shipped instrument, not for one from a file"):
        prepare(scenario(_SHAFT, f"instrument={{mjcf: {file}}}"))


def test_stiff_tissue_needs_a_shorter_timestep_at_a_light_tip(scenario):
    stiff = "{type: tissue, stiffness_n_per_m: 20000.0, drag_n_s_per_m: 50.0}"
    prepare(scenario(f"disturbances=[{stiff}]"))
    with pytest.raises(SurgsimError, match=r"k h\^2 \+ b h must be at most 0\.009\d* kg"):
        prepare(scenario(f"disturbances=[{{type: bending_shaft}}, {stiff}]"))
