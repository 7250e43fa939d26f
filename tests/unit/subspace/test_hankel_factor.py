from fractions import Fraction

import numpy as np
import pytest
from hankel_matrices import stack_rows
from hypothesis import given, settings
from hypothesis import strategies as st

from ankleloop.errors import DataError
from ankleloop.subspace import moesp, simulate_response
from ankleloop.subspace.hankel import block_hankel
from ankleloop.subspace.hankel_factor import (
    HankelFactor,
    _sum_products,
    combine_factors,
    factor_products,
    update_factor,
)


def accumulate(x, rows, chunks=None, lags=None, **options):
    factor = HankelFactor(rows, lags, **options)
    for chunk in [x] if chunks is None else chunks:
        factor.add(chunk)
    return factor


@settings(deadline=None, max_examples=60)
@given(
    samples=st.integers(30, 500),
    channels=st.integers(1, 4),
    rows=st.integers(1, 7),
    cuts=st.lists(st.integers(0, 500), max_size=5),
    seed=st.integers(0, 2**32 - 1),
)
def test_the_factor_has_the_inner_products_whatever_the_chunks(samples, channels, rows, cuts, seed):
    x = np.random.default_rng(seed).standard_normal((samples, channels)).cumsum(axis=0) + 3.0
    factor = accumulate(x, rows, np.split(x, sorted(min(cut, samples) for cut in cuts)))
    R, H = factor.matrix(), stack_rows(x, rows)
    np.testing.assert_array_equal(R, np.triu(R))
    np.testing.assert_allclose(R.T @ R, H @ H.T, atol=1e-12 * np.abs(x).max() ** 2 * samples)
    assert factor.columns == samples - rows + 1


def test_means_may_stay():
    x = np.random.default_rng(0).standard_normal((60, 2)) + 5.0
    R, H = accumulate(x, 3, subtract_means=False).matrix(), block_hankel(x, 0, 3, 58)
    np.testing.assert_allclose(R.T @ R, H @ H.T, rtol=1e-12)


def test_rows_in_any_order_and_repeated():
    x = np.random.default_rng(1).standard_normal((60, 2))
    rows = np.array([5, 0, 5, 2, 7, 2])
    H = stack_rows(x, 4)[rows]
    R = accumulate(x, 4).matrix(rows)
    np.testing.assert_allclose(R.T @ R, H @ H.T, atol=1e-12)
    np.testing.assert_array_equal(R[[2, 5]], 0.0)  # repeated rows add nothing


def test_lags_limit_the_rows_that_are_multiplied():
    """Past rows of channel 1 and future rows of both: as `HankelRows` takes them."""
    x = np.random.default_rng(2).standard_normal((200, 2))
    rows = np.array([6, 8, 10, 1, 3, 5, 7, 9, 11])  # of channel 0 the last three block rows, of channel 1 all six
    R = accumulate(x, 6, lags=np.array([3, 6])).matrix(rows)
    np.testing.assert_allclose(R, accumulate(x, 6).matrix(rows), rtol=1e-13, atol=1e-13)


def test_a_record_without_a_single_column_is_refused():
    with pytest.raises(DataError, match="shorter than the 5 samples of one Hankel column"):
        accumulate(np.ones((4, 1)), 5).matrix()


# --- accuracy, against rational numbers


def compute_exact_pivots(x, rows):
    """Squares of the diagonal of the exact factor, by Gaussian elimination of the exact inner products."""
    H = [[Fraction(float(x[t + i, 0])) for t in range(len(x) - rows + 1)] for i in range(rows)]
    G = [[sum(a * b for a, b in zip(first, second, strict=True)) for second in H] for first in H]
    pivots = []
    for j in range(rows):
        pivots.append(G[j][j])
        for i in range(j + 1, rows):
            ratio = G[i][j] / G[j][j]
            G[i] = [a - ratio * b for a, b in zip(G[i], G[j], strict=True)]
    return np.array([float(pivot) for pivot in pivots])


@pytest.mark.parametrize("noise", [1e-3, 1e-6, 1e-9, 1e-12])
def test_nearly_dependent_rows_keep_their_digits(noise):
    """Two sinusoids leave four independent rows; all others are noise, down to a trillionth of the signal."""
    t = np.arange(60)[:, None]
    x = np.sin(0.3 * t) + np.cos(0.7 * t) + noise * np.random.default_rng(3).standard_normal(t.shape)
    exact = compute_exact_pivots(x, 8)
    assert np.all(exact[4:] < 1e4 * noise**2)
    pivots = np.diag(accumulate(x, 8, subtract_means=False).matrix()) ** 2
    householder = np.diag(np.linalg.qr(block_hankel(x, 0, 8, 53).T, mode="r")) ** 2
    errors = [np.max(np.abs(values / exact - 1.0)) for values in (pivots, householder)]
    assert errors[0] < max(1e-14, 1e-26 / noise**2)
    assert errors[0] <= max(errors[1], 1e-14)


def test_a_dependent_row_is_left_out():
    rng = np.random.default_rng(4)
    A = rng.standard_normal((20, 5))
    A[:, 3] = A[:, 0] - 2.0 * A[:, 1]
    G = A.T @ A
    R = factor_products(G.copy(), np.zeros_like(G), len(G))
    # The products themselves are rounded to 16 digits, so what is left of the row is their rounding.
    assert np.abs(R[3]).max() < 1e-6
    np.testing.assert_allclose(R.T @ R, G, atol=1e-12)
    np.testing.assert_allclose(np.abs(np.diag(R))[[0, 1, 2]], np.abs(np.diag(np.linalg.qr(A, mode="r")))[[0, 1, 2]])
    zero = factor_products(np.diag([1.0, 0.0, 4.0]), np.zeros((3, 3)), 3)
    np.testing.assert_array_equal(zero, np.diag([1.0, 0.0, 2.0]))


# --- several records


def test_factors_of_records_combine():
    rng = np.random.default_rng(5)
    records = [rng.standard_normal((n, 2)) for n in (40, 25, 31)]
    factors = [accumulate(record, 3).matrix() for record in records]
    before = [factor.copy() for factor in factors]
    R = combine_factors(factors)
    H = np.hstack([stack_rows(record, 3) for record in records])
    np.testing.assert_allclose(R.T @ R, H @ H.T, atol=1e-12)
    np.testing.assert_array_equal(factors, before)
    np.testing.assert_array_equal(R, np.triu(R))


def test_rows_are_added_to_a_factor():
    rng = np.random.default_rng(6)
    rows = rng.standard_normal((50, 4))
    R = np.zeros((4, 4), order="F")
    for part in np.array_split(rows, 7):
        R = update_factor(R, part.copy())
    np.testing.assert_allclose(R.T @ R, rows.T @ rows, atol=1e-12)


# --- identification


@settings(deadline=None, max_examples=30)
@given(
    order=st.integers(1, 4),
    inputs=st.integers(1, 2),
    outputs=st.integers(1, 2),
    samples=st.sampled_from([250, 2000]),
    seed=st.integers(0, 2**32 - 1),
)
def test_poles_without_noise(order, inputs, outputs, samples, seed):
    rng = np.random.default_rng(seed)
    poles = np.linspace(-0.8, 0.9, order + 1)[1:]
    A, B, C = np.diag(poles), rng.uniform(0.5, 1.5, (order, inputs)), rng.uniform(0.5, 1.5, (outputs, order))
    u = rng.standard_normal((samples, inputs))
    y = simulate_response(A, B, C, rng.standard_normal((outputs, inputs)), u)
    estimate = moesp(u, y, 8, order, "past-input-output")
    assert estimate.diagnostics["compression"] == "qr"
    np.testing.assert_allclose(np.sort(estimate.diagnostics["poles"].real), poles, atol=1e-10)


def test_the_first_rows_alone():
    x = np.random.default_rng(4).standard_normal((90, 2))
    for subtract_means in (True, False):
        factor = accumulate(x, 5, subtract_means=subtract_means)
        np.testing.assert_array_equal(factor.matrix(count=4), factor.matrix()[:4])


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e9])
def test_products_have_twice_the_digits(size):
    """Against exact rational numbers, over more columns than are summed at a time."""
    x = size * np.random.default_rng(5).standard_normal((201, 1))
    high, low = np.zeros((2, 2, 2))
    _sum_products(x, 200, np.array([2]), high, low)
    exact = sum(Fraction(a) * Fraction(b) for a, b in zip(x[:200, 0], x[1:, 0], strict=True))
    error = Fraction(high[0, 1]) + Fraction(low[0, 1]) - exact
    assert abs(float(error)) < 4e-30 * 200 * size**2
