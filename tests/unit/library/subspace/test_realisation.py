import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from ankleloop.subspace.projection import choose_order, realise

SEEDS = st.integers(0, 2**32 - 1)


def random_system(rng, order, outputs, radius):
    """A and C of a given spectral radius."""
    A = rng.standard_normal((order, order))
    return A * (radius / np.max(np.abs(np.linalg.eigvals(A)))), rng.standard_normal(
        (outputs, order)
    )


def observability(A, C, block_rows):
    return np.vstack([C @ np.linalg.matrix_power(A, k) for k in range(block_rows)])


def spectral_radius(A):
    return np.max(np.abs(np.linalg.eigvals(A)))


# --- A and C


@settings(deadline=None, max_examples=100)
@given(
    order=st.integers(1, 6),
    outputs=st.integers(1, 4),
    spare=st.integers(1, 10),
    more=st.integers(0, 3),
    radius=st.floats(0.3, 0.99),
    seed=SEEDS,
)
def test_exact_observability_matrix(order, outputs, spare, more, radius, seed):
    rng = np.random.default_rng(seed)
    A, C = random_system(rng, order, outputs, radius)
    exact = observability(A, C, order + spare)
    assume(np.linalg.cond(exact[:-outputs]) < 1e3)
    # The left singular vectors of a projection: the column space, and then directions of the noise.
    noise = rng.standard_normal((exact.shape[0], min(more, exact.shape[0] - order)))
    columns = np.linalg.qr(np.column_stack([exact, noise]))[0]
    A_estimate, C_estimate, _, unstable_radius = realise(columns, outputs, order)
    assert unstable_radius is None
    np.testing.assert_allclose(np.poly(A_estimate), np.poly(A), atol=1e-9)
    # The same system in another basis, whose observability matrix has these columns.
    np.testing.assert_allclose(
        observability(A_estimate, C_estimate, order + spare), columns[:, :order], atol=1e-9
    )


# --- stability


@settings(deadline=None, max_examples=100)
@given(
    order=st.integers(1, 5),
    outputs=st.integers(1, 3),
    spare=st.integers(1, 10),
    radius=st.floats(1.001, 1.5),
    seed=SEEDS,
)
def test_an_unstable_system_is_replaced_and_reported(order, outputs, spare, radius, seed):
    A, C = random_system(np.random.default_rng(seed), order, outputs, radius)
    exact = observability(A, C, order + spare)
    assume(np.linalg.cond(exact[:-outputs]) < 1e3)
    columns = np.linalg.qr(exact)[0]
    A_estimate, C_estimate, _, unstable_radius = realise(columns, outputs, order)
    assert unstable_radius == pytest.approx(radius, rel=1e-7)
    assert spectral_radius(A_estimate) < 1
    assert np.linalg.norm(A_estimate, 2) <= 1 + 1e-12
    np.testing.assert_array_equal(C_estimate, columns[:outputs])


@settings(deadline=None, max_examples=200)
@given(order=st.integers(1, 6), outputs=st.integers(1, 3), spare=st.integers(1, 6), seed=SEEDS)
def test_any_column_space_gives_a_stable_system(order, outputs, spare, seed):
    rows = (order + spare) * outputs
    columns = np.linalg.qr(np.random.default_rng(seed).standard_normal((rows, order)))[0]
    least_squares = np.linalg.pinv(columns[:-outputs]) @ columns[outputs:]
    A, _, _, unstable_radius = realise(columns, outputs, order)
    assert spectral_radius(A) < 1
    radius = spectral_radius(least_squares)
    assume(abs(radius - 1) > 1e-9)
    if radius < 1:
        assert unstable_radius is None
        np.testing.assert_allclose(A, least_squares, rtol=1e-8, atol=1e-8)
    else:
        assert unstable_radius == pytest.approx(radius, rel=1e-6)


# --- the order


@pytest.mark.parametrize(
    ("values", "largest", "order"),
    [
        ([3.0, 2.0, 1.0, 0.0, 0.0], 4, 3),  # exact zeros, as noise-free data give
        ([3.0, 2.0, 1.0, 1e-13, 1e-14, 0.0], 4, 3),
        ([5.0, 4.0, 1.0, 1e-6], 2, 2),  # the drop at 3 is beyond the largest order
        ([5.0, 1e-3, 1e-9], 1, 1),
        ([5.0, 1.0], 5, 1),  # fewer values than the largest order
        ([9.0, 3.0, 1.0], 2, 1),  # of equal drops the first
        ([9.0], 4, 1),
        ([9.0, 1.0], 0, 1),
    ],
)
def test_choose_order(values, largest, order):
    assert choose_order(np.array(values), largest) == order
