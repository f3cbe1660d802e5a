"""A tiny protocol, frozen, and the score of a controller."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tiny_protocol import Here, wish, write_protocol

from surgsim.protocol.definition import Protocol
from surgsim.protocol.freeze import freeze
from surgsim.protocol.runs import Store
from surgsim.protocol.score import Means, Score, score


@pytest.fixture
def tiny(tmp_path: Path) -> Protocol:
    """The tiny protocol, frozen, in a folder of its own."""
    protocol = write_protocol(tmp_path)
    freeze(protocol)
    return protocol


@pytest.fixture(scope="session")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Protocol, Score, Store]:
    """A frozen tiny protocol, the score of a controller, and the store of its runs."""
    folder = tmp_path_factory.mktemp("whole")
    protocol = write_protocol(folder)
    freeze(protocol)
    store = Store(folder=folder / "store")
    made = score(wish(protocol), Means(store=store, runner=Here()))
    assert made is not None
    return protocol, made, store


@pytest.fixture
def scored(whole: tuple[Protocol, Score, Store]) -> Callable[..., Score]:
    """Scores with the store of `whole`."""

    def make(*given: Any, **changes: Any) -> Score:
        made = score(wish(whole[0], *given, **changes), Means(store=whole[2], runner=Here()))
        assert made is not None
        return made

    return make
