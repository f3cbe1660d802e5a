"""Arms as other people write them, in files of their own."""

from pathlib import Path

import pytest
from foreign_arms import write_mjcf, write_urdf


@pytest.fixture
def mjcf(tmp_path: Path) -> Path:
    """An MJCF of 7 joints on a rail, with a head that pans and a hand."""
    return write_mjcf(tmp_path)


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    """A URDF of 6 joints inside of its package."""
    return write_urdf(tmp_path)
