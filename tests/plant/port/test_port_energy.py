"""Contact creates no energy, and results converge with the timestep."""

from itertools import pairwise

import numpy as np
import pytest

from surgsim.plant.ledger import EnergyLedger

STEPS_S = (1e-3, 5e-4, 2.5e-4)


def _series(made, duration_s):
    values = np.array(made.run(duration_s, made.ledger.terms))
    return {name: values[:, i] for i, name in enumerate(EnergyLedger.COLUMNS)}


def _rise(values):
    """Largest climb of a series above any earlier value."""
    return float((values - np.minimum.accumulate(values)).max())


def _knocked(rig, timestep_s, **wall):
    """A limp, frictionless arm pushed with 5 N onto the wall from the middle of the bore: it bounces."""
    made = rig(timestep_s, **wall)
    push = 5.0 * made.axes()[:, 0]
    made.stiffness = made.damping = 0.0
    made.push = lambda t: push
    return _series(made, 1.0)


@pytest.mark.parametrize("contact_damping", [0.0, 15.0])
@pytest.mark.parametrize("seal", [0.0, 1.0])
def test_a_shaft_thrown_onto_the_wall_gains_nothing_from_the_contact(rig, contact_damping, seal):
    created = []
    for timestep in STEPS_S:
        e = _knocked(rig, timestep, contact_damping_n_s_per_m=contact_damping, seal_friction_n=seal)
        net = e["contact_work"] - e["friction_loss"] + e["contact_stored"]
        assert e["contact_stored"].max() > 1e-3
        assert net.max() <= 1e-9  # never above where it began
        created.append(_rise(net))
    assert created[0] < 1e-6  # under a thousandth of what the contact stored
    assert created[1] < 0.6 * created[0] + 1e-12
    assert created[2] < 0.6 * created[1] + 1e-12


def test_a_shaft_at_rest_on_the_wall_stays_at_rest(rig):
    made = rig()
    push = made.axes() @ [5.0, 2.0, 0.0]
    made.push = lambda t: push * min(1.0, t / 0.3)
    made.run(3.0)
    assert np.linalg.norm(made.port.force()) > 1.0
    energy = _series(made, 1.0)
    for name in ("contact_work", "friction_loss", "contact_stored", "kinetic"):
        assert np.ptp(energy[name]) < 1e-8
    assert np.abs(made.data.qvel).max() < 1e-5


def _path(rig, timestep_s, **wall):
    """Tip and cannula (n, 6) every 10 ms of an arm shaken in all directions, in and out of contact."""
    made = rig(timestep_s, **wall)
    axes = made.axes()
    made.stiffness = 50.0
    rates = 2 * np.pi * np.array([2.0, 3.0, 1.5])
    made.push = lambda t: axes @ (np.array([8.0, 4.0, 3.0]) * np.sin(rates * t))
    tip = made.scene.tip_site
    path = made.run(0.6, lambda: np.concatenate([made.data.site_xpos[tip], made.port.position()]))
    touched = made.term("contact_work")
    assert touched < -1e-4
    return np.array(path)[round(0.01 / timestep_s) - 1 :: round(0.01 / timestep_s)]


@pytest.mark.parametrize("seal", [0.0, 1.0])
def test_paths_in_contact_converge_at_first_order(rig, seal):
    paths = [_path(rig, h, seal_friction_n=seal) for h in (*STEPS_S, 1.25e-4)]
    gaps = [np.linalg.norm(a - b, axis=1).max() for a, b in pairwise(paths)]
    assert gaps[0] < 30e-6
    for coarse, fine in pairwise(gaps):
        assert 1.7 < coarse / fine < 2.5
