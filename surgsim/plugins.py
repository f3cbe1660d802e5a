"""What other packages offer: their entry points in the groups `surgsim.*`."""

import multiprocessing
import sys
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import entry_points

from surgsim.errors import unknown_name

GROUPS = (
    "surgsim.resolvers",
    "surgsim.torque_laws",
    "surgsim.port_estimators",
    "surgsim.instrument_estimators",
    "surgsim.tasks",
    "surgsim.disturbances",
    "surgsim.props",
    "surgsim.plants",
    "surgsim.bilateral",
    "surgsim.policies",
    "surgsim.robots",
    "surgsim.instruments",
    "surgsim.metrics",
)
"""The entry-point groups that surgsim reads."""
_OURS = "surgsim."


@dataclass(frozen=True, kw_only=True)
class Offer:
    """An entry point of another package.

    Attributes:
        group: The entry-point group.
        name: What a scenario calls the part.
        place: `module:attribute`.
        package: Name of the distribution that brings it.
        version: Of the distribution.
    """

    group: str
    name: str
    place: str
    package: str
    version: str

    @property
    def origin(self) -> str:
        """Who brings it, for messages."""
        return f"of the package {self.package} {self.version}"


@lru_cache(maxsize=1)
def all_offers() -> tuple[Offer, ...]:
    """Every entry point in a group that begins with `surgsim.`, by package and name; found once a process."""
    every = entry_points()
    groups = [group for group in every.groups if group.startswith(_OURS)]
    found = [
        Offer(
            group=point.group,
            name=point.name,
            place=point.value,
            package=point.dist.name if point.dist else "unknown",
            version=point.dist.version if point.dist else "unknown",
        )
        for group in groups
        for point in every.select(group=group)
    ]
    return tuple(sorted(found, key=lambda offer: (offer.package, offer.group, offer.name)))


def offers(group: str) -> dict[str, Offer]:
    """Name to the offer of `group`; of two packages that give one name, the first by name counts.

    The first call of a process says on standard error which groups do not exist, and which names are taken.
    """
    _say_once()
    found: dict[str, Offer] = {}
    for offer in all_offers():
        if offer.group == group:
            found.setdefault(offer.name, offer)
    return found


def misplaced() -> list[tuple[Offer, str]]:
    """Offers that nobody reads, each with the reason: no such group, or a name that is taken."""
    found: list[tuple[Offer, str]] = []
    first: dict[tuple[str, str], Offer] = {}
    for offer in all_offers():
        if offer.group not in GROUPS:
            found.append((offer, unknown_name(offer.group, "group of entry points", GROUPS)))
            continue
        before = first.setdefault((offer.group, offer.name), offer)
        if before is not offer:
            found.append((offer, f"the name is taken by the part {before.origin}"))
    return found


@lru_cache(maxsize=1)
def _say_once() -> None:
    if multiprocessing.parent_process() is not None:  # workers need not say it again
        return
    for offer, reason in misplaced():
        text = f"surgsim: '{offer.name}' in the group {offer.group} {offer.origin} is not used: {reason}"
        print(text, file=sys.stderr)
