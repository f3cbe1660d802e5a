"""Which other packages gave a part to a run, and which file its policy stands in."""

import importlib
import sys
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from surgsim.catalog import PartConfig
from surgsim.control.external.declared import last_declared
from surgsim.control.external.given_commands import check_named, command_for
from surgsim.control.policies.registry import find_policy
from surgsim.control.resolvers.external import ExternalConfig
from surgsim.control.resolvers.policy import PolicyConfig
from surgsim.control.torque_laws.external import ExternalLawConfig
from surgsim.errors import SurgsimError
from surgsim.metrics.outside import GROUP as METRICS
from surgsim.models.arm import ArmModel
from surgsim.models.config import InstrumentConfig, RobotConfig
from surgsim.models.folders import brought_robot
from surgsim.models.instrument_files import brought_instrument
from surgsim.packages import MissingPackageError
from surgsim.plugins import Offer, all_offers, offers
from surgsim.runs.sources import hash_of, package_sha256
from surgsim.scenario.arms import Experiment, each_arm
from surgsim.scenario.schema import Scenario


def plugins_of(scenario: Experiment) -> dict[str, dict[str, Any]]:
    """Version and hash of the sources of each other package that gave `scenario` a part, or its run a metric.

    Robots and instruments with a name are parts too. A module that belongs to no installed package has no
    version.
    """
    found = {}
    for part in _parts(scenario):
        for module in _modules(part):
            package = module.partition(".")[0]
            if package != "surgsim" and (told := _told(package)):
                found[package] = told
        if (offer := _brought(part)) is not None:
            importlib.import_module(package := offer.place.partition(".")[0])
            if told := _told(package):
                found[package] = told
    for offer in offers(METRICS).values():
        package = offer.place.partition(":")[0].partition(".")[0]
        if told := _told(package):
            found[package] = told
    return dict(sorted(found.items()))


def policies_of(scenario: Experiment) -> dict[str, str | None]:
    """Hash of the file that each policy of `scenario` stands in; None for one that stands in no file."""
    names = {part.name for part in _parts(scenario) if isinstance(part, PolicyConfig)}
    return {name: _file_hash(_home(_policy(name))) for name in sorted(names)}


def externals_of(scenario: Experiment) -> dict[str, dict[str, str] | None]:
    """Name and version that each external controller of `scenario` declares; None if it declares nothing.

    One that this process has not asked yet is started and asked.
    """
    found: dict[str, dict[str, str] | None] = {}
    for one in each_arm(scenario):
        for part in _parts(one.controller):
            if isinstance(part, ExternalConfig | ExternalLawConfig) and part.name not in found:
                try:
                    found[part.name] = _declared(part, one)
                except SurgsimError:  # of a run that was refused for it
                    found[part.name] = None
    return dict(sorted(found.items()))


def external_names(controller: BaseModel) -> list[str]:
    """Names of the external controllers that a controller consists of."""
    parts = (part for part in _parts(controller) if isinstance(part, ExternalConfig | ExternalLawConfig))
    return sorted({part.name for part in parts})


def _declared(part: ExternalConfig | ExternalLawConfig, scenario: Scenario) -> dict[str, str]:
    """What an external controller says of itself."""
    told = last_declared(command_for(part.name))
    if told is None:
        asked = part.build(ArmModel(scenario.scene)).outside
        assert asked is not None
        asked.close()
        told = last_declared(command_for(part.name))
    assert told is not None
    return {"name": told.name, "version": told.release}


def check_parts(scenarios: Iterable[Experiment]) -> None:
    """Refuse scenarios with a part that cannot be had here.

    That is one whose package is not installed, or an external controller that has no command; without an
    external controller that was asked for they are refused too.

    Raises:
        SurgsimError: For the first.
    """
    parts = [part for s in scenarios for one in each_arm(s) for part in _parts(one.controller)]
    for part in parts:
        part.check_installed()
    check_named(part.name for part in parts if isinstance(part, ExternalConfig | ExternalLawConfig))


def missing_package(controller: BaseModel) -> str:
    """The line about a package that a controller needs and that is not installed; empty where all are."""
    try:
        for part in _parts(controller):
            part.check_installed()
    except MissingPackageError as error:
        return str(error)
    return ""


def _parts(value: Any) -> Iterator[PartConfig]:
    """Every part of a scenario, those inside of others too."""
    if isinstance(value, PartConfig):
        yield value
    if isinstance(value, BaseModel):
        for name in type(value).model_fields:
            yield from _parts(getattr(value, name))
    elif isinstance(value, tuple | list):
        for item in value:
            yield from _parts(item)
    elif isinstance(value, dict):
        yield from _parts(tuple(value.values()))


def _modules(part: PartConfig) -> Iterator[str]:
    yield type(part).__module__
    if isinstance(part, PolicyConfig):
        yield _home(_policy(part.name))


def _brought(part: PartConfig) -> Offer | None:
    """What brings the robot or the instrument that a part names; None where no other package does."""
    if isinstance(part, RobotConfig) and part.name is not None:
        return brought_robot(part.name)
    if isinstance(part, InstrumentConfig) and part.name is not None:
        return brought_instrument(part.name)
    return None


def _policy(name: str) -> Any:
    try:
        return find_policy(name)
    except SurgsimError:  # of a run that was refused for it
        return None


def _home(policy: Any) -> str:
    """Module of a function, or of the class of an object that can be called."""
    return getattr(policy, "__module__", None) or type(policy).__module__


def _file_hash(module: str) -> str | None:
    file = getattr(sys.modules.get(module), "__file__", None)
    return hash_of([("policy", Path(file))]) if file and Path(file).is_file() else None


@cache
def _told(package: str) -> dict[str, Any] | None:
    """Version and hash of a package that was imported; None if it has no file."""
    file = getattr(sys.modules.get(package), "__file__", None)
    if not file:
        return None
    place = Path(file).parent if Path(file).name == "__init__.py" else Path(file)
    return {"version": _version(package), "sources_sha256": package_sha256(place)}


def _version(package: str) -> str | None:
    """Version of the distribution that offers parts of `package`."""
    for offer in all_offers():
        if offer.place.partition(":")[0].partition(".")[0] == package:
            return offer.version
    return None
