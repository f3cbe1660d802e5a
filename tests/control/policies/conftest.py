"""What the tests of policies share."""

import pytest

from surgsim.control.policies import registry
from surgsim.control.policies.registry import register_policy


@pytest.fixture
def register(monkeypatch):
    """`register_policy`, undone after the test."""
    monkeypatch.setattr(registry, "_registered", {})
    return register_policy
