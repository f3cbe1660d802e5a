"""What is wrong with an arm's file, and which key of `robot` says it otherwise."""

from collections.abc import Iterable

from surgsim.errors import SurgsimError


class AdoptionError(SurgsimError):
    """An arm that cannot be used as its file or the keys of `robot` have it.

    Attributes:
        at: Keys inside of `robot` that it is about; empty: the file itself.
    """

    def __init__(self, reason: str, *at: str | int) -> None:
        self.at = at
        super().__init__(reason)


def listed(names: Iterable[str], most: int = 12) -> str:
    """Names for a message, the first `most` of them; `none` where there are none."""
    every = [name for name in names if name]
    more = f" and {len(every) - most} more" if len(every) > most else ""
    return ", ".join(f"'{name}'" for name in every[:most]) + more if every else "none"
