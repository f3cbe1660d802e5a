"""Tables fit the terminal, whatever is in them, and no number and no word is broken."""

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from surgsim.cli.table import fit_prose, fit_table

NAMES = st.text("abcd_/", min_size=1, max_size=30)
NUMBERS = st.floats(0.001, 9999.0).map(lambda x: f"{x:.4g}")
PROSE = st.lists(st.text("wxyz", min_size=1, max_size=12), min_size=1, max_size=12).map(" ".join)
ROWS = st.lists(st.tuples(NAMES, NUMBERS, NUMBERS, PROSE), min_size=1, max_size=6)
HEADER = ("run", "tip error [mm]", "rank", "meaning")


@given(rows=ROWS, width=st.integers(34, 130))
def test_every_word_of_a_table_is_there_whole_and_no_line_is_too_wide(rows, width):
    headings, body = fit_table(HEADER, rows, (1, 2), width)
    assert all(len(line) <= width for line in (*headings, *body)), body
    words = Counter(word for line in body for word in line.split())
    wanted = Counter(word for row in rows for cell in row for word in cell.split())
    assert wanted <= words
    added = words - wanted
    assert not headings or not added, "a row holds its cells and nothing else"


@pytest.mark.parametrize("width", [1, 0, -7])
def test_without_room_every_word_has_a_line_of_its_own(width):
    assert fit_prose("no room at all", width) == ["no", "room", "at", "all"]


ROW = ("circle_lwr4plus/pinv/base-seed0", "0.0449", "1.50", "the tip left its path by more than allowed")


def test_a_line_a_row_where_that_fits():
    assert fit_table(HEADER, [ROW], (1, 2), 80) == (
        ["run                              tip error [mm]  rank  meaning"],
        [
            "circle_lwr4plus/pinv/base-seed0          0.0449  1.50  the tip left its path by",
            "                                                       more than allowed",
        ],
    )


def test_the_first_column_above_the_others_where_it_is_too_wide():
    assert fit_table(HEADER, [ROW], (1, 2), 50) == (
        ["run", "  tip error [mm]  rank  meaning"],
        [
            "circle_lwr4plus/pinv/base-seed0",
            "          0.0449  1.50  the tip left its path by",
            "                        more than allowed",
        ],
    )


def test_a_line_a_cell_where_nothing_else_fits():
    assert fit_table(HEADER, [ROW], (1, 2), 34) == (
        [],
        [
            "circle_lwr4plus/pinv/base-seed0",
            "  tip error [mm]: 0.0449",
            "  rank: 1.50",
            "  meaning: the tip left its path",
            "  by more than allowed",
        ],
    )


@pytest.mark.parametrize("width", [1, 10, 40, 200])
def test_a_sentence_is_broken_between_words_alone(width):
    text = "wrote /some/long-path/of a person/run-1.parquet, 11001 rows"
    lines = fit_prose(text, width)
    assert " ".join(lines) == text
    assert all(len(line) <= width or " " not in line for line in lines)
