"""What is found where a bundle is not what it says, or not what is here."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Finding:
    """A difference.

    Attributes:
        where: What it is about: `cell ID`, `file NAME`, `protocol`, `track`, `seeds`, `controller`, ...
        what: What of it differs, e.g. the metric's name.
        bundle: What the bundle has.
        here: What it should have, or what is found here.
    """

    where: str
    what: str
    bundle: str
    here: str

    @property
    def line(self) -> str:
        """For a person: `cell random/ARM/base/3: seed: 4 in the bundle, 3 here`."""
        return f"{self.where}: {self.what}: {self.bundle} in the bundle, {self.here} here"


def short(sha256: str | None) -> str:
    """The beginning of a hash."""
    return sha256[:12] if sha256 else "none"


def differences(where: str, bundle: Mapping[str, Any], here: Mapping[str, Any]) -> list[Finding]:
    """A finding for each key whose values differ, or that one lacks; of mappings for each of their keys."""
    found = []
    for name in sorted(bundle.keys() | here.keys()):
        there, mine = bundle.get(name), here.get(name)
        if isinstance(there, Mapping) and isinstance(mine, Mapping):
            inside = differences(where, there, mine)
            found += [replace(each, what=f"{name}.{each.what}") for each in inside]
        elif there != mine or (name in bundle) != (name in here):
            found.append(Finding(where=where, what=name, bundle=_told(there), here=_told(mine)))
    return found


def _told(value: Any) -> str:
    """A value on one line, a hash and a long one cut."""
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_told(each)}" for key, each in value.items()) or "nothing"
    if value is None:
        return "none"
    text = repr(value) if isinstance(value, float) else " ".join(str(value).split())
    return short(text) if len(text) == 64 else text[:80]
