import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ankleloop.errors import DataError
from ankleloop.subspace import block_hankel

SIGNAL = np.arange(20.0)


def build_entry_by_entry(x, first, rows, columns):
    """Equation 15."""
    channels = x.shape[1]
    hankel = np.full((rows * channels, columns), np.nan)
    for a in range(rows):
        for b in range(columns):
            for channel in range(channels):
                hankel[a * channels + channel, b] = x[first + a + b, channel]
    return hankel


@settings(deadline=None, max_examples=200)
@given(
    first=st.integers(0, 6),
    rows=st.integers(1, 7),
    columns=st.integers(1, 9),
    channels=st.integers(1, 4),
    spare=st.integers(0, 3),
    seed=st.integers(0, 2**32 - 1),
)
def test_equation_15(first, rows, columns, channels, spare, seed):
    # With spare = 0, the last sample of the signal is the lower right corner.
    samples = first + rows + columns - 1 + spare
    x = np.random.default_rng(seed).standard_normal((samples, channels))
    np.testing.assert_array_equal(block_hankel(x, first, rows, columns), build_entry_by_entry(x, first, rows, columns))


def test_a_vector_is_one_channel():
    np.testing.assert_array_equal(block_hankel(SIGNAL, 3, 4, 5), build_entry_by_entry(SIGNAL[:, None], 3, 4, 5))


@pytest.mark.parametrize("kind", [list, lambda x: x.astype(int), lambda x: x.astype(np.float32)])
def test_array_kinds(kind):
    hankel = block_hankel(kind(SIGNAL), 0, 3, 4)
    assert hankel.dtype == np.float64
    np.testing.assert_array_equal(hankel, build_entry_by_entry(SIGNAL[:, None], 0, 3, 4))


@pytest.mark.parametrize(
    ("first", "rows", "columns"),
    [(0, 5, 17), (0, 17, 5), (5, 5, 12), (20, 1, 1), (-1, 2, 2), (0, 0, 4), (0, 4, 0), (0, -2, 4)],
)
def test_impossible_sizes_are_refused(first, rows, columns):
    message = (
        rf"a signal of 20 samples has no Hankel matrix of {rows} block rows and {columns} columns from sample {first}: "
        r"use a longer record or fewer block rows\."
    )
    with pytest.raises(DataError, match=message):
        block_hankel(SIGNAL, first, rows, columns)


@pytest.mark.parametrize(("first", "rows", "columns"), [(0, 5, 16), (5, 5, 11), (19, 1, 1)])
def test_the_largest_sizes_are_allowed(first, rows, columns):
    assert block_hankel(SIGNAL, first, rows, columns)[-1, -1] == SIGNAL[-1]
