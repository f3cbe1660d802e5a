"""JSON of strangers: read strictly, so that a file says one thing to every reader."""

import json
import math
from typing import Any, NoReturn

from surgsim.errors import SurgsimError


def strict_json(content: bytes, name: str) -> Any:
    """The value of a JSON text in UTF-8.

    Args:
        content: The text.
        name: What messages call it.

    Raises:
        SurgsimError: If it is no JSON, or holds a key twice in one object, or a number that is not finite.
    """
    try:
        return json.loads(
            content.decode("utf-8"),
            object_pairs_hook=_once,
            parse_constant=_refuse,
            parse_float=_finite,
        )
    except (ValueError, RecursionError) as error:
        told = "it is nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise SurgsimError(f"{name}: no strict JSON: {told[:200]}") from error


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"the key '{twice[:60]}' is there twice")
    return found


def _refuse(word: str) -> NoReturn:
    raise ValueError(f"{word} is no number")


def _finite(text: str) -> float:
    if not math.isfinite(value := float(text)):
        raise ValueError(f"{text[:60]} is too large")
    return value
