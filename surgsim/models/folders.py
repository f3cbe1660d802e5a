"""Robot folders: where they are, and what they are called.

A robot is a folder with `<name>.xml` in it, in the form that `surgsim.models.robot` states. There are those
that are shipped, `assets/robots/`; those in the folders that the variable `SURGSIM_ROBOTS` lists, as `PATH`
lists programs; and those that installed packages offer in the entry-point group `surgsim.robots`: the name,
and an importable package whose folder it is. A shipped name counts before one on the search path, and that
before one of a package.

`assets/test_arms/` holds arms of other numbers of joints, for tests: no real ones, and not listed.
"""

import importlib.util
import os
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import mujoco

from surgsim.catalog import NAME
from surgsim.errors import SurgsimError, unknown_name
from surgsim.models.graft import read_mjcf
from surgsim.plugins import Offer, offers
from surgsim.resources import resource_dir

ROBOTS, TEST_ARMS = "robots", "test_arms"
"""Folders of `assets/`."""
SEARCH_PATH = "SURGSIM_ROBOTS"
GROUP = "surgsim.robots"
LITERAL_D2 = "literal_d2_m"
"""Numeric of the arm whose DH table a paper misprints: d2 as it stands there."""


def robot_names() -> list[str]:
    """Names of all robots, sorted: those that are shipped, on the search path, and of other packages."""
    return sorted({*_files(_shipped(ROBOTS)), *on_path(SEARCH_PATH), *offers(GROUP)})


def shipped_robots() -> list[str]:
    """Names of the robots that are shipped, sorted."""
    return sorted(_files(_shipped(ROBOTS)))


def is_shipped(name: str) -> bool:
    """Whether the arm of that name comes with the package."""
    return name in shipped_robots() or name in arms_for_tests()


def arms_for_tests() -> list[str]:
    """Names of the arms that are for tests alone, sorted: by their number of joints."""
    return sorted(_files(_shipped(TEST_ARMS)))


def known_robot(name: str) -> str:
    """`name`, if there is such an arm.

    Raises:
        ValueError: If there is not.
    """
    if name not in (*robot_names(), *arms_for_tests()):
        hint = " A file is given as mjcf or urdf." if Path(name).suffix in (".xml", ".urdf", ".mjcf") else ""
        raise ValueError(unknown_name(name, "robot", robot_names()) + hint + lost_of(SEARCH_PATH))
    return name


def lost_of(variable: str) -> str:
    """Which folders of the search path in an environment variable are not there, as the end of a message."""
    folders = [folder for folder in os.environ.get(variable, "").split(os.pathsep) if folder]
    lost = [folder for folder in folders if not Path(folder).is_dir()]
    return f" {variable} lists {', '.join(lost)}, which is no folder." if lost else ""


def robot_file(name: str) -> Path:
    """The MJCF of a robot.

    Raises:
        SurgsimError: If there is no such robot, or its package has no such file.
    """
    for found in (_files(_shipped(ROBOTS)), on_path(SEARCH_PATH), _files(_shipped(TEST_ARMS))):
        if name in found:
            return found[name]
    if name in (offered := offers(GROUP)):
        return file_of_package("robot", offered[name])
    raise SurgsimError(unknown_name(name, "robot", robot_names()))


def named_spec(name: str, *, drawn: bool) -> mujoco.MjSpec:
    """The arm of a robot's folder as it stands, to be changed; unless `drawn` without what is only looked at.

    Raises:
        SurgsimError: If there is no such robot.
    """
    file = robot_file(name)
    try:
        return read_mjcf(file, drawn=drawn)
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise SurgsimError(f"robot '{name}': MuJoCo cannot read {file}: {reason}") from error


def with_literal_variant() -> list[str]:
    """The shipped robots whose DH table a paper prints otherwise, see `robot_spec`."""
    specs = {name: named_spec(name, drawn=False) for name in shipped_robots()}
    return [name for name, spec in specs.items() if any(n.name == LITERAL_D2 for n in spec.numerics)]


def _shipped(kind: str) -> Path:
    return resource_dir("assets") / kind


def brought_robot(name: str) -> Offer | None:
    """What package brings the robot of that name; None where it is shipped or on the search path."""
    hidden = is_shipped(name) or name in on_path(SEARCH_PATH)
    return None if hidden else offers(GROUP).get(name)


def on_path(variable: str) -> dict[str, Path]:
    """Name to the MJCF of what is in the folders that an environment variable lists; the first counts."""
    found: dict[str, Path] = {}
    for folder in os.environ.get(variable, "").split(os.pathsep):
        for name, file in _files(Path(folder)).items() if folder else ():
            found.setdefault(name, file.absolute())
    return found


def _files(folder: Path) -> dict[str, Path]:
    """Name to the MJCF of every arm of a folder of robots; of one that is a robot's own folder, that arm."""
    return dict(_found(folder))


def _found(folder: Path) -> Iterator[tuple[str, Path]]:
    if not folder.is_dir():
        return
    for path in (folder.absolute(), *sorted(folder.iterdir())):
        if NAME.fullmatch(path.name) and (file := path / f"{path.name}.xml").is_file():
            yield path.name, file


@lru_cache(maxsize=32)
def file_of_package(what: str, offer: Offer) -> Path:
    """The MJCF `NAME.xml` in the folder of the package that an offer names; `what` it is, for messages.

    Raises:
        SurgsimError: If there is no such package, or no such file in it.
    """
    name, label = offer.name, f"{what} '{offer.name}' {offer.origin}"
    try:
        found = importlib.util.find_spec(offer.place)
    except (ImportError, ValueError) as error:
        raise SurgsimError(f"{label} is not found: {error}") from error
    for folder in (found.submodule_search_locations or []) if found else []:
        if (file := Path(folder) / f"{name}.xml").is_file():
            return file
    raise SurgsimError(f"{label}: there is no {name}.xml in {offer.place}")
