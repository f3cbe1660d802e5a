"""A model file becomes a robot's folder, and the folder a robot with a name."""

import json
import re

import numpy as np
import pytest
from foreign_arms import NAMES, write_mjcf, write_urdf

from surgsim.adopt import ports
from surgsim.adopt.folder import adopt
from surgsim.cli.main import main
from surgsim.contract import robots
from surgsim.contract.check import BrokenPromiseError
from surgsim.errors import SurgsimError
from surgsim.models import folders
from surgsim.models.build import build
from surgsim.models.config import RobotConfig, SceneConfig
from surgsim.models.folders import SEARCH_PATH, robot_file, robot_names
from surgsim.plugins import Offer
from surgsim.scenario.load import load_scenario

JOINTS = f"joints=[{', '.join(NAMES)}]"


@pytest.fixture
def named(tmp_path, monkeypatch):
    """The folder with the adopted robots, on the search path."""
    monkeypatch.setenv(SEARCH_PATH, str(tmp_path / "robots"))
    return tmp_path / "robots"


def _adopted(tmp_path, named, *more: str) -> int:
    words = ["adopt", str(write_mjcf(tmp_path)), "--set", "base_body=pedestal", "--set", JOINTS]
    return main([*words, "--out", str(named), "--quick", *more])


def test_the_folder_is_the_arm_of_the_file_to_the_last_bit(tmp_path, named, capsys):
    assert _adopted(tmp_path, named, "--name", "their_arm") == 0
    assert "wrote" in capsys.readouterr().err
    assert "their_arm" in robot_names()
    from_file = RobotConfig(mjcf=str(tmp_path / "arm.xml"), base_body="pedestal", joints=NAMES)
    robots = (from_file, RobotConfig(name="their_arm"))
    scenes = [build(SceneConfig(robot=robot, theatre=False)) for robot in robots]
    one, other = (scene.model for scene in scenes)
    fields = ("body_pos", "body_quat", "body_mass", "body_inertia", "body_iquat", "body_ipos", "jnt_axis")
    for field in (*fields, "jnt_pos", "jnt_range", "qpos0", "dof_damping", "dof_armature", "site_pos"):
        np.testing.assert_array_equal(getattr(one, field), getattr(other, field), err_msg=field)
    for field in ("ends", "radii", "pairs"):
        np.testing.assert_array_equal(*(getattr(scene.shapes, field) for scene in scenes))
    np.testing.assert_array_equal(*(scene.limits.torque for scene in scenes))
    np.testing.assert_array_equal(*(scene.home for scene in scenes))
    assert one.ngeom == other.ngeom


def test_the_card_is_printed_and_written(tmp_path, named, capsys):
    _adopted(tmp_path, named, "--name", "their_arm", "--json")
    told = json.loads(capsys.readouterr().out)
    assert ["redundancy", "1 with tip and shaft held; the last joint rolls the shaft"] in told["card"]
    card = (named / "their_arm" / "README.md").read_text()
    assert "hand 'hand'" in card
    assert "arm.xml" in card
    assert str(tmp_path) not in card


def test_a_scenario_knows_it_by_name_and_by_what_it_holds(tmp_path, named, capsys):
    _adopted(tmp_path, named, "--name", "their_arm")
    content = {
        "name": "circle",
        "robot": {"name": "their_arm"},
        "start": {"q_rad": [0.0, 0.3, 0.0, 0.9, 0.0, 0.6, 0.0]},
        "task": {"type": "circle", "duration_s": 4.0},
        "controller": "pinv",
    }
    before = load_scenario(content).sha256()
    assert load_scenario(content).sha256() == before
    mesh = next((named / "their_arm" / "meshes").iterdir())
    mesh.write_bytes(mesh.read_bytes()[:-1] + b"x")
    assert load_scenario(content).sha256() != before
    capsys.readouterr()
    assert main(["list", "robots"]) == 0
    assert "From arm.xml: 7 joints" in capsys.readouterr().out


def test_a_folder_that_is_no_arm_is_refused_by_what_it_lacks(tmp_path, named):
    _adopted(tmp_path, named, "--name", "their_arm")
    file = named / "their_arm" / "their_arm.xml"
    file.write_text(file.read_text().replace('name="flange"', 'name="flansch"'))
    content = {"name": "a", "robot": {"name": "their_arm"}, "task": {"type": "circle"}, "controller": "pinv"}
    with pytest.raises(SurgsimError, match="'their_arm' has not the form of an arm: there is no site flange"):
        load_scenario(content)


def test_what_it_cannot_write_over_it_leaves(tmp_path, named, capsys):
    (named / "their_arm").mkdir(parents=True)
    (named / "their_arm" / "notes.txt").write_text("mine")
    assert _adopted(tmp_path, named, "--name", "their_arm") == 2
    assert "was not written by surgsim adopt" in capsys.readouterr().err
    assert [file.name for file in (named / "their_arm").iterdir()] == ["notes.txt"]


def test_an_edited_folder_is_not_written_over(tmp_path, named, capsys):
    _adopted(tmp_path, named, "--name", "their_arm")
    again = ["adopt", str(tmp_path / "arm.xml"), "--set", "base_body=pedestal", "--set", JOINTS]
    again += ["--out", str(named), "--quick", "--name", "their_arm"]
    assert main(again) == 0
    file = named / "their_arm" / "their_arm.xml"
    file.write_text(file.read_text().replace("3.14159", "2.5"))
    edited = file.read_text()
    assert main(again) == 2
    assert "was edited since it was written" in capsys.readouterr().err
    assert file.read_text() == edited


def test_a_folder_of_somebody_elses_is_left_alone(tmp_path, capsys):
    source = write_mjcf(tmp_path)
    (tmp_path / "arm").mkdir()
    source.rename(tmp_path / "arm" / "arm.xml")
    (tmp_path / "meshes").rename(tmp_path / "arm" / "meshes")
    (tmp_path / "arm" / "LICENSE").write_text("theirs")
    before = (tmp_path / "arm" / "arm.xml").read_text()
    words = ["adopt", str(tmp_path / "arm" / "arm.xml"), "--set", "base_body=pedestal", "--set", JOINTS]
    assert main([*words, "--out", str(tmp_path), "--quick"]) == 2
    assert "was not written by surgsim adopt" in capsys.readouterr().err
    assert (tmp_path / "arm" / "arm.xml").read_text() == before
    assert (tmp_path / "arm" / "LICENSE").is_file()


def test_the_card_asks_whether_a_flange_askew_is_meant(tmp_path, named, capsys):
    path = write_urdf(tmp_path)
    path.write_text(path.read_text().replace('rpy="0 0 0.3"', 'rpy="0 1.5708 0"'))
    assert main(["adopt", str(path), "--out", str(named), "--quick"]) == 0
    assert "is 90 degrees from" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("name", ["lwr4plus", "Their Arm"])
def test_names_that_cannot_be_are_refused(tmp_path, named, capsys, name):
    assert _adopted(tmp_path, named, "--name", name) == 2
    assert f"--name: '{name}'" in capsys.readouterr().err


def test_a_file_of_another_kind_is_refused(tmp_path, capsys):
    (tmp_path / "a.sdf").write_text("<sdf/>")
    assert main(["adopt", str(tmp_path / "a.sdf")]) == 2
    assert "is neither MJCF nor URDF: its first element is <sdf>" in capsys.readouterr().err


def test_ports_are_tried_and_a_circle_is_run(monkeypatch):
    monkeypatch.setattr(ports, "_ACROSS", 3)
    monkeypatch.setattr(ports, "_UP", 2)
    told = []
    robot = RobotConfig(mjcf=str(robot_file("lwr4plus")))
    adoption = adopt(robot, "arm", mapped=True, progress=lambda done, total: told.append((done, total)))
    assert told[-1] == (6, 6)
    assert adoption.ports.margin_rad.shape == (2, 3)
    assert 0 < adoption.ports.reached < 6
    assert sum(adoption.ports.reasons.values()) == 6 - adoption.ports.reached
    assert adoption.works
    assert adoption.trial.result.metrics["rcm_error_max_mm"] < 0.05


def test_a_package_offers_a_robot(tmp_path, named, monkeypatch):
    _adopted(tmp_path, named, "--name", "their_arm")
    monkeypatch.delenv(SEARCH_PATH)
    package = tmp_path / "lab_robots"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (named / "their_arm").rename(package / "their_arm")
    (package / "their_arm" / "__init__.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path)
    place = "lab_robots.their_arm"
    offer = Offer(group="surgsim.robots", name="their_arm", place=place, package="lab", version="1")
    other = Offer(group="surgsim.robots", name="lost", place="lab_robots.no", package="lab", version="1")
    monkeypatch.setattr(folders, "offers", lambda group: {"their_arm": offer, "lost": other})
    assert "their_arm" in robot_names()
    assert robot_file("their_arm") == package / "their_arm" / "their_arm.xml"
    for check in robots.CHECKS:
        check.run("their_arm")
    text = robot_file("their_arm").read_text()
    limits = re.search(r'<numeric name="velocity_limit_rad_per_s".*?/>', text)[0]
    robot_file("their_arm").write_text(text.replace(limits, limits.replace("3.14159", "0", 1)))
    with pytest.raises(BrokenPromiseError, match="velocity is not above zero"):
        robots.has_limits("their_arm")
    with pytest.raises(SurgsimError, match="robot 'lost' of the package lab 1"):
        robot_file("lost")


def test_a_urdf_needs_no_options_where_it_says_its_flange(tmp_path, named, capsys):
    assert main(["adopt", str(write_urdf(tmp_path)), "--out", str(named), "--quick"]) == 0
    assert "6: joint_1" in capsys.readouterr().out


def test_a_robot_s_folder_can_state_its_drives_and_keeps_them(tmp_path, named, capsys):
    _adopted(tmp_path, named, "--name", "their_arm")
    with pytest.raises(ValueError, match=r"give stiffness_nm_per_rad: the robot's folder has no drive\.yaml"):
        RobotConfig(name="their_arm", drive="real")
    text = "stiffness_nm_per_rad: 8000.0\nrotor_inertia_kg_m2: [0.6, 0.6, 0.5, 0.5, 0.2, 0.2, 0.2]\n"
    (named / "their_arm" / "drive.yaml").write_text(text + "coulomb_nm: 1.0\n")
    drives = RobotConfig(name="their_arm", drive={"coulomb_nm": 0.5}).drives
    assert drives.stiffness_nm_per_rad == 8000.0
    assert drives.coulomb_nm == 0.5
    words = ["adopt", str(tmp_path / "arm.xml"), "--set", "base_body=pedestal", "--set", JOINTS, "--quick"]
    assert main([*words, "--out", str(named), "--name", "their_arm"]) == 0
    assert RobotConfig(name="their_arm", drive="real").drives.coulomb_nm == 1.0
    (named / "their_arm" / "drive.yaml").write_text("stiffness: 1.0\n")
    with pytest.raises(ValueError, match=r"drive\.yaml: .*stiffness"):
        RobotConfig(name="their_arm", drive="real")
    capsys.readouterr()
