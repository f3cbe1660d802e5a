"""The checks of each kind, and running them over the parts of an installed package."""

from collections.abc import Callable, Iterator
from typing import Any

from surgsim.catalog import Catalog
from surgsim.contract import (
    bilateral,
    configs,
    instrument_estimators,
    instruments,
    metrics,
    plant_parts,
    policies,
    port_estimators,
    resolvers,
    robots,
    tasks,
    torque_laws,
)
from surgsim.contract.check import BrokenPromiseError, Check, Result
from surgsim.control.instrument_estimators import INSTRUMENT_ESTIMATORS
from surgsim.control.policies.registry import GROUP as POLICIES
from surgsim.control.policies.registry import find_policy
from surgsim.control.port_estimators import PORT_ESTIMATORS
from surgsim.control.resolvers import RESOLVERS
from surgsim.control.torque_laws import TORQUE_LAWS
from surgsim.errors import SurgsimError, told, unknown_name
from surgsim.metrics.catalog import SHIPPED
from surgsim.metrics.outside import GROUP as METRICS
from surgsim.metrics.outside import load_metric
from surgsim.models.folders import GROUP as ROBOTS
from surgsim.models.folders import robot_file, shipped_robots
from surgsim.models.instrument_files import GROUP as INSTRUMENTS
from surgsim.models.instrument_files import instrument_file, shipped_instruments
from surgsim.plant import PLANTS
from surgsim.plant.disturbances import DISTURBANCES
from surgsim.plant.props import PROPS
from surgsim.plugins import GROUPS, Offer, all_offers, misplaced
from surgsim.tasks import TASKS
from surgsim.teleop.bilateral import BILATERAL

CATALOGS = (
    RESOLVERS,
    TORQUE_LAWS,
    PORT_ESTIMATORS,
    INSTRUMENT_ESTIMATORS,
    TASKS,
    DISTURBANCES,
    PROPS,
    PLANTS,
    BILATERAL,
)
CHECKS: dict[str, tuple[Check, ...]] = {
    RESOLVERS.kind: resolvers.CHECKS,
    TORQUE_LAWS.kind: torque_laws.CHECKS,
    PORT_ESTIMATORS.kind: port_estimators.CHECKS,
    INSTRUMENT_ESTIMATORS.kind: instrument_estimators.CHECKS,
    TASKS.kind: tasks.CHECKS,
    DISTURBANCES.kind: plant_parts.DISTURBANCE_CHECKS,
    PROPS.kind: plant_parts.PROP_CHECKS,
    PLANTS.kind: plant_parts.PLANT_CHECKS,
    BILATERAL.kind: bilateral.CHECKS,
}
_BY_GROUP = {catalog.group: catalog for catalog in CATALOGS}
_OTHER_KINDS = {POLICIES: "policy", METRICS: "metric", ROBOTS: "robot", INSTRUMENTS: "instrument"}
_LOADS = "is found and loads"


def checks_of(catalog: Catalog) -> tuple[Check, ...]:
    """What the parts of a catalog promise."""
    return (*configs.CHECKS, *CHECKS[catalog.kind])


def check_package(name: str) -> list[Result]:
    """Every check of every part that the installed package `name` offers.

    Raises:
        SurgsimError: If no installed package of that name offers a part.
    """
    wanted = _plain(name)
    found = [offer for offer in all_offers() if _plain(offer.package) == wanted]
    if not found:
        known = {offer.package for offer in all_offers()}
        kind = "package installed here with an entry point in a group of surgsim"
        groups = ", ".join(GROUPS)
        raise SurgsimError(f"{unknown_name(name, kind, known)} Groups are {groups}.")
    unread = {id(offer): reason for offer, reason in misplaced()}
    return [result for offer in found for result in _of_offer(offer, unread.get(id(offer)))]


def _plain(name: str) -> str:
    """A distribution's name as packaging tools compare it."""
    return name.lower().replace("_", "-").replace(".", "-")


def _of_offer(offer: Offer, unread: str | None) -> Iterator[Result]:
    catalog = _BY_GROUP.get(offer.group)
    kind = catalog.kind if catalog else _OTHER_KINDS.get(offer.group, offer.group)
    if unread is not None:
        yield Result(kind=kind, part=offer.name, check=_LOADS, passed=False, detail=unread)
    elif offer.group == POLICIES:
        yield from _run(kind, offer.name, lambda: find_policy(offer.name), policies.CHECKS)
    elif offer.group == METRICS:
        yield from _run(kind, offer.name, lambda: load_metric(offer, SHIPPED), metrics.CHECKS)
    elif offer.group == INSTRUMENTS:
        yield from _run(kind, offer.name, lambda: _instrument(offer.name), instruments.CHECKS)
    elif catalog is None:
        yield from _run(kind, offer.name, lambda: _robot(offer.name), robots.CHECKS)
    elif offer.name in catalog.places:
        detail = f"the name is that of a shipped {kind}, which hides it"
        yield Result(kind=kind, part=offer.name, check=_LOADS, passed=False, detail=detail)
    else:
        yield from _run(kind, offer.name, lambda: catalog.loaded(offer.name), checks_of(catalog))


def _robot(name: str) -> str:
    """The name of a robot that this package brings.

    Raises:
        SurgsimError: If its folder is not found, or a shipped robot hides it.
    """
    if name in shipped_robots():
        raise SurgsimError("the name is that of a shipped robot, which hides it")
    robot_file(name)
    return name


def _instrument(name: str) -> str:
    """The name of an instrument that this package brings.

    Raises:
        SurgsimError: If its file is not found, or a shipped instrument hides it.
    """
    if name in shipped_instruments():
        raise SurgsimError("the name is that of a shipped instrument, which hides it")
    instrument_file(name)
    return name


def _run(kind: str, part: str, load: Callable[[], Any], checks: tuple[Check, ...]) -> Iterator[Result]:
    """The result of loading, and of every check if it does load."""
    try:
        loaded = load()
    except SurgsimError as error:
        yield Result(kind=kind, part=part, check=_LOADS, passed=False, detail=str(error))
        return
    yield Result(kind=kind, part=part, check=_LOADS, passed=True)
    for check in checks:
        detail = _broken(check, loaded)
        yield Result(kind=kind, part=part, check=check.name, passed=not detail, detail=detail)


def _broken(check: Check, loaded: Any) -> str:
    """What the part does against the promise; empty if nothing."""
    try:
        check.run(loaded)
    except BrokenPromiseError as error:
        return str(error)
    except Exception as error:  # whatever a foreign part raises is its answer
        return told(error) or type(error).__name__
    return ""
