"""The search finds the start with the most room on its path, on arms of 6 to 8 joints, if there is one.

What it is held against is written anew: starts of scipy's bounded least squares from random configurations,
whose paths are followed with the pseudo-inverse.
"""

from itertools import islice

import numpy as np
import pytest
from scipy.optimize import least_squares

from surgsim.control.rcm import rcm_kinematics
from surgsim.errors import UnreachableError
from surgsim.models.arm import ArmModel
from surgsim.models.config import InstrumentConfig, RobotConfig, SceneConfig, TrocarConfig
from surgsim.simulate.reach import LIMIT_MARGIN_RAD, Reach
from surgsim.simulate.start import solve_start

ROBOTS = ["lwr4plus", "panda", "test_arm_6", "test_arm_7", "test_arm_8"]


def made(robot, position, axis=(0.0, 0.0, 1.0), **instrument):
    """An arm with its instrument, and what it is in: a port, and the patient."""
    scene = SceneConfig(
        robot=RobotConfig(name=robot),
        instrument=InstrumentConfig(**instrument),
        trocar=TrocarConfig(position_m=tuple(position), axis=tuple(axis)),
        theatre=False,
    )
    return ArmModel(scene), scene


def drawn(robot, seed):
    """An arm, a port somewhere around it, tilted up to 25 degrees, and a circle below it (k, 3) [m]."""
    rng = np.random.default_rng(seed)
    turn, side = rng.uniform(-np.pi, np.pi, 2)
    tilt, out, up = np.deg2rad(rng.uniform(0.0, 25.0)), rng.uniform(0.35, 0.7), rng.uniform(0.05, 0.4)
    position = np.array([out * np.cos(turn), out * np.sin(turn), up])
    axis = np.array([np.sin(tilt) * np.cos(side), np.sin(tilt) * np.sin(side), np.cos(tilt)])
    x = np.cross(axis, [0.0, 1.0, 0.0])
    x /= np.linalg.norm(x)
    angle = np.linspace(0.0, 2.0 * np.pi, 41)[:, None]
    circle = rng.uniform(0.005, 0.02) * ((np.cos(angle) - 1.0) * x + np.sin(angle) * np.cross(axis, x))
    arm, scene = made(robot, position, axis)
    return arm, scene, position - rng.uniform(0.07, 0.2) * axis + circle


def middle(arm):
    return 0.5 * (arm.limits.q_min + arm.limits.q_max)


def solved(arm, scene, places, **options):
    options = {"posture": None, "home": middle(arm), "clear": False, **options}
    return solve_start(arm, scene, places, **options)


def rows(arm, scene, p, q):
    """What tip and shaft lack (5,) [m], and its Jacobian (5, n)."""
    kin = arm.kinematics(q)
    rcm = rcm_kinematics(kin, np.array(scene.trocar.position_m), np.zeros(3))
    return np.concatenate([kin.p_WT - p, rcm.error]), np.vstack([kin.Jv_WT, rcm.jacobian])


def room(arm, scene, places, q):
    """Smallest distance of a joint to its limits on the path, -1 where it ends [rad]."""
    least, n = np.inf, q.size - arm.rolls_shaft
    for p in places:
        for _ in range(10):
            miss, J = rows(arm, scene, p, q)
            if np.linalg.norm(miss) < 1e-9:
                break
            q = q - np.linalg.pinv(J, rcond=1e-5) @ miss
        if np.linalg.norm(miss) > 1e-4:
            return -1.0
        least = min(least, np.minimum(q - arm.limits.q_min, arm.limits.q_max - q)[:n].min())
    return least


def random_starts(arm, scene, p, count, seed):
    """Configurations inside the limits with the tip at p and the shaft into the patient, by least squares."""
    rng = np.random.default_rng(seed)
    low, high = arm.limits.q_min + LIMIT_MARGIN_RAD, arm.limits.q_max - LIMIT_MARGIN_RAD
    for _ in range(count):
        found = least_squares(
            lambda q: rows(arm, scene, p, q)[0],
            rng.uniform(low, high),
            jac=lambda q: rows(arm, scene, p, q)[1],
            bounds=(low, high),
            gtol=1e-13,
            max_nfev=50,
        )
        inwards = arm.kinematics(found.x).R_WT[:, 2] @ np.array(scene.trocar.axis) < 0.0
        if np.linalg.norm(found.fun) < 1e-6 and inwards:
            yield found.x


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("seed", [2, 14, 17, 22])
def test_no_random_start_has_more_room(robot, seed):
    arm, scene, places = drawn(robot, seed)
    q = solved(arm, scene, places)
    assert np.linalg.norm(rows(arm, scene, places[0], q)[0]) < 1e-8
    ours = room(arm, scene, places, q)
    assert ours > LIMIT_MARGIN_RAD
    starts = list(islice(random_starts(arm, scene, places[0], 100, seed), 3))
    assert len(starts) == 3
    others = [room(arm, scene, places, start) for start in starts]
    assert ours > max(others) - 0.02


@pytest.mark.parametrize("robot", ROBOTS)
def test_where_the_start_is_refused_random_starts_find_none(robot):
    arm, scene = made(robot, (0.0, 1.0, 0.1))
    place = np.array([0.02, 1.0, -0.08])
    with pytest.raises(UnreachableError, match=r"the start at .* cannot be reached: the best configuration"):
        solved(arm, scene, place[None])
    assert list(random_starts(arm, scene, place, 20, 0)) == []


@pytest.mark.parametrize("robot", ROBOTS)
def test_the_search_gives_the_same_bits_again(robot):
    first, again = (solved(*drawn(robot, 2)) for _ in range(2))
    np.testing.assert_array_equal(first, again)


def test_of_equal_starts_the_nearest_to_the_arms_own_posture_is_taken():
    """The arm is the same in a mirror: elbow and wrist turned over have as much room."""
    arm, scene = made("lwr4plus", (0.0, 0.55, 0.2))
    place = np.array([[0.0, 0.55, 0.02]])
    up = solved(arm, scene, place)
    over = up * [1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0] + [np.pi, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    over[0] = (over[0] + np.pi) % (2.0 * np.pi) - np.pi
    assert np.linalg.norm(rows(arm, scene, place[0], over)[0]) < 1e-6
    np.testing.assert_allclose(solved(arm, scene, place, home=up), up, atol=0.2)
    np.testing.assert_allclose(solved(arm, scene, place, home=over), over, atol=0.2)


def test_free_joints_count_past_their_limits_and_whole_turns_are_taken_back():
    arm, scene, places = drawn("lwr4plus", 2)
    reach = Reach(arm, scene, inside=False)
    path = reach.path(places, clear=False)
    q = solved(arm, scene, places)
    turned = q + 2.0 * np.pi * np.array([1, 0, 0, 0, -2, 0, 0])
    assert reach.start(path, turned).room_rad == pytest.approx(reach.start(path, q).room_rad, abs=1e-9)
    np.testing.assert_allclose(reach.turned_inside(path, turned), q, atol=1e-9)


def test_a_start_that_touches_is_refused_where_every_other_one_touches_too():
    """The shaft is in nearly up to its adapter."""
    arm, scene = made("lwr4plus", (0.0, 0.5, 0.2), shaft_length_m=0.2, com_m=0.08)
    deep, less = np.array([[0.0, 0.595, 0.014]]), np.array([[0.0, 0.58, 0.06]])
    with pytest.raises(
        UnreachableError, match=r"no start is clear of contact .* adapter touches the patient"
    ):
        solved(arm, scene, deep, clear=True)
    reach = Reach(arm, scene)
    assert reach.contact(deep, solved(arm, scene, deep)).startswith("adapter touches the patient")
    assert reach.contact(less, solved(arm, scene, less, clear=True)) is None


def test_a_path_without_contact_is_worth_more_than_any_with_one():
    arm, scene, places = drawn("lwr4plus", 2)
    reach, q = Reach(arm, scene), solved(*drawn("lwr4plus", 2))
    path = reach.path(places, clear=True)
    free, touching = reach.start(path, q), reach.start(path._replace(clearance_m=1.0), q)
    assert touching.worth == pytest.approx(free.worth - 10.0)
    assert touching.room_rad == free.room_rad


def test_a_shaft_that_would_point_out_of_the_patient_is_no_start():
    """Its axis passes through the trocar too, from below: this port is so high that nothing else is left."""
    arm, scene = made("lwr4plus", (0.0, 0.45, 0.75))
    place = np.array([[0.0, 0.45, 0.65]])
    reach, rng = Reach(arm, scene), np.random.default_rng(0)
    settled = [reach.settle(place[0], rng.uniform(arm.limits.q_min, arm.limits.q_max)) for _ in range(60)]
    there = [reach.points_inwards(q) for q in settled if max(reach.miss(q, place[0])) < 1e-8]
    assert len(there) > 5
    assert not any(there)
    with pytest.raises(
        UnreachableError, match=r"the start at .* leaves the tip .*joint 6 at the position limit"
    ):
        solved(arm, scene, place)


@pytest.mark.parametrize(
    ("position", "axis", "place"),
    [
        ((-0.50136, -0.16307, 0.23173), (-0.07945, -0.08378, 0.99331), (-0.49559, -0.15698, 0.15952)),
        ((-0.49527, -0.14161, 0.21202), (-0.15119, 0.14151, 0.97832), (-0.4691, -0.16610, 0.04267)),
    ],
)
def test_a_start_that_takes_long_to_settle_is_given_as_it_is_at_the_end(position, axis, place):
    """These were found, and refused: the configuration was handed on before it had come to its place."""
    arm, scene = made("test_arm_6", position, axis)
    q = solved(arm, scene, np.array([place]))
    assert np.linalg.norm(rows(arm, scene, np.array(place), q)[0]) < 1e-8
    assert next(random_starts(arm, scene, np.array(place), 60, 0), None) is not None
