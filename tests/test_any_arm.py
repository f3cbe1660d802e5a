"""The package goes by the number of an arm's joints, and names no robot: those are in the robots' folders."""

import re
from pathlib import Path

import pytest

import surgsim
from surgsim.models.folders import robot_names

PACKAGE = Path(surgsim.__file__).parent
FILES = sorted(
    path for path in PACKAGE.rglob("*.py") if not {"studies", "_data"} & set(path.relative_to(PACKAGE).parts)
)
ROBOTS = re.compile(rf"\b({'|'.join(robot_names())}|lwr ?4?\+?|franka|kuka)\b", re.I)
SEVEN = re.compile(
    r"\(7,|[\w)], 7\)|range\(1, 8\)|(zeros|ones|full|empty|eye|normal)\(\(?(size=)?7\b|3 ?[x×] ?7\b"
)
MADE_NAMES = re.compile(r"surgsim/[\w-]+-v0")  # of learning environments, from the scenarios' names


def found(pattern):
    return [
        f"{path.relative_to(PACKAGE)}:{number}: {line.strip()}"
        for path in FILES
        for number, line in enumerate(path.read_text().splitlines(), start=1)
        if pattern.search(MADE_NAMES.sub("", line))
    ]


def test_no_robot_is_named():
    assert len(FILES) > 200
    assert found(ROBOTS) == []


def test_no_array_is_of_seven():
    assert found(SEVEN) == []


@pytest.mark.parametrize(
    ("pattern", "line"),
    [
        (ROBOTS, 'if name == "panda":'),
        (ROBOTS, "the LWR4+ has"),
        (SEVEN, "q: Joint positions (7,) [rad]."),
        (SEVEN, "Jacobian (3, 7)"),
        (SEVEN, "np.zeros(7)"),
        (SEVEN, "for i in range(1, 8):"),
    ],
)
def test_they_would_be_found(pattern, line):
    assert pattern.search(line)
