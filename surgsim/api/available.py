"""`surgsim.available`."""

from surgsim.cli.list import KINDS, items_of
from surgsim.errors import SurgsimError, unknown_name


def available(kind: str) -> dict[str, str]:
    """What a scenario or a call can name: names with a line about each.

    Args:
        kind: `scenarios`, `suites`, `controllers`, `robots`, `metrics` and others, as `surgsim list`.

    Raises:
        SurgsimError: If there is no such kind.

    Example:
        >>> import surgsim
        >>> surgsim.available("controllers")["pinv"]
        'pseudo-inverse redundancy resolution over hierarchical impedance'
    """
    if kind not in KINDS:
        raise SurgsimError(unknown_name(kind, "kind of thing to list", KINDS))
    return dict(items_of(kind))
