"""What the config of every part promises."""

from pydantic import ValidationError

from surgsim.catalog import PartConfig
from surgsim.contract.check import Check, require

_SHORTEST, _LONGEST = 10, 110


def defaults(config: type[PartConfig]) -> None:
    """Every key has a default, and what is written as JSON reads back as the same."""
    part = config()
    again = config.model_validate_json(part.model_dump_json(), strict=True)
    require(again == part, f"the config reads back from JSON as {again}, not {part}")


def strict(config: type[PartConfig]) -> None:
    """Unknown keys are refused, and a config cannot be changed."""
    try:
        config(no_such_key=1)  # type: ignore[call-arg]
    except ValidationError:
        pass
    else:
        require(False, "an unknown key is accepted")
    part = config()
    try:
        part.type = "other"  # type: ignore[attr-defined]
    except ValidationError:
        return
    require(False, "a config can be changed after it was made")


def docstring(config: type[PartConfig]) -> None:
    """The config's own docstring begins with a short sentence: `surgsim list` shows it."""
    own = vars(config).get("__doc__")
    require(own, "the config has no docstring of its own")
    first = str(own).strip().split("\n")[0]
    require(
        _SHORTEST < len(first) < _LONGEST and first.endswith("."),
        f"the docstring's first line is no sentence of {_SHORTEST} to {_LONGEST} letters: {first!r}",
    )


CHECKS = (
    Check(name="every key has a default, and the config survives JSON", run=defaults),
    Check(name="the config is strict and frozen", run=strict),
    Check(name="the docstring begins with a short sentence", run=docstring),
)
