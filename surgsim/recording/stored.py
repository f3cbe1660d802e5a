"""Whether the metrics stored with a run are those that its trace gives."""

import math
from collections.abc import Mapping

from surgsim.metrics.catalog import SHIPPED

_RELATIVE_TOLERANCE = 1e-9  # other versions of NumPy may sum in another order


def differences(stored: Mapping[str, float | None], recomputed: Mapping[str, float | None]) -> list[str]:
    """Say in words where the two differ; nothing when they agree.

    A metric of another package that is installed on one side alone is no difference, nor is one that came
    after the run and that its trace does not define.

    Args:
        stored: Metrics read from a file; None where one does not apply.
        recomputed: Metrics of the trace beside them.
    """
    found = []
    for name in sorted(recomputed):
        if name not in stored and (name not in SHIPPED or recomputed[name] is None):
            continue
        if name not in stored:
            found.append(f"{name}: not stored, the trace gives {_text(recomputed[name])}")
        elif not _same(stored[name], recomputed[name]):
            found.append(f"{name}: stored {_text(stored[name])}, the trace gives {_text(recomputed[name])}")
    return found


def _same(a: float | None, b: float | None) -> bool:
    if a is None or b is None:
        return a is b
    return math.isclose(a, b, rel_tol=_RELATIVE_TOLERANCE) or (math.isnan(a) and math.isnan(b))


def _text(value: float | None) -> str:
    return "none" if value is None else repr(float(value))
