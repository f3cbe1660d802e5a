"""What is packed comes back bit for bit, whatever the bits are, in little room where they are smooth."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from surgsim.recording.encoding import decode, encode
from surgsim.trace.trace import Trace

SHAPES = array_shapes(min_dims=2, max_dims=2, min_side=1, max_side=40)
PATTERNS = {
    "zeros of both signs": [0x0000000000000000, 0x8000000000000000],
    "infinities": [0x7FF0000000000000, 0xFFF0000000000000],
    "quiet NaNs with payloads": [0x7FF8000000000001, 0xFFF8DEADBEEF0001, 0x7FFFFFFFFFFFFFFF],
    "signalling NaNs": [0x7FF0000000000001, 0xFFF4000000000000],
    "subnormal numbers": [0x0000000000000001, 0x800FFFFFFFFFFFFF],
    "largest and smallest": [0x7FEFFFFFFFFFFFFF, 0xFFEFFFFFFFFFFFFF, 0x0010000000000000],
    "all bits set": [0xFFFFFFFFFFFFFFFF],
}


def survives(patterns: np.ndarray) -> bool:
    """Whether bit patterns (rows, columns) come back as they are."""
    data = np.ascontiguousarray(patterns, dtype=np.uint64).view(np.float64)
    back = decode(encode(data), *data.shape)
    return back.shape == data.shape and np.array_equal(back.view(np.uint64), data.view(np.uint64))


@given(arrays(np.uint64, SHAPES, elements=st.integers(0, 2**64 - 1)))
@settings(max_examples=300, deadline=None)
def test_any_bits_come_back(patterns: np.ndarray) -> None:
    assert survives(patterns)


@given(arrays(np.float64, SHAPES, elements=st.floats(allow_nan=True, allow_subnormal=True)))
@settings(max_examples=300, deadline=None)
def test_any_floats_come_back(data: np.ndarray) -> None:
    assert survives(data.view(np.uint64))


@pytest.mark.parametrize("patterns", PATTERNS.values(), ids=PATTERNS)
def test_special_patterns_come_back(patterns: list[int]) -> None:
    """Between smooth numbers, so that every order of difference is chosen over them."""
    smooth = np.linspace(0.5, 0.6, 600).view(np.uint64)
    columns = [smooth, smooth**2, np.resize(np.array(patterns, dtype=np.uint64), smooth.size)]
    for pattern in patterns:
        columns.append(smooth.copy())
        columns[-1][[0, 5, 300, -1]] = pattern
    assert survives(np.stack(columns, axis=1))


@pytest.mark.parametrize("rows", [1, 2, 4, 5, 2047, 2048, 2049, 5000])
def test_smooth_and_noisy_columns_of_any_length(rows: int) -> None:
    t = 1e-3 * np.arange(rows)
    noise = np.random.default_rng(rows).normal(size=rows)
    powers = [t**k for k in range(6)]
    assert survives(np.stack([*powers, np.sin(t), noise, noise.cumsum()], axis=1).view(np.uint64))


def test_a_view_of_other_strides_is_packed_as_its_copy() -> None:
    data = np.random.default_rng(0).normal(size=(60, 8))[::2, ::-1]
    assert encode(data) == encode(data.copy())


def test_a_smooth_signal_takes_a_fraction_of_its_size() -> None:
    t = 1e-3 * np.arange(20_000)
    data = np.stack([np.sin(t + k) for k in range(10)], axis=1)
    assert len(encode(data)) < 0.3 * data.nbytes
    assert len(encode(np.zeros((20_000, 10)))) < 0.001 * data.nbytes


def test_noise_is_hardly_larger_than_it_is() -> None:
    data = np.random.default_rng(0).integers(0, 2**64, (5000, 10), dtype=np.uint64).view(np.float64)
    assert len(encode(data)) < 1.001 * data.nbytes + 100


def test_each_column_has_the_order_that_suits_it() -> None:
    noise = np.random.default_rng(0).integers(0, 2**64, 5000, dtype=np.uint64).view(np.float64)
    smooth = 1.0 + 1e-4 * np.sin(1e-2 * np.arange(5000))
    assert list(encode(np.stack([noise, smooth], axis=1))[:2]) == [0, 4]


def test_a_run_comes_back(trace: Trace) -> None:
    assert survives(trace.data.view(np.uint64))


@pytest.mark.parametrize(("rows", "columns"), [(99, 3), (101, 3), (10**9, 3), (10**18, 3), (150, 2)])
def test_another_size_is_refused(rows: int, columns: int) -> None:
    packed = encode(np.random.default_rng(0).normal(size=(100, 3)))
    with pytest.raises(ValueError, match=r"^damaged recording: "):
        decode(packed, rows, columns)


@pytest.mark.parametrize("packed", [b"", b"\0\0", b"\0\0\0", b"\5\0\0" + bytes(50), b"\0\0\0" + bytes(50)])
def test_what_is_not_packed_is_refused(packed: bytes) -> None:
    with pytest.raises(ValueError, match=r"^damaged recording: "):
        decode(packed, 10, 3)
