import pytest

from surgsim.studies.study import read_csv


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
        return [{name: _value(text) for name, text in row.items()} for row in read_csv(path)]

    return read
