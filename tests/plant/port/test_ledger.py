"""The energy ledger closes, converges, and sees energy that comes from nowhere."""

import mujoco
import numpy as np
import pytest
from port_alone import Port

from surgsim.plant.ledger import EnergyLedger


def _moving(rig, timestep_s, **options):
    made = rig(timestep_s, **options)
    rates = 2 * np.pi * np.array([1.0, 0.7, 1.3, 0.9, 1.7, 1.1, 2.1])
    made.torque = lambda t: 6.0 * np.sin(rates * t) * np.array([1, 1, 1, 1, 0.3, 0.3, 0.1])
    return made


def _exchanged(made):
    return sum(
        abs(made.term(name)) for name in ("actuator_work", "applied_work", "damping_loss", "friction_loss")
    )


@pytest.mark.parametrize("options", [{"ideal": True}, {}, {"robot": "panda"}], ids=["ideal", "wall", "panda"])
def test_the_residual_is_small_and_falls_with_the_timestep(rig, options):
    residual, exchanged = [], 0.0
    for timestep in (1e-3, 5e-4, 2.5e-4):
        made = _moving(rig, timestep, **options)
        worst = np.array(made.run(1.0, lambda m=made: m.term("residual")))
        residual.append(np.abs(worst).max())
        exchanged = _exchanged(made)
    assert exchanged > 0.05
    assert residual[0] < 1e-3 * exchanged
    assert residual[1] < 0.6 * residual[0]
    assert residual[2] < 0.6 * residual[1]


def test_the_residual_is_the_sum_of_the_other_terms(rig):
    made = _moving(rig, 0.001)
    made.run(0.3)
    e = dict(zip(EnergyLedger.COLUMNS, made.ledger.terms(), strict=True))
    change = e["kinetic"] + e["potential"] + e["spring"]
    works = (
        e["actuator_work"] + e["applied_work"] + e["contact_work"] - e["damping_loss"] - e["friction_loss"]
    )
    assert e["residual"] == pytest.approx(change - works, abs=1e-12)


def test_energies_are_mujoco_s_own(rig):
    """`mj_energyPos` and `mj_energyVel` take the velocity at the step's end: equal up to the timestep."""
    made = _moving(rig, 1e-5)
    model, data = made.scene.model, made.data

    def energy():
        mujoco.mj_energyPos(model, data)
        mujoco.mj_energyVel(model, data)
        return np.array(data.energy)

    start = energy()
    made.run(0.05)
    potential, kinetic = energy() - start
    assert kinetic > 1e-3
    assert made.term("kinetic") == pytest.approx(kinetic, rel=2e-3)
    assert made.term("potential") + made.term("spring") == pytest.approx(potential, rel=2e-3)


def test_works_are_the_integrals_of_power(rig):
    """Independent: powers at the instants summed over a short step."""
    made = _moving(rig, 1e-4)
    push = made.axes() @ [3.0, 1.0, 2.0]
    made.push = lambda t: push
    data, dofs = made.data, made.scene.dof_ids
    site = np.zeros((3, made.scene.model.nv))

    def powers():
        mujoco.mj_jac(
            made.scene.model,
            data,
            site,
            None,
            data.site_xpos[made.scene.trocar_site],
            made.scene.model.body("instrument").id,
        )
        return (
            data.qfrc_actuator[dofs] @ data.qvel[dofs],
            push @ (site @ data.qvel),
            made.scene.model.dof_damping @ data.qvel**2,
        )

    actuator, applied, damping = 1e-4 * np.array(made.run(0.5, powers)).sum(axis=0)
    assert made.term("actuator_work") == pytest.approx(actuator, rel=0.01, abs=1e-4)
    assert made.term("applied_work") == pytest.approx(applied, rel=0.01)
    assert made.term("damping_loss") == pytest.approx(damping, rel=0.01)


def test_energy_from_nowhere_is_seen(rig):
    made = _moving(rig, 0.001)
    made.run(0.2)
    before = made.term("residual")
    made.data.qvel[made.scene.dof_ids[1]] += 0.5
    mujoco.mj_step1(made.scene.model, made.data)
    made.run(0.02)
    assert abs(made.term("residual") - before) > 0.01


def test_breathing_does_work_on_the_wall_that_the_shaft_holds(rig):
    """Independent: the wall's force, which bears shaft and cannula, times the speed of the place of rest."""
    made = rig(seal_friction_n=0.0)
    made.stiffness, made.damping = 2000.0, 100.0
    across = made.axes()[:, 0]
    made.rest = lambda t: (0.005 * min(t, 1.0) * across, 0.005 * (t < 1.0) * across)
    made.reset()
    weight = np.array([0.0, 0.0, 0.05 * 9.81])
    power = made.run(1.5, lambda: 0.005 * (made.data.time < 1.0) * across @ (weight - made.port.force()))
    force = weight - made.port.force()  # of the wall on the cannula
    assert np.linalg.norm(force - weight) > 1.0
    assert made.term("applied_work") == pytest.approx(0.001 * np.sum(power), rel=0.01)
    spring = 0.5 * (force @ force - weight @ weight) / 1000.0
    assert made.term("spring") == pytest.approx(spring, rel=1e-3)
    assert abs(made.term("residual")) < 1e-3 * made.term("applied_work")


def test_without_the_port_the_bore_counts_as_applied(rig):
    made = rig()
    push = made.axes() @ [4.0, 0.0, 3.0]
    made.push = lambda t: push
    whole = made.ledger
    blind = made.books()
    for _ in range(300):
        made.port.act()
        for ledger in (whole, blind):
            ledger.before_step()
        mujoco.mj_step2(made.scene.model, made.data)
        for ledger in (whole, blind):
            ledger.after_step()
        made._settle(made.data.time)
    a, b = (dict(zip(EnergyLedger.COLUMNS, ledger.terms(), strict=True)) for ledger in (whole, blind))
    assert b["contact_work"] == b["friction_loss"] == 0.0
    assert b["applied_work"] == pytest.approx(
        a["applied_work"] + a["contact_work"] - a["friction_loss"], abs=1e-12
    )
    assert b["residual"] == pytest.approx(a["residual"], abs=1e-12)


def test_dry_friction_of_joints_is_a_loss(rig):
    made = _moving(rig, 0.0005, ideal=True)
    model = made.scene.model
    model.dof_frictionloss[made.scene.dof_ids] = 0.5
    data = mujoco.MjData(model)
    made.data, made.port = data, Port(made.scene, data)
    made.ledger = made.books(made.port)
    made.reset()
    losses = np.array(made.run(1.0, lambda: (made.term("friction_loss"), 0.5 * np.abs(data.qvel).sum())))
    assert losses[-1, 0] == pytest.approx(0.0005 * losses[:, 1].sum(), rel=0.05)
    assert np.diff(losses[:, 0]).min() > -1e-6
    assert made.term("contact_work") == pytest.approx(0.0, abs=1e-12)
    assert abs(made.term("residual")) < 1e-3 * _exchanged(made)


def test_start_begins_again(rig):
    made = _moving(rig, 0.001)
    made.run(0.2)
    assert abs(made.term("actuator_work")) > 0
    made.ledger.start()
    np.testing.assert_allclose(made.ledger.terms(), 0.0, atol=1e-15)
    made.step()
    terms = dict(zip(EnergyLedger.COLUMNS, made.ledger.terms(), strict=True))
    assert {name: value for name, value in terms.items() if value and name != "contact_stored"} == {}
