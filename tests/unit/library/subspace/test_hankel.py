import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ankleloop.subspace.hankel import block_hankel, generate_columns, hankel_gram


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
    places = first + np.add.outer(np.arange(rows), np.arange(columns))
    expected = x[places].transpose(0, 2, 1).reshape(rows * channels, columns)
    np.testing.assert_array_equal(block_hankel(x, first, rows, columns), expected)


def multiply_rows(x, rows):
    """H Hᵀ of the Hankel matrix itself, each row less its mean."""
    H = block_hankel(x, 0, rows, len(x) - rows + 1)
    H = H - H.mean(axis=1, keepdims=True)
    return H @ H.T


@settings(deadline=None, max_examples=60)
@given(
    samples=st.integers(12, 700),
    channels=st.integers(1, 5),
    rows=st.integers(1, 12),
    seed=st.integers(0, 2**32 - 1),
)
def test_the_gram_matrix_is_that_of_the_hankel_matrix(samples, channels, rows, seed):
    x = np.random.default_rng(seed).standard_normal((samples, channels)).cumsum(axis=0) + 3.0
    gram = hankel_gram(x, rows)
    scale = np.abs(x).max() ** 2 * samples
    np.testing.assert_allclose(gram, multiply_rows(x, rows), atol=1e-12 * scale)


@pytest.mark.parametrize("samples", [7, 50, 3000])
def test_columns_come_some_at_a_time(samples):
    x = np.random.default_rng(2).standard_normal((samples, 2))
    columns = np.concatenate(list(generate_columns(x, 7)), axis=1)
    np.testing.assert_array_equal(columns, block_hankel(x, 0, 7, samples - 6))


def test_a_record_shorter_than_the_window_has_no_column():
    x = np.ones((6, 2))
    assert list(generate_columns(x, 7)) == []
    np.testing.assert_array_equal(hankel_gram(x, 7), np.zeros((14, 14)))


def test_long_sums_do_not_lose_digits():
    """A constant beside a small signal: sums of sums keep what one long sum rounds away."""
    x = np.random.default_rng(1).standard_normal((200_000, 1)) * 1e-3 + 1.0
    exact = multiply_rows(x.astype(np.longdouble) - 1.0, 3)
    np.testing.assert_allclose(hankel_gram(x, 3), exact.astype(float), atol=1e-8 * exact[0, 0])


def test_a_constant_adds_no_direction_once_means_are_removed():
    assert np.abs(hankel_gram(np.full((60, 1), 3.0), 5)).max() < 1e-12
