import pytest

from surgsim.studies.tables import read_csv


def _value(text):
    """A cell as a number if it is one, as None if it is empty."""
    try:
        return float(text) if text else None
    except ValueError:
        return text


@pytest.fixture(scope="session")
def read_numbers():
    """Reads the rows of a study's CSV file, with numbers as numbers."""

    def read(path):
        return read_csv(path, _value)

    return read
