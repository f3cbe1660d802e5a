"""`surgsim adopt`."""

import argparse
import json
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from surgsim.cli.scenario_options import add_settings

if TYPE_CHECKING:
    from surgsim.models.config import RobotConfig

HELP = "make a robot of somebody's MJCF or URDF file"
EXAMPLES = """Looks at a model, says what was found, assumed and left out, tries where a port can be, runs a
circle as a check, and writes a robot's folder. Scenarios then know it by its name, where the
variable SURGSIM_ROBOTS lists the folder that it is in.

examples:
  surgsim adopt arm.xml
  surgsim adopt arm.urdf --flange tool0 --name my_arm --out robots
  surgsim adopt cell.xml --set base_body=left_base --set "joints=[l1, l2, l3, l4, l5, l6]"
  surgsim adopt arm.xml --set "limits.torque_nm=[150, 150, 100, 100, 40, 40, 40]" --quick
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("file", type=Path, metavar="FILE", help="MJCF or URDF file")
    parser.add_argument("--flange", metavar="NAME", help="site or body of the file where the tool is fixed")
    add_settings(parser, "a key of a scenario's robot, such as limits.torque_nm; may be given again")
    parser.add_argument("--name", metavar="NAME", help="what the robot is called; default: the file's name")
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("robots"),
        metavar="DIR",
        help="where its folder goes; default: robots",
    )
    parser.add_argument("--quick", action="store_true", help="try no ports and run no circle")
    parser.add_argument("--json", action="store_true", help="print JSON")


def execute(options: argparse.Namespace) -> int:
    """Write the folder and print the card; 1 if no port can be reached, or the circle does not complete."""
    from surgsim.adopt.folder import adopt, card_rows, write_robot_folder
    from surgsim.cli.output import show_count
    from surgsim.cli.table import print_prose, print_table
    from surgsim.models.adopted.file import kind_of
    from surgsim.packages import require

    if not options.quick:
        require("the map of ports needs", "matplotlib", otherwise="--quick")
    robot, name = _robot(options, kind_of(options.file)), _checked_name(options)
    with show_count(f"trying ports of {name}", "ports", quiet=options.quick) as progress:
        adoption = adopt(robot, name, mapped=not options.quick, progress=progress)
    folder = options.out / name
    write_robot_folder(folder, adoption)
    if options.json:
        print(json.dumps({"name": name, "folder": str(folder), "card": card_rows(adoption)}, indent=2))
    else:
        print_table(f"{name}, from {options.file}", ("what", "found"), card_rows(adoption))
    print_prose(f"wrote {folder}; with SURGSIM_ROBOTS={options.out} it is robot '{name}'", sys.stderr)
    return 0 if options.quick or adoption.works else 1


def _robot(options: argparse.Namespace, kind: str) -> "RobotConfig":
    """The file, and what the options say about it."""
    from surgsim.models.config import RobotConfig
    from surgsim.scenario.plain import document_of
    from surgsim.scenario.validate import validate
    from surgsim.scenario.yaml_text import set_value

    content = {kind: str(options.file)} | ({} if options.flange is None else {"flange": options.flange})
    document = document_of(content, str(options.file))
    for assignment in options.assignments:
        document = set_value(document, assignment)
    return validate(RobotConfig, document)


def _checked_name(options: argparse.Namespace) -> str:
    """What the robot is to be called."""
    from surgsim.catalog import check_name
    from surgsim.errors import SurgsimError
    from surgsim.models.folders import shipped_robots

    name = options.name or re.sub(r"[^a-z0-9]+", "_", options.file.stem.lower()).strip("_") or "arm"
    try:
        check_name(name)
    except ValueError as error:
        raise SurgsimError(f"--name: {error}") from error
    if name in shipped_robots():
        raise SurgsimError(f"--name: '{name}' is a robot that is shipped; give another name")
    return name
