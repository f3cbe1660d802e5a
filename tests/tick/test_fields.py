"""A record's fields as views: what one writes the other reads."""

import numpy as np
import pytest

from surgsim.tick.arrays import Control, Seen, new
from surgsim.tick.fields import fields_of

MADE = {
    "alone": lambda: new(Seen, 7),
    "within another": lambda: new(Control, 7).referred,
    "a copy": lambda: new(Seen, 7).copy(),
}


@pytest.mark.parametrize("made", MADE.values(), ids=MADE)
def test_fields_are_views_of_the_record(made):
    record = made()
    fields = fields_of(record)
    for k, field in enumerate(fields.values()):
        field[...] = k + 1
    for k, name in enumerate(fields):
        np.testing.assert_array_equal(record[name], k + 1)
    record["t_s"], record["J_rcm"] = 0.5, 3.0
    assert fields["t_s"].tolist() == [0.5]
    np.testing.assert_array_equal(fields["J_rcm"], np.full((2, 7), 3.0))


def test_numbers_have_one_entry_and_records_are_left_out():
    fields = fields_of(new(Seen, 6))
    assert fields["first"].shape == (1,)
    assert fields["q"].shape == (6,)
    assert fields["Jv_WT"].shape == (3, 6)
    assert {*fields, "elsewhere"} == set(new(Seen, 6).dtype.names)
