"""Smallest differences that matter, as the command line says them: `rcm_error_rms_mm=0.5`."""

import math
from collections.abc import Sequence

from surgsim.compare.observations import metric_named
from surgsim.errors import SurgsimError


def parse_matters(texts: Sequence[str]) -> dict[str, float]:
    """Smallest differences by metric, from `METRIC=VALUE` texts.

    Raises:
        SurgsimError: If a text is not of that form, the metric is unknown, or the value is negative.
    """
    found: dict[str, float] = {}
    for text in texts:
        name, sign, value = text.partition("=")
        try:
            number = float(value) if sign else math.nan
        except ValueError:
            number = math.nan
        if not (math.isfinite(number) and number >= 0.0):
            raise SurgsimError(f"--matters: '{text[:60]}' is not METRIC=VALUE with a value of 0 or more")
        found[metric_named(name.strip()).name] = number
    return found
