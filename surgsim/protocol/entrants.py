"""Who is scored: a controller, what it reads, and which tracks it may enter."""

import hashlib
import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from surgsim.control.controller import ControllerConfig
from surgsim.control.external.given_commands import given
from surgsim.control.policies.registry import policy_names
from surgsim.errors import ScenarioError, SurgsimError, unknown_name
from surgsim.packages import MissingPackageError
from surgsim.protocol.canonical import sha256_of
from surgsim.protocol.definition import Protocol, TrackConfig, entry_file, entry_label, with_scheme
from surgsim.runs.part_origins import external_names, missing_package
from surgsim.scenario.hashed import hashed
from surgsim.scenario.load import find, load_controller, shipped

ANY = "*"
"""Stands in a track where any estimator may be used."""
_BUDGET = re.compile(r"^# budget: ([0-9]+) runs?, ([0-9]+) taken", re.MULTILINE)
_SEEDS = re.compile(r"^# tuning seeds: (\S+)", re.MULTILINE)
_SCENARIOS = re.compile(r"^# scenarios: (.+)$", re.MULTILINE)


@dataclass(frozen=True, kw_only=True)
class Entrant:
    """A controller that is scored.

    Attributes:
        config: The controller.
        tuning: What its gains cost: `runs`, `seeds`, `scenarios`, `source`; None where unknown.
        weights: Files beside the packages that it consists of, with their SHA-256.
        label: What tables call it, if not by its own name.
        scheme: The track's scheme with which it runs; empty in a track without schemes.
    """

    config: ControllerConfig
    tuning: Mapping[str, Any]
    weights: Mapping[str, str] = field(default_factory=dict)
    label: str = ""
    scheme: str = ""

    @property
    def name(self) -> str:
        """What tables call it."""
        return self.label or with_scheme(self.config.name, self.scheme)

    @property
    def definition(self) -> dict[str, Any]:
        """All of the controller and its scheme, every default explicit but those that no hash holds."""
        content = hashed(self.config)
        return {**content, "scheme": self.scheme} if self.scheme else content

    @property
    def definition_sha256(self) -> str:
        """Hash of the definition."""
        return sha256_of(self.definition)


def entrant(
    source: str | None, *, tuning_runs: int | None = None, label: str = "", scheme: str = ""
) -> Entrant:
    """The controller by the name of a shipped one, by its file, or the name of an installed policy.

    Args:
        source: The name or path; None: the one external controller whose command is given, for torques.
        tuning_runs: Runs that its gains took, as its owner declares; None: what its file says.
        label: What tables call it, if not by its own name.
        scheme: The track's scheme with which it runs.

    Raises:
        SurgsimError: If there is no such controller, or anything is wrong with it.
    """
    if source is None:
        config, tuning = _external(dict(given())), _declared(tuning_runs)
    elif source in policy_names() and source not in shipped("controllers"):
        config, tuning = _policy(source), _declared(tuning_runs)
    else:
        config = load_controller(source)
        tuning = (
            _declared(tuning_runs)
            if tuning_runs is not None
            else _told(find(source, "controllers", "controller"))
        )
    return Entrant(config=config, tuning=tuning, weights=program_hashes(config), label=label, scheme=scheme)


def track_for(protocol: Protocol, entrant: Entrant, name: str | None) -> str:
    """The track called `name`, or the first that the controller may enter.

    Raises:
        SurgsimError: If it may not enter.
    """
    if name is not None:
        check_entry(name, protocol.track(name), entrant.config)
        return name
    reasons = []
    for track, config in protocol.config.tracks.items():
        if not (reason := refusal(config, entrant.config)):
            return track
        reasons.append(f"{track}: {reason}")
    raise SurgsimError(f"{entrant.name} may enter no track of {protocol.name}: {'; '.join(reasons)}")


def check_entry(name: str, track: TrackConfig, config: ControllerConfig) -> None:
    """Refuse a controller that reads what the track does not give.

    Raises:
        SurgsimError: If it does.
    """
    if reason := refusal(track, config):
        raise SurgsimError(f"{config.name} may not enter track '{name}': {reason}")


def check_entries(protocol: Protocol, tracks: Sequence[str]) -> None:
    """Refuse tracks with an entry that cannot run here, before the first one does.

    Raises:
        MissingPackageError: With every such entry, what it needs, and the tracks that have none.
    """
    lines = {
        (track, entry_label(entry)): line
        for track in tracks
        for entry in protocol.track(track).entries
        if (line := missing_package(load_controller(entry_file(entry))))
    }
    if not lines:
        return
    entries = "; ".join(
        f"{', '.join(f'{track}/{name}' for (track, name), its in lines.items() if its == line)}: {line}"
        for line in dict.fromkeys(lines.values())
    )
    others = [track for track in protocol.config.tracks if track not in {track for track, _ in lines}]
    otherwise = f"; --track {' or '.join(others)} can be run" if others and len(tracks) > 1 else ""
    raise MissingPackageError(f"not every entry of {protocol.name} can be run here: {entries}{otherwise}")


def refusal(track: TrackConfig, config: ControllerConfig) -> str:
    """Why a controller may not enter a track; empty if it may."""
    for key, allowed in (("port", track.ports), ("instrument", track.instruments)):
        kind = str(getattr(config, key).type)
        if ANY not in allowed and kind not in allowed:
            return f"it reads {key}: {kind}, and the track gives {', '.join(allowed)}"
    if track.servo is None and config.torque_law is None:
        return "it commands no torques: its torque_law is null"
    return ""


def _declared(runs: int | None) -> dict[str, Any]:
    if runs is not None and runs < 0:
        raise SurgsimError(f"--tuning-runs: {runs} is not allowed: must be 0 or more")
    return {
        "runs": runs,
        "seeds": None,
        "scenarios": None,
        "source": "unknown" if runs is None else "declared",
    }


def _told(path: Path) -> dict[str, Any]:
    """What the head of a controller's file says of its tuning, as `surgsim tune` writes it."""
    text = path.read_text(encoding="utf-8")
    budget, seeds, scenarios = _BUDGET.search(text), _SEEDS.search(text), _SCENARIOS.search(text)
    if budget is None:
        return _declared(None)
    return {
        "runs": int(budget[2]),
        "seeds": seeds[1] if seeds else None,
        "scenarios": scenarios[1] if scenarios else None,
        "source": "surgsim tune",
    }


def _external(commands: Mapping[str, str]) -> ControllerConfig:
    """A controller whose torques come from the one program that is given."""
    if len(commands) != 1:
        raise SurgsimError("give a controller, or one --external NAME=COMMAND, which gives the joint torques")
    name = next(iter(commands))
    law = {"type": "external", "name": name}
    resolver = {"type": "pinv"}
    return load_controller(
        {"name": name, "resolver": resolver, "torque_law": law, "evaluate_at": "reference"}
    )


def _policy(name: str) -> ControllerConfig:
    """A controller whose tip velocity is a policy's."""
    resolver = {"type": "policy", "name": name, "action": "tip_velocity", "resolver": {"type": "pinv"}}
    return load_controller(
        {"name": name, "resolver": resolver, "torque_law": {"type": "hierarchical_impedance"}}
    )


def program_hashes(config: ControllerConfig) -> dict[str, str]:
    """Hashes of the files that the commands of the controller's external parts name."""
    found, commands = {}, dict(given())
    for name in external_names(config):
        for word in shlex.split(commands.get(name, "")):
            path = Path(word.partition(":")[0])
            if path.is_file():
                found[path.name] = hashlib.sha256(path.read_bytes()).hexdigest()
    return dict(sorted(found.items()))


def known_entrant(source: str) -> bool:
    """Whether `source` is a shipped controller, an installed policy, or looks like a file."""
    return source in (*shipped("controllers"), *policy_names()) or Path(source).suffix in (".yaml", ".yml")


def check_known(source: str) -> None:
    """Refuse a name that is nothing that can be scored.

    Raises:
        ScenarioError: If it is not.
    """
    if not known_entrant(source):
        known = [*shipped("controllers"), *policy_names()]
        raise ScenarioError(
            "", f"{unknown_name(source, 'shipped controller or policy', known)} Or give a .yaml file."
        )
