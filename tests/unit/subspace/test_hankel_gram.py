import numpy as np
import pytest
from hankel_matrices import stack_rows
from hypothesis import given, settings
from hypothesis import strategies as st

from ankleloop.errors import DataError
from ankleloop.subspace.hankel import HankelGram, block_hankel, generate_columns


def multiply_rows(x, rows):
    """H Hᵀ of the Hankel matrix itself, each row less its mean."""
    H = stack_rows(x, rows)
    return H @ H.T


def accumulate(x, rows, chunks, lags=None):
    gram = HankelGram(rows, lags)
    for chunk in chunks:
        gram.add(chunk)
    return gram


@settings(deadline=None, max_examples=60)
@given(
    samples=st.integers(12, 700),
    channels=st.integers(1, 5),
    rows=st.integers(1, 12),
    cuts=st.lists(st.integers(0, 700), max_size=6),
    seed=st.integers(0, 2**32 - 1),
)
def test_the_gram_matrix_does_not_depend_on_the_chunks(samples, channels, rows, cuts, seed):
    x = np.random.default_rng(seed).standard_normal((samples, channels)).cumsum(axis=0) + 3.0
    gram = accumulate(x, rows, np.split(x, sorted(min(cut, samples) for cut in cuts)))
    expected = multiply_rows(x, rows)
    assert gram.columns == samples - rows + 1
    scale = np.abs(x).max() ** 2 * samples
    np.testing.assert_allclose(gram.matrix(), expected, atol=1e-12 * scale)


def test_products_beyond_the_lags_are_nan():
    x = np.random.default_rng(0).standard_normal((200, 3))
    rows, lags = 6, np.array([6, 2, 3])
    gram, expected = accumulate(x, rows, [x], lags).matrix(), multiply_rows(x, rows)
    for i in range(rows * 3):
        for j in range(rows * 3):
            (first, channel), later = divmod(min(i, j), 3), max(i, j) // 3
            within = later - first < lags[channel] if i // 3 != j // 3 else True
            assert np.isnan(gram[i, j]) != within
            if within:
                assert gram[i, j] == pytest.approx(expected[i, j], abs=1e-10)


def test_means_may_stay():
    x = np.random.default_rng(0).standard_normal((60, 2)) + 5.0
    gram = HankelGram(3, subtract_means=False)
    gram.add(x)
    H = block_hankel(x, 0, 3, 58)
    np.testing.assert_allclose(gram.matrix(), H @ H.T, rtol=1e-12)


@pytest.mark.parametrize("size", [3, 50, 5000])
def test_columns_do_not_depend_on_the_chunks(size):
    x = np.random.default_rng(2).standard_normal((3000, 2))
    columns = np.concatenate(list(generate_columns((x[k : k + size] for k in range(0, 3000, size)), 7, np.arange(14))))
    np.testing.assert_array_equal(columns, block_hankel(x, 0, 7, 2994).T)


def test_a_record_without_a_single_column_is_refused():
    with pytest.raises(DataError, match="shorter than the 5 samples of one Hankel column"):
        accumulate(np.ones((4, 1)), 5, [np.ones((2, 1)), np.ones((2, 1))]).matrix()


def test_long_sums_do_not_lose_digits():
    """A constant beside a small signal: sums of sums keep what one long sum rounds away."""
    x = np.random.default_rng(1).standard_normal((200_000, 1)) * 1e-3 + 1.0
    exact = multiply_rows(x.astype(np.longdouble) - 1.0, 3)
    np.testing.assert_allclose(accumulate(x, 3, [x]).matrix(), exact.astype(float), atol=1e-8 * exact[0, 0])
