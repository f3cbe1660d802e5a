"""A robot's folder: its MJCF and meshes, the card, and the map of ports."""

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from surgsim.adopt.picture import port_picture
from surgsim.adopt.ports import DEPTH_M, RADIUS_M, PortMap, circle_through, map_ports
from surgsim.errors import SurgsimError
from surgsim.models.adopted.arm import adopted
from surgsim.models.adopted.card import Card
from surgsim.models.adopted.written import model_files
from surgsim.models.config import RobotConfig
from surgsim.models.drive import FILE as DRIVE
from surgsim.recording.files import write_file
from surgsim.recording.folders import make_folder, sync_tree
from surgsim.runs.drafts import draft_of
from surgsim.runs.exchange import put_in_place
from surgsim.runs.folder import RunResult, execute

_ASKEW_DEG = 45.0
CARD, MAP, MANIFEST = "README.md", "ports.png", "robot.json"


@dataclass(frozen=True, kw_only=True)
class Trial:
    """A circle through the port with the most room, as a check.

    Attributes:
        port_m: The port in the frame of the base [m].
        result: The run.
    """

    port_m: tuple[float, float, float]
    result: RunResult

    @property
    def told(self) -> str:
        """How it went."""
        metrics, ending = self.result.metrics, self.result.trace.meta.ending
        place = ", ".join(f"{x:.2f}" for x in self.port_m)
        tip, rcm = metrics["tip_error_max_mm"], metrics["rcm_error_max_mm"]
        errors = "" if tip is None or rcm is None else f"; tip at most {tip:.3g} mm off, shaft {rcm:.3g} mm"
        done = "done" if self.result.verdict.success else f"NOT done, {self.result.verdict.reason}"
        return f"circle through a port at ({place}) m: {ending.outcome.name.lower()}, {done}{errors}"


@dataclass(frozen=True, kw_only=True)
class Adoption:
    """What became of a model file.

    Attributes:
        name: What the arm is called.
        robot: The file, and what was said about it.
        card: What was found in it.
        ports: Where a port can be; None if that was not asked for.
        trial: A run as a check; None without a port that can be reached.
    """

    name: str
    robot: RobotConfig
    card: Card
    ports: PortMap | None
    trial: Trial | None

    @property
    def works(self) -> bool:
        """Whether a circle was followed, by the thresholds of any run."""
        return self.trial is not None and bool(self.trial.result.verdict.success)


def adopt(
    robot: RobotConfig, name: str, *, mapped: bool, progress: Callable[[int, int], None] | None = None
) -> Adoption:
    """Look at an arm's file, and where it can work.

    Args:
        robot: The file, and what is said about it.
        name: What the arm is to be called.
        mapped: Whether ports are tried, and a circle is run.
        progress: Told how many ports were tried, and of how many.
    """
    card = adopted(robot).card
    if not mapped:
        return Adoption(name=name, robot=robot, card=card, ports=None, trial=None)
    ports = map_ports(robot, card.reach_m, progress)
    trial = None
    if ports.best_m is not None:
        x, z = ports.best_m
        port = (x, 0.0, z)
        trial = Trial(port_m=port, result=execute(circle_through(robot, port)))
    return Adoption(name=name, robot=robot, card=card, ports=ports, trial=trial)


def write_robot_folder(folder: Path, adoption: Adoption) -> None:
    """Write the arm's folder in one step; one that is there is replaced if it was written so, and not edited.

    A `drive.yaml` that was put there is kept.

    Raises:
        SurgsimError: If the folder holds something else, or the disk refuses.
    """
    name = adoption.name
    _check_folder(folder, name)
    arm = adopted(adoption.robot)
    files = model_files(arm.mechanics, name, arm.drawn, ["Written by surgsim adopt.", *_origin(adoption)])
    files[MANIFEST] = _manifest(adoption, files[f"{name}.xml"])
    files[CARD] = card_text(adoption).encode()
    if adoption.ports is not None:
        files[MAP] = port_picture(adoption.ports, name)
    try:
        if (folder / DRIVE).is_file():  # somebody's own knowledge of the arm
            files[DRIVE] = (folder / DRIVE).read_bytes()
        make_folder(folder.parent)
        with draft_of(folder) as draft:
            for place, content in files.items():
                (draft / place).parent.mkdir(exist_ok=True)
                write_file(draft / place, content)
            sync_tree(draft)
            put_in_place(draft, folder)
    except OSError as error:
        raise SurgsimError(f"{folder} cannot be written: {error.strerror or error}") from error


def _check_folder(folder: Path, name: str) -> None:
    """Refuse to replace what is no robot's folder of ours, or was edited since.

    Raises:
        SurgsimError: With the reason.
    """
    if not folder.exists():
        return
    other = f"{folder} is there and was not written by surgsim adopt: give another --out or --name"
    try:
        manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
        written = manifest["model_sha256"]
        model = (folder / f"{name}.xml").read_bytes()
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SurgsimError(other) from error
    if hashlib.sha256(model).hexdigest() != written:
        raise SurgsimError(f"{folder}/{name}.xml was edited since it was written: move the folder away first")


def _manifest(adoption: Adoption, model: bytes) -> bytes:
    """Where the folder is from, as JSON."""
    path, kind = adoption.robot.file
    content = {
        "name": adoption.name,
        "file": path.name,
        "kind": kind,
        "files_sha256": adoption.robot.files_sha256,
        "model_sha256": hashlib.sha256(model).hexdigest(),
    }
    return (json.dumps(content, indent=2) + "\n").encode()


def _origin(adoption: Adoption) -> list[str]:
    path, kind = adoption.robot.file
    return [
        f"From the {kind.upper()} file {path.name}; the file and all that it names have the hash",
        f"sha256 {adoption.robot.files_sha256}",
    ]


def card_rows(adoption: Adoption) -> list[tuple[str, str]]:
    """What there is to say about the arm: what, and what of it."""
    card, ports = adoption.card, adoption.ports
    rows = [
        ("joints", f"{len(card.joints)}: {', '.join(card.joints)}"),
        ("links", ", ".join(card.links)),
        ("redundancy", f"{card.redundancy} with tip and shaft held{_roll(card)}"),
        ("flange", _flange(card)),
        ("mass", f"{card.mass_kg:.2f} kg without the base"),
        ("reach", f"{card.reach_m:.3f} m from the second joint to the flange, stretched"),
        ("collisions", f"looked for between {card.capsules} capsules"),
        *((f"{what} limits", source) for what, source in card.sources.items()),
        *(("assumed", line) for line in card.assumed),
        *(("left out", line) for line in card.left_out),
        *(("lacking", line) for line in card.lacking),
    ]
    if ports is not None:
        tried = ports.margin_rad.size
        rows.append(("ports", f"{ports.reached} of {tried} upright ones in front of the base can be used"))
        rows += [("no port", f"{times}: {reason}") for reason, times in _most(ports.reasons)]
    if adoption.trial is not None:
        rows.append(("check", adoption.trial.told))
    return rows


def _most(reasons: dict[str, int], most: int = 3) -> Sequence[tuple[str, str]]:
    """Reasons and how often, the rarer ones together."""
    ranked = sorted(reasons.items(), key=lambda item: -item[1])
    rest = sum(count for _, count in ranked[most:])
    told = [(reason, _times(count)) for reason, count in ranked[:most]]
    return [*told, ("another reason", _times(rest))] if rest else told


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def _flange(card: Card) -> str:
    angle = (
        f"its z, along which the shaft goes, is {card.flange_turn_deg:.0f} degrees from the last joint's axis"
    )
    return angle if card.flange_turn_deg < _ASKEW_DEG else f"{angle}: is it the axis that is meant?"


def _roll(card: Card) -> str:
    return "; the last joint rolls the shaft" if card.rolls_shaft else ""


def card_text(adoption: Adoption) -> str:
    """The card as a page."""
    lines = [f"# {adoption.name}", "", *_origin(adoption), "", "| what | |", "|---|---|"]
    lines += [f"| {what} | {text} |" for what, text in card_rows(adoption)]
    if adoption.ports is not None:
        about = f"a circle of {1e3 * RADIUS_M:.0f} mm, {1e3 * DEPTH_M:.0f} mm below the port"
        lines += ["", f"Where a port can be, for {about}:", "", f"![ports]({MAP})"]
    return "\n".join(lines) + "\n"
