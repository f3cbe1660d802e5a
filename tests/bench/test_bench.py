"""What is measured, and that it is the same problem for all; how fast is not a test's matter."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from surgsim.bench.cases import OUTSIDE, all_cases, chosen
from surgsim.bench.kept import against, keep, read_kept
from surgsim.bench.libraries.arm_files import urdf_of
from surgsim.bench.libraries.measure import LIBRARIES, measure_libraries
from surgsim.bench.libraries.problem import apart, circle_problem, errors_of
from surgsim.bench.libraries.with_mink import Mink
from surgsim.bench.sections import SECTIONS, bench_of, measure
from surgsim.bench.stages import STAGES, measure_stages
from surgsim.bench.startup import PARTS, start
from surgsim.bench.ticks import BareSteps, measure_ticks
from surgsim.cli.main import main
from surgsim.errors import SurgsimError
from surgsim.scenario.load import shipped
from surgsim.simulate.loop import Simulation
from surgsim.simulate.setup import prepare

ROOT = Path(__file__).parents[2]
SHORT_S = 3.2


def test_every_shipped_controller_is_a_case_on_the_circle():
    names = [case.name for case in all_cases()]
    timed = [name for name in shipped("controllers") if name not in OUTSIDE]
    assert {f"circle/{name}" for name in timed} < set(names)
    assert len(timed) == len(shipped("controllers")) - len(OUTSIDE)
    assert len(names) == len(set(names))


def test_the_kept_ratios_are_those_of_the_cases():
    assert set(read_kept(ROOT / "benchmarks" / "ratios.json")) == {case.name for case in all_cases()}


@pytest.mark.parametrize("name", ["circle/vprnn", "kinematic/pinv"])
def test_a_tick_is_measured_beside_bare_steps(name):
    row = measure_ticks(chosen([name])[0], SHORT_S, 1)
    figures = [value for key, value in row.items() if key != "case"]
    assert row["case"] == name
    assert all(math.isfinite(value) and value > 0.0 for value in figures)


def test_bare_steps_begin_at_the_state_of_the_run_and_leave_it_alone():
    setup = prepare(chosen(["circle/pinv"])[0].scenario())
    simulation, steps = Simulation(setup), BareSteps(setup, 1)
    simulation.advance(50)
    before = setup.plant.data.qpos.copy(), setup.plant.data.time
    steps.follow()
    steps()
    np.testing.assert_array_equal(setup.plant.data.qpos, before[0])
    assert setup.plant.data.time == before[1]
    assert steps._data.time > before[1]


def test_stages_add_up_to_the_tick():
    row = measure_stages(chosen(["circle/pinv"])[0], SHORT_S)
    assert math.isclose(sum(row[name] for name in STAGES), row["tick"], rel_tol=1e-9)
    differences = {"plant", "rest"}  # of two measurements each
    assert min(row[name] for name in STAGES if name not in differences) >= 0.0
    assert min(row["model"], row["mj_step"], row["resolver"]) > 0.0


def test_a_start_in_this_process_has_every_part():
    took = start("kinematic/pinv", ["task.duration_s=2.0", "task.hold_end_s=0.0"])
    assert set(PARTS) <= set(took)
    assert all(value >= 0.0 for value in took.values())


def test_libraries_that_are_not_installed_say_so_in_their_row(monkeypatch):
    monkeypatch.setitem(LIBRARIES, "placo", ("surgsim_has_no_such_module", "with_placo", "Placo", "placo"))
    rows = {row["library"]: row for row in measure_libraries(2.1)}
    assert rows["placo"]["how"] == "not installed (pip install placo)"
    assert rows["placo"]["tick_us"] is None
    assert rows["mink"]["tip_rms_um"] < 0.1 > rows["mink"]["rcm_rms_um"]
    assert rows["surgsim pinv"]["tip_rms_um"] < 5.0 > rows["surgsim pinv"]["rcm_rms_um"]


def test_errors_tell_a_library_that_does_not_solve():
    circle = circle_problem(1.0)
    still = np.tile(circle.q_start, (len(circle.targets) - 1, 1))
    away = np.linalg.norm(circle.targets[1:] - circle.targets[0], axis=1)
    assert math.isclose(errors_of(circle, still).tip_rms_um, 1e6 * np.sqrt(np.mean(away**2)), rel_tol=1e-3)
    assert errors_of(circle, still).rcm_rms_um < 1.0
    turned = still + np.array([0.0, 0.01, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert errors_of(circle, turned).rcm_rms_um > 1000.0


def test_a_library_with_another_arm_is_found_out():
    circle = circle_problem(1.0)
    library = Mink(circle)
    assert apart(circle, library) < 1e-12
    exact = library.tip
    library.tip = lambda q: exact(q) + 2e-9
    assert apart(circle, library) > 1e-9


def test_the_urdf_is_the_arm():
    circle = circle_problem(1.0)
    place = _tip_of_urdf(urdf_of(circle.arm, circle.p_WC))
    random = np.random.default_rng(1)
    for q in random.uniform(circle.arm.limits.q_min, circle.arm.limits.q_max, (20, circle.q_start.size)):
        np.testing.assert_allclose(place(q), circle.arm.kinematics(q).p_WT, rtol=0.0, atol=1e-12)


def _tip_of_urdf(text):
    """Forward kinematics of a URDF, read by scipy and the XML parser alone."""
    import xml.etree.ElementTree as ET

    from scipy.spatial.transform import Rotation

    def numbers(element, name):
        return np.array([float(word) for word in element.get(name).split()])

    joints = {joint.find("child").get("link"): joint for joint in ET.fromstring(text).iter("joint")}

    def place(q):
        chain, link = [], "tip"
        while link in joints:
            chain.insert(0, joints[link])
            link = joints[link].find("parent").get("link")
        p, R, k = np.zeros(3), np.eye(3), 0
        for joint in chain:
            origin = joint.find("origin")
            p = p + R @ numbers(origin, "xyz")
            R = R @ Rotation.from_euler("xyz", numbers(origin, "rpy")).as_matrix()
            if joint.get("type") == "revolute":
                R = R @ Rotation.from_rotvec(q[k] * numbers(joint.find("axis"), "xyz")).as_matrix()
                k += 1
        return p

    return place


def test_a_ratio_that_has_grown_is_told():
    rows = [{"case": "a", "ratio": 1.3}, {"case": "b", "ratio": 1.2}, {"case": "c", "ratio": 9.0}]
    found = against(rows, {"a": 1.0, "b": 1.0})
    assert [(row["kept"], row["grown"]) for row in found] == [(1.0, True), (1.0, False), (None, False)]


@pytest.mark.parametrize(("kept", "status", "grown"), [(1e-3, 1, True), (1e6, 0, False)])
def test_the_command_ends_with_1_if_a_ratio_has_grown(tmp_path, capsys, kept, status, grown):
    file = tmp_path / "ratios.json"
    file.write_text(json.dumps({"ratios": {"kinematic/pinv": kept}}))
    words = [
        "bench",
        "--only",
        "ticks",
        "--cases",
        "kinematic/pinv",
        "--duration",
        "3.2",
        "--against",
        str(file),
    ]
    assert main(words) == status
    assert ("yes" in capsys.readouterr().out.splitlines()[2].split()) is grown
    assert main([*words, "--json"]) == status
    (row,) = json.loads(capsys.readouterr().out)["ticks"]
    assert (row["kept"], row["grown"]) == (kept, grown)


def test_keeping_some_ratios_leaves_the_others(tmp_path):
    file = tmp_path / "ratios.json"
    keep(file, [{"case": "a", "ratio": 1.0}, {"case": "b", "ratio": 2.0}], {"load": 0.1})
    keep(file, [{"case": "b", "ratio": 3.0}], {"load": 0.2})
    assert read_kept(file) == {"a": 1.0, "b": 3.0}
    assert json.loads(file.read_text())["machine"] == {"load": 0.2}


def test_a_file_of_something_else_is_refused(tmp_path):
    file = tmp_path / "ratios.json"
    for text in ("{", "[]", '{"ratios": {"a": "fast"}}'):
        file.write_text(text)
        with pytest.raises(SurgsimError, match=r"ratios\.json: holds no ratios"):
            read_kept(file)


def test_sections_come_in_their_order_and_tell_what_they_measure():
    told = []
    bench = bench_of(["stages", "ticks"], ["kinematic/pinv"], SHORT_S, 1)
    found = dict(measure(bench, told.append))
    assert list(found) == ["ticks", "stages"]
    assert told == ["ticks: kinematic/pinv (1 of 1)", "stages: kinematic/pinv (1 of 1)"]
    assert bench_of(None, None, SHORT_S, 1).sections == SECTIONS
