"""Vector-field inequalities: the program against another solver, and fixtures that hold in motion."""

from dataclasses import replace

import daqp
import numpy as np
import pytest
from usual_arm import random_q, usual_arm

from surgsim.control.failure import ControlFailure
from surgsim.control.planes import PlaneConfig
from surgsim.control.problem import velocity_bounds
from surgsim.control.qp import SHIPPED
from surgsim.control.rcm import rcm_kinematics
from surgsim.control.resolvers.vector_field_inequalities import VectorFieldInequalitiesConfig
from surgsim.control.zones import ZoneConfig
from surgsim.errors import Outcome
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import simulate

seeds = pytest.mark.parametrize("seed", range(5))
R, N = 0.0005, 7


def step(config, p, memory=None):
    resolver = config.build(usual_arm())
    return resolver.step(p, memory)[0]


def inside(velocity_problem, seed, share=0.9, **changes):
    """A problem with the shaft at a share of the sphere's radius."""
    return velocity_problem(seed, rcm_error_m=share * R, **changes)


def objective(c, p):
    """H and f by the law as it is printed, from rotations of small angles."""
    J, W, z = p.kin.Jv_WT, p.kin.Jw_WT, p.kin.R_WT[:, 2]
    wanted = p.command.v_WTd - c.gain_per_s * (p.kin.p_WT - p.command.p_WTd)
    turn = np.zeros(3)
    if p.rcm is not None:

        def towards(t):
            r = p.command.p_WTd + t * p.command.v_WTd - p.p_WC - t * p.v_WC
            return r / np.linalg.norm(r)

        h = 1e-6
        turn = c.gain_per_s * np.cross(z, towards(0.0))
        turn = turn + np.cross(towards(0.0), (towards(h) - towards(-h)) / (2.0 * h))
    H = c.alpha * J.T @ J + (1.0 - c.alpha) * W.T @ W + c.damping**2 * np.eye(N)
    return H, -c.alpha * J.T @ wanted - (1.0 - c.alpha) * W.T @ turn


@seeds
@pytest.mark.parametrize("trocar", [True, False])
def test_it_is_the_printed_program_solved_by_another_solver(velocity_problem, seed, trocar):
    c = VectorFieldInequalitiesConfig(sampled=False, alpha=0.99)
    p = inside(velocity_problem, seed, trocar=trocar, speed=0.1)
    H, f = objective(c, p)
    rows, high = np.eye(N), p.upper
    if trocar:
        e, moving = p.rcm.error, p.rcm.trocar_velocity
        row, bound = 2.0 * e @ p.rcm.jacobian, c.eta_per_s * (R**2 - e @ e) + 2.0 * e @ moving
        size = np.linalg.norm(row)  # daqp's tolerances are absolute
        rows, high = np.vstack([rows, row / size]), np.r_[high, bound / size]
    low = np.r_[p.lower, np.full(len(rows) - N, -1e30)]
    expected, _, flag, _ = daqp.solve(H, f, rows, high, low, np.zeros(len(rows), dtype=np.int32))
    assert flag > 0
    np.testing.assert_allclose(step(c, p).qdot, expected, atol=1e-6)


def test_the_sphere_s_row_is_active_where_it_is_needed(velocity_problem):
    config, active = VectorFieldInequalitiesConfig(alpha=1.0), []
    for seed in range(20):
        p = inside(velocity_problem, seed, speed=0.1)
        answer = step(config, p)
        rate = 2.0 * p.rcm.error @ (p.rcm.jacobian @ answer.qdot - p.rcm.trocar_velocity)
        assert rate <= config.eta_per_s * (R**2 - p.rcm.error @ p.rcm.error) + 1e-9
        active.append(answer.values[0])
    assert 0 < sum(active) < 20


@seeds
@pytest.mark.parametrize("solver", SHIPPED)
def test_every_solver_gives_the_same(velocity_problem, seed, solver):
    p = inside(velocity_problem, seed, speed=0.1)
    own = step(VectorFieldInequalitiesConfig(), p)
    other = step(VectorFieldInequalitiesConfig(solver=solver), p)
    np.testing.assert_allclose(other.qdot, own.qdot, atol=1e-6)


def travelled(config, seed, *, ticks=1500, dt=0.001):
    """Distance of the shaft from a moving port [m], and whether its row is active, from a random start on.

    The port sways by 5 mm in 1.3 s, the tip is asked for a circle of 1 cm in 1.5 s; the joints follow.
    """
    arm, rng = usual_arm(), np.random.default_rng(seed)
    q, resolver, memory = random_q(rng), config.build(usual_arm()), None
    kin = arm.kinematics(q)
    angle, start = rng.uniform(0.0, 2.0 * np.pi), kin.p_WT.copy()
    off = rng.uniform(0.0, 1.0) * R * (kin.R_WT[:, :2] @ [np.cos(angle), np.sin(angle)])
    home = start - 0.2 * kin.R_WT[:, 2] + off
    sway = 0.005 * _unit(rng)
    a, b = (0.01 * _unit(rng) for _ in range(2))
    v, found, active = np.zeros(N), [], []
    for k in range(ticks):
        t = k * dt
        w, u = 2.0 * np.pi / 1.3, 2.0 * np.pi / 1.5
        p_WC, v_WC = home + sway * (1.0 - np.cos(w * t)), sway * w * np.sin(w * t)
        kin = arm.kinematics(q)
        rcm = rcm_kinematics(kin, p_WC, v_WC)
        found.append(np.linalg.norm(rcm.error))
        p = _problem(arm, q, v, kin, rcm, p_WC, v_WC, dt)
        command = replace(
            p.command,
            p_WTd=start + a * np.sin(u * t) + b * (1.0 - np.cos(u * t)),
            v_WTd=u * (a * np.cos(u * t) + b * np.sin(u * t)),
        )
        answer, memory = resolver.step(replace(p, command=command, t_s=t), memory)
        active.append(answer.values[0])
        v = answer.qdot
        q = q + dt * v
    return np.array(found), np.array(active)


def _unit(rng):
    x = rng.standard_normal(3)
    return x / np.linalg.norm(x)


def _problem(arm, q, v, kin, rcm, p_WC, v_WC, dt):
    from surgsim.contract.problems import velocity_problem

    lower, upper = velocity_bounds(q, arm.limits, 10.0)
    changes = {"q": q, "v": v, "kin": kin, "rcm": rcm, "p_WC": p_WC, "v_WC": v_WC, "dt_s": dt}
    return replace(velocity_problem(arm, 0, q=q), lower=lower, upper=upper, **changes)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("alpha", [1.0, 0.999])
def test_the_sphere_holds_to_a_micrometre_while_the_port_moves(seed, alpha):
    error, active = travelled(VectorFieldInequalitiesConfig(alpha=alpha), seed)
    assert error.max() <= R + 1e-6
    if alpha == 1.0:  # the weight of the direction alone keeps the shaft nearer to the port
        assert error.max() > 0.9 * R
        assert active.mean() > 0.1


def test_without_what_d_gains_over_a_period_it_does_not():
    """The row as printed: fast motion round the sphere leaves it, by T |e'|^2 / (2 R eta)."""
    printed = [travelled(VectorFieldInequalitiesConfig(alpha=1.0, sampled=False), s)[0].max() for s in (0, 2)]
    assert max(printed) > R + 1e-6


@pytest.mark.parametrize("name", ["circle_lwr4plus", "sinusoid_lwr4plus", "circle_panda"])
@pytest.mark.parametrize("alpha", [1.0, 0.999])
def test_it_holds_on_the_kinematic_plant(name, alpha):
    settings = [
        "plant={type: kinematic}",
        "controller.evaluate_at=measured",
        f"controller.resolver.alpha={alpha}",
    ]
    trace = simulate(load_scenario(name, controller="vector_field_inequalities", assignments=settings))
    assert trace.meta.ending.outcome is Outcome.COMPLETED
    assert trace["rcm_error_m"].max() <= R + 1e-6
    assert trace["rcm_error_m"].max() > 0.5 * R
    assert trace["tip_error_m"].max() < 2e-5
    if alpha == 1.0:
        assert trace["entry_active"].mean() > 0.5
        assert trace["rcm_error_m"].max() > 0.999 * R


def test_a_bound_that_cannot_be_kept_is_an_outcome(velocity_problem):
    p = velocity_problem(0, rcm_error_m=R)
    p = replace(p, rcm=replace(p.rcm, trocar_velocity=-1e5 * p.rcm.error))  # the port runs away, 50 m/s
    with pytest.raises(ControlFailure, match="no joint velocity meets the sphere about the port") as failure:
        step(VectorFieldInequalitiesConfig(), p)
    assert failure.value.outcome is Outcome.INFEASIBLE
    assert failure.value.data["G"].shape == (1, N)


ZONES = {
    "shaft out of a sphere": ({"of": "shaft", "keep": "outside"}, False),
    "shaft out of a cylinder": ({"of": "shaft", "keep": "outside"}, True),
    "tip in a sphere": ({"of": "tip", "keep": "inside"}, False),
    "tip in a cylinder": ({"of": "tip", "keep": "inside"}, True),
}


@pytest.mark.parametrize("case", list(ZONES))
def test_zones_hold_in_motion(case):
    """On the circle without a trocar; each zone is one that the circle itself would leave or enter."""
    keys, line = ZONES[case]
    free = _circle(())
    tip = free.block("tip")
    inward = keys["keep"] == "inside"
    centre = tip[0] if inward else tip[len(tip) // 2]
    radius = 0.015
    zone = {**keys, "point_m": [float(x) for x in centre], "radius_m": radius}
    if not inward:
        zone["point_m"][2] += 0.1 if keys["of"] == "shaft" else 0.0
    if line:
        zone["direction"] = [0.0, 0.0, 1.0] if inward else [0.0, 1.0, 0.0]
    kept = _circle((zone,))

    def away(trace):
        return np.array([_distance(trace, k, zone) for k in range(0, len(trace.block("tip")), 10)])

    sign = 1.0 if inward else -1.0
    assert (sign * (away(free) - radius)).max() > 0.003
    assert (sign * (away(kept) - radius)).max() < 1e-5
    assert kept["zones_active"].mean() > 0.05


def _distance(trace, k, zone):
    """Of shaft or tip from a zone's centre or axis, by projections."""
    p, wrist, c = trace.block("tip")[k], trace.block("wrist")[k], np.array(zone["point_m"])
    z = (p - wrist) / np.linalg.norm(p - wrist)
    spans = ([z] if zone["of"] == "shaft" else []) + ([zone["direction"]] if "direction" in zone else [])
    basis = np.linalg.qr(np.array(spans).T)[0] if spans else np.zeros((3, 1))
    r = p - c
    return np.linalg.norm(r - basis @ (basis.T @ r))


def _circle(zones):
    listed = "[" + ", ".join(str(zone).replace("'", "") for zone in zones) + "]"
    settings = ["trocar=null", "plant={type: kinematic}", "controller.evaluate_at=measured"]
    settings += ["task.duration_s=3.0", f"controller.resolver.zones={listed}", "theatre=false"]
    settings += ["start={posture_rad: [1.5708, -0.5236, 0.0, 1.5708, 0.0, -1.0472, 0.0]}"]
    settings += ["safety.tip_error_max_m=null", "controller.port={type: measured}"]
    return simulate(
        load_scenario("circle_lwr4plus", controller="vector_field_inequalities", assignments=settings)
    )


def test_a_wall_bounds_the_speed_towards_it(velocity_problem):
    p = inside(velocity_problem, 1, speed=0.0)
    n, room = np.array([0.0, 0.6, 0.8]), 0.001
    p = replace(p, command=replace(p.command, p_WTd=p.kin.p_WT, v_WTd=0.05 * n))
    plane = PlaneConfig(normal=(0.0, 3.0, 4.0), offset_m=float(n @ p.kin.p_WT) + room)
    free = step(VectorFieldInequalitiesConfig(), p)
    held = step(VectorFieldInequalitiesConfig(planes=(plane,)), p)
    assert n @ p.kin.Jv_WT @ free.qdot > 0.045
    assert n @ p.kin.Jv_WT @ held.qdot == pytest.approx(20.0 * room, abs=1e-8)


def test_a_zone_of_the_shaft_and_one_of_the_tip_are_counted(velocity_problem):
    p = inside(velocity_problem, 2, speed=0.0)
    at = tuple(p.kin.p_WT)
    zones = (ZoneConfig(of="tip", keep="inside", point_m=at, radius_m=1.0),)
    assert step(VectorFieldInequalitiesConfig(zones=zones), p).values[1] == 0.0
