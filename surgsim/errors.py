"""Errors that are the user's to mend, and how a run can end.

The command line catches `SurgsimError` alone and prints it on one line; anything else is a bug and
keeps its traceback.
"""

import difflib
import enum
from collections.abc import Iterable

_ROOM = 800
"""Characters of a list of names that a person still reads."""


class SurgsimError(Exception):
    """Something that the user can mend: bad input, a file that is damaged, a path out of reach.

    Example:
        >>> import surgsim
        >>> try:
        ...     surgsim.load("circle_lwr4plus", seed=-1)
        ... except surgsim.SurgsimError as error:
        ...     print(error)
        --seed: -1 is not allowed: must be 0 or more
    """


class ScenarioError(SurgsimError):
    """A scenario that cannot be run as written.

    Attributes:
        where: `file:line: key.path` or as much of it as is known.
        reason: What is wrong, with the value and what is allowed.
    """

    def __init__(self, where: str, reason: str) -> None:
        self.where = where
        self.reason = reason
        super().__init__(f"{where}: {reason}" if where else reason)


class UnreachableError(SurgsimError):
    """A start or path that the instrument cannot reach through the trocar."""


class RecordingError(SurgsimError):
    """A recording or run folder that is missing, damaged or not surgsim's."""


class UnknownNameError(SurgsimError, KeyError):
    """A column, metric or run that is asked for by a name that nothing has; a `KeyError` too."""

    def __str__(self) -> str:
        """The sentence as it is: a KeyError would put it in quotes."""
        return str(self.args[0])


def not_held(name: object, kind: str, known: Iterable[str], see: str) -> UnknownNameError:
    """An error that says that `name` is not a `kind`, with the names most like it; `see` lists them all."""
    shown = str(name)[:60]
    near = difflib.get_close_matches(shown, list(known), n=3)
    hint = f"Did you mean {' or '.join(map(repr, near))}?" if near else f"See {see}."
    return UnknownNameError(f"'{shown}' is not a {kind}. {hint}")


def unknown_name(name: str, kind: str, known: Iterable[str]) -> str:
    """Say that `name` is not a `kind`, list what is, and suggest the nearest match."""
    names = sorted(known)
    shown = name if len(name) <= 60 else f"{name[:57]}..."
    article = "an" if kind[0] in "aeiou" else "a"
    text = f"'{shown}' is not {article} {kind}. Known: {_listed(names) or 'none'}."
    near = difflib.get_close_matches(shown, names, n=1)
    return f"{text} Did you mean '{near[0]}'?" if near else text


def _listed(names: list[str]) -> str:
    """The names in one line, and how many more there are where a line has no room for them."""
    text = ", ".join(names)
    if len(text) <= _ROOM:
        return text
    head = text[:_ROOM].rpartition(", ")[0]
    return f"{head} and {len(names) - head.count(',') - 1} more"


def told(error: BaseException) -> str:
    """What went wrong in a part, on one line."""
    text = " ".join(str(error).split())
    return text if isinstance(error, ImportError | AttributeError) else f"{type(error).__name__}: {text}"


class Outcome(enum.Enum):
    """How a run ended. The value is the sentence that a person reads."""

    COMPLETED = "The task ran to its end."
    TIME_LIMIT = "The task was not done when its time limit passed."
    DIVERGED = "The simulation diverged: a state or torque is not finite."
    JOINT_LIMIT = "A joint left its position range."
    VELOCITY_LIMIT = "A joint moved faster than its velocity limit."
    RCM_LIMIT = "The shaft moved further from the trocar than the incision allows."
    TIP_LIMIT = "The tip left its path by more than the stated limit."
    SELF_COLLISION = "The arm or its instrument touched the arm."
    ARM_COLLISION = "An arm or its instrument touched another arm."
    PATIENT_COLLISION = "The arm or its instrument touched the patient or the table."
    INCISION_TORN = "The shaft pressed on the abdominal wall harder than the incision bears."
    FORCE_LIMIT = "A force on trocar or tip passed its limit."
    TORQUE_RATE_LIMIT = "The commanded torque changed faster than the arm's interface takes."
    ACCELERATION_DISCONTINUITY = (
        "The commanded joint motion had more acceleration or jerk than the arm's interface takes."
    )
    COMMUNICATION_CONSTRAINTS_VIOLATION = "Too many commands in a row did not reach the arm."
    INFEASIBLE = "The controller found no command that meets its hard constraints."
    EXTERNAL_FAILED = "The external controller ended, did not answer, or gave what is no answer."
