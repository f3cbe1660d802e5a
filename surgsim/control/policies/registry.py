"""Policies by name: shipped, from entry points of other packages, or registered in this process."""

import importlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar

from numpy.typing import ArrayLike

from surgsim.array import Array
from surgsim.errors import SurgsimError, told, unknown_name
from surgsim.plugins import offers

GROUP = "surgsim.policies"
Policy = Callable[[Mapping[str, Array]], ArrayLike]
"""An observation, see `observe`, to an action. A `reset` method, if it has one, is called before a run."""

_SHIPPED = {
    "damping": "surgsim.control.policies.shipped:damping",
    "proportional": "surgsim.control.policies.shipped:proportional",
}
_registered: dict[str, Policy] = {}
_offered: ContextVar[tuple[tuple[str, Policy], ...]] = ContextVar("offered", default=())


def policy_names() -> list[str]:
    """Names of all policies, sorted."""
    return sorted({**_places(), **_registered, **dict(_offered.get())})


def register_policy(name: str, policy: Policy) -> None:
    """Let scenarios of this process name `policy`; registering again replaces it.

    Worker processes do not know it: for `compare`, give it an entry point of the group `surgsim.policies`.

    Raises:
        SurgsimError: If an installed policy has this name, or it cannot be called.
    """
    if name in _places():
        raise SurgsimError(f"policy '{name}' is installed already: choose another name")
    if not callable(policy):
        raise SurgsimError(f"policy '{name}' cannot be called: it is {policy!r}")
    _registered[name] = policy


@contextmanager
def offering(name: str, policy: Policy) -> Iterator[None]:
    """Within the block, controllers that are built find `policy` under `name`."""
    token = _offered.set((*_offered.get(), (name, policy)))
    try:
        yield
    finally:
        _offered.reset(token)


def find_policy(name: str) -> Policy:
    """The policy `name`.

    Raises:
        SurgsimError: If there is none, or it does not load.
    """
    known = {**_registered, **dict(_offered.get())}
    if name in known:
        return known[name]
    places = _places()
    if name not in places:
        raise SurgsimError(
            f"{unknown_name(name, 'policy', [*places, *known])} A policy that was registered in one process "
            f"is not known to another: give it an entry point of the group '{GROUP}'."
        )
    module, _, attribute = places[name].partition(":")
    try:
        policy = getattr(importlib.import_module(module), attribute)
    except Exception as error:
        if name in _SHIPPED:
            raise  # a bug of ours
        raise SurgsimError(f"{_called(name)} does not load: {told(error)}") from error
    if not callable(policy):
        raise SurgsimError(f"{_called(name)} ({places[name]}) cannot be called")
    return policy  # type: ignore[no-any-return]


def policy_summary(name: str) -> str:
    """First line of the policy's docstring, or why it does not load."""
    try:
        return (find_policy(name).__doc__ or "").strip().split("\n")[0]
    except SurgsimError as error:
        return str(error)


def _places() -> dict[str, str]:
    return {**{name: offer.place for name, offer in offers(GROUP).items()}, **_SHIPPED}


def _called(name: str) -> str:
    """What messages call the policy `name`, with the package that brings it."""
    return f"policy '{name}' {offers(GROUP)[name].origin}" if name in offers(GROUP) else f"policy '{name}'"
