"""Runs with an angled tip: the shaft's line is held in the port, the tip on its path."""

import numpy as np
import pytest
from angled import OwnKinematics

from surgsim.errors import SurgsimError, UnreachableError
from surgsim.metrics.catalog import compute_metrics
from surgsim.models.config import InstrumentConfig, TrocarConfig
from surgsim.plant.disturbances.push import DISTANCE, SITE, PushConfig
from surgsim.plant.shaft import place_on_shaft, shaft_line
from surgsim.scenario.load import load_scenario
from surgsim.simulate.loop import Simulation, simulate
from surgsim.simulate.setup import prepare
from surgsim.simulate.start import check_through_port

HOOK = "instrument={name: hook_30}"
SHORT = ("task.duration_s=2.0", "task.hold_end_s=0.0", "task.radius_m=0.005")


def run(controller, *assignments, of="circle_lwr4plus"):
    scenario = load_scenario(of, controller=controller, assignments=[*SHORT, *assignments])
    trace = simulate(scenario)
    assert trace.meta.ending.outcome.name == "COMPLETED", trace.meta.ending
    return trace


def test_inverse_dynamics_holds_tip_and_shaft_as_of_a_straight_instrument():
    straight, hook = (compute_metrics(run("rcm_inverse_dynamics", *more)) for more in ((), (HOOK,)))
    for name in ("tip_error_max_mm", "rcm_error_max_mm"):
        assert hook[name] < max(2.0 * straight[name], 1e-3), name
    assert 0.9 < hook["manipulability_optimality"] <= 1.0 + 1e-9


@pytest.mark.parametrize(
    ("controller", "more"),
    [("pinv", ()), ("qp", ("plant={type: kinematic}",)), ("vprnn", ()), ("mink", ()), ("self_motion", ())],
)
def test_the_trace_s_rcm_error_is_the_port_s_distance_from_the_shaft(controller, more):
    """Of entry and end of the shaft by MuJoCo alone, at the trace's own joint positions."""
    trace, own = run(controller, HOOK, *more), OwnKinematics()
    for row in np.linspace(0, len(trace) - 1, 12).astype(int):
        q, p_WC = trace.block("q")[row], trace.block("trocar")[row]
        entry, end, tip = own.points(q)
        assert trace["rcm_error_m"][row] == pytest.approx(own.distance(q, p_WC), abs=1e-10)
        np.testing.assert_allclose(trace.block("tip")[row], tip, atol=1e-10)
        axis = (end - entry) / np.linalg.norm(end - entry)
        wrist = trace.block("wrist")[row]
        np.testing.assert_allclose(wrist, entry + ((p_WC - entry) @ axis) * axis, atol=1e-10)
        assert 0.0 < (p_WC - entry) @ axis < np.linalg.norm(end - entry)
    assert trace["rcm_error_m"].max() < 1e-2
    np.testing.assert_allclose(trace["rcm_error_believed_m"][:-1], trace["rcm_error_m"][:-1], atol=1e-10)


@pytest.mark.parametrize(
    "controller",
    ["entry_sphere_qp", "projected_jacobian", "rcm_elastic_dynamics", "vector_field_inequalities", "rcm_mpc"],
)
def test_other_laws_hold_the_shaft_s_line_too(controller):
    straight, hook = (run(controller, *more)["rcm_error_m"].max() for more in ((), (HOOK,)))
    assert hook < 1.2 * straight + 1e-6


@pytest.mark.parametrize("instrument", ["{type: nominal}", "{type: tracked}"])
def test_a_calibration_error_moves_the_tip_with_the_shaft_and_a_tracker_finds_it(instrument):
    scenario = load_scenario(
        "circle_lwr4plus",
        controller="rcm_inverse_dynamics",
        seed=1,
        assignments=[
            HOOK,
            f"controller.instrument={instrument}",
            "disturbances=[{type: calibration_error}, {type: instrument_tracker}]",
        ],
    )
    trace = simulate(scenario)
    late = trace["t_s"] >= 10.0
    errors = [np.sqrt(np.mean(trace[name][late] ** 2)) for name in ("tip_error_m", "rcm_error_m")]
    assert min(errors) > 5e-4 if "nominal" in instrument else max(errors) < 5e-5


def test_errors_of_the_tool_turn_the_bent_tip_about_the_shaft_s_entry():
    errors = "{type: calibration_error, joint_offset_rad: 0, link_position_m: 0, link_angle_rad: 0}"
    scenario = load_scenario(
        "circle_lwr4plus", assignments=[*SHORT, HOOK, f"disturbances=[{errors}, {_exact_tracker()}]"]
    )
    simulation = Simulation(setup := prepare(scenario))
    simulation.tick()
    plant, scene = setup.plant, setup.scene
    world, data = plant.world, plant.data
    entry, tip, end = (
        data.site_xpos[site] for site in (scene.shaft_entry_site, scene.tip_site, scene.shaft_end_site)
    )
    hook = InstrumentConfig(name="hook_30").tool
    body = data.body("instrument")
    R = body.xmat.reshape(3, 3)
    np.testing.assert_allclose(end - entry, R[:, 2] * hook.shaft_length_m, atol=1e-12)
    np.testing.assert_allclose(tip - end, R @ hook.p_ST, atol=1e-12)
    nominal = setup.arm.kinematics(world.q)
    moved = tip - nominal.p_WT
    assert 1e-4 < np.linalg.norm(moved) < 5e-3
    angle = np.linalg.norm(np.cross(nominal.R_WT[:, 2], R[:, 2]))
    assert 1e-5 < angle < 5e-3
    np.testing.assert_allclose(world.p_WT_m, world.p_WT, atol=1e-12)  # the tracker sees the tip itself
    np.testing.assert_allclose(world.R_WT_m, data.site_xmat[scene.tip_site].reshape(3, 3), atol=1e-12)


def _exact_tracker():
    return "{type: instrument_tracker, position_std_m: 0, angle_std_rad: 0, rate_hz: 1000}"


def test_the_wall_feels_the_shaft_and_not_the_tip():
    trace = run("rcm_inverse_dynamics", HOOK, "trocar.wall={}", "safety.rcm_error_max_m=null")
    assert np.isfinite(trace.block("trocar_force")).all()
    assert np.linalg.norm(trace.block("trocar_force"), axis=1).max() < 3.0
    scenario = load_scenario("circle_lwr4plus", assignments=[*SHORT, HOOK, "trocar.wall={}"])
    simulation = Simulation(setup := prepare(scenario))
    simulation.tick()
    data, scene = setup.plant.data, setup.scene
    entry, end = np.zeros(3), np.zeros(3)
    shaft_line(setup.plant.world, 0, np.zeros(3), entry, end)
    np.testing.assert_array_equal(entry, data.site_xpos[scene.shaft_entry_site])
    np.testing.assert_array_equal(end, data.site_xpos[scene.shaft_end_site])
    body, site, back = place_on_shaft(scene, 0.1)
    assert (site, back) == (scene.shaft_end_site, 0.1)
    assert scene.model.body(body).name == "instrument"
    capsule = scene.shapes.ends[scene.shapes.shaft]
    R = data.body("instrument").xmat.reshape(3, 3)
    top = data.body("instrument").xpos + R @ capsule[1]
    assert np.linalg.norm(np.cross(top - entry, (end - entry) / np.linalg.norm(end - entry))) < 1e-12


@pytest.mark.parametrize("at", ["tip", "shaft"])
def test_a_push_on_the_tip_acts_at_the_tip_and_one_on_the_shaft_on_its_line(at):
    scene = prepare(load_scenario("circle_lwr4plus", assignments=[*SHORT, HOOK])).scene
    part = PushConfig(at=at, distance_m=0.1).build(np.random.default_rng(0))
    part.attach(scene, 0.001)
    site, back = (scene.tip_site, 0.0) if at == "tip" else (scene.shaft_end_site, 0.1)
    assert (part.gains[SITE], part.gains[DISTANCE]) == (site, back)


def test_a_tip_that_leaves_no_shaft_in_the_port_is_refused():
    hook, trocar = InstrumentConfig(name="hook_30"), TrocarConfig(position_m=(0.0, 0.0, 0.0))
    check_through_port(np.array([0.01, 0.0, -0.2]), "the start at", hook, trocar)
    beside, past = hook.tip_from_shaft_m
    for tip, reason in (
        ([0.0, 0.0, -0.014], "the shaft's end would be outside the patient"),
        ([0.0, 0.0, -0.41], r"the shaft would be 0\.397 m in the patient, but the shaft is 0\.390 m long"),
        ([0.0, 0.0, 0.1], r"0\.100 m above the port"),
        ([0.4, 0.0, -0.01], "inclined 87 deg"),
    ):
        with pytest.raises(UnreachableError, match=reason):
            check_through_port(np.array(tip), "the start at", hook, trocar)
    deepest = -np.hypot(0.389 + past, beside)
    check_through_port(np.array([0.0, 0.0, deepest]), "the start at", hook, trocar)


def test_an_insertion_leads_the_shaft_s_end_along_the_axis_and_to_the_target():
    """By MuJoCo alone: the shaft stays on the port's axis, the bent tip ahead of its end."""
    scenario = load_scenario("insertion_lwr4plus", assignments=[HOOK, "task.duration_s=4.0"])
    trace, own = simulate(scenario), OwnKinematics()
    assert trace.meta.ending.outcome.name == "COMPLETED", trace.meta.ending
    port, target = np.array(scenario.trocar.position_m), np.array(scenario.task.target_from_port_m)
    places = np.array([own.points(q) for q in trace.block("q")[::10]])
    entry, end, tip = places[:, 0], places[:, 1], places[:, 2]
    np.testing.assert_allclose(end[0], scenario.task.start_m, atol=1e-5)
    np.testing.assert_allclose(end[-1], port + target, atol=1e-5)
    first = trace["insertion_phase"][::10] < 2.0
    for points in (entry[first], end[first]):
        assert np.linalg.norm((points - port)[:, :2], axis=1).max() < 2e-5
    assert (end[first] - tip[first])[:, 2].min() > 0.012
    assert np.linalg.norm((tip - port)[first, :2], axis=1) == pytest.approx(0.0075, abs=2e-5)
    ahead = (end[:, 2] > port[2]) & (tip[:, 2] < port[2])
    assert ahead.sum() > 3  # the tip has passed the port, the shaft's end not
    asked = trace.block("tip_ref")[::10] - tip + end - port  # where the shaft's end is asked to be
    np.testing.assert_allclose(-asked[first, 2], trace["insertion_depth_m"][::10][first], atol=1e-12)
    assert compute_metrics(trace)["rcm_error_max_mm"] < 0.01
    assert compute_metrics(trace)["tip_error_max_mm"] < 0.01


def test_a_bent_part_that_is_wider_than_the_bore_is_not_inserted_through_a_wall():
    wall = (HOOK, "trocar.wall={}", "task.duration_s=4.0")
    with pytest.raises(SurgsimError, match=r"needs a bore of 23\.0 mm, and this is one of 8\.9 mm"):
        prepare(load_scenario("insertion_lwr4plus", assignments=wall))
    scenario = load_scenario("insertion_lwr4plus", assignments=[*wall, "trocar.bore_diameter_m=0.0231"])
    trace = simulate(scenario)
    assert trace.meta.ending.outcome.name == "COMPLETED", trace.meta.ending
    assert compute_metrics(trace)["rcm_error_max_mm"] < 0.1
