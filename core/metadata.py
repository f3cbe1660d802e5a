"""What the small installation says of itself: what ../pyproject.toml says, with fewer dependencies."""

import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

SHARED = ("description", "requires-python", "license", "classifiers", "scripts")


class Smaller(MetadataHookInterface):
    """Fills the fields that pyproject.toml calls dynamic."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Add the fields.

        Raises:
            ValueError: If what is left out is no dependency.
        """
        file = Path(self.root).parent / "pyproject.toml"
        whole = tomllib.loads(file.read_text(encoding="utf-8"))["project"]
        metadata.update({field: whole[field] for field in SHARED})
        metadata["dependencies"] = fewer(
            whole["dependencies"], self.config["left-out"], self.config["instead"]
        )
        extras = whole["optional-dependencies"]
        metadata["optional-dependencies"] = {name: extras[name] for name in self.config["extras"]}


def fewer(dependencies: Sequence[str], left_out: Sequence[str], instead: Mapping[str, str]) -> list[str]:
    """`dependencies` without those that are left out, some by another name.

    Raises:
        ValueError: If one that is named is none of them.
    """
    named = {re.split(r"[^\w.-]", text, maxsplit=1)[0]: text for text in dependencies}
    if strange := {*left_out, *instead} - named.keys():
        raise ValueError(f"{', '.join(sorted(strange))}: no dependency of ../pyproject.toml")
    kept = {name: text for name, text in named.items() if name not in left_out}
    return [instead.get(name, name) + text.removeprefix(name) for name, text in kept.items()]
