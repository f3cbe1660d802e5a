"""Smallest differences that matter: which are allowed, and how the command line says them."""

import math
from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Any

from surgsim.compare.observations import metric_named
from surgsim.errors import SurgsimError


def checked_matters(matters: Mapping[str, Any]) -> dict[str, float]:
    """Smallest differences by metric, each a finite number of 0 or more in the metric's unit.

    Raises:
        SurgsimError: If a metric is unknown, or a value is no such number.
    """
    if not isinstance(matters, Mapping):
        raise SurgsimError(f"--matters: a {type(matters).__name__} is no mapping of metrics to numbers")
    found: dict[str, float] = {}
    for name, value in matters.items():
        known = metric_named(str(name)).name
        number = isinstance(value, Real) and not isinstance(value, bool)
        if not (number and math.isfinite(value) and value >= 0.0):
            raise _refusal(f"{name}={value:g}" if number else f"{name}={value}")
        found[known] = float(value)
    return found


def parse_matters(texts: Sequence[str]) -> dict[str, float]:
    """Smallest differences by metric, from `METRIC=VALUE` texts.

    Raises:
        SurgsimError: If a text is not of that form, the metric is unknown, or the value is not allowed.
    """
    found: dict[str, Any] = {}
    for text in texts:
        name, sign, value = text.partition("=")
        if not sign:
            raise _refusal(text)
        found[name.strip()] = _number(value)
    return checked_matters(found)


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def _refusal(text: str) -> SurgsimError:
    return SurgsimError(f"--matters: '{text[:60]}' is not METRIC=VALUE with a value of 0 or more")
