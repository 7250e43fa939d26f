"""Basis functions against their definitions."""

import numpy as np
import pytest

from ankleloop.errors import DataError
from ankleloop.joint.bases import BASES
from ankleloop.methods.method import BasisOptions

VELOCITY = np.random.default_rng(0).standard_normal(4000)


@pytest.mark.parametrize("degree", [1, 2, 5, 12])
def test_chebyshev_terms_against_the_cosine(degree):
    basis = BASES["chebyshev"].fit(VELOCITY, degree)
    x = VELOCITY / np.max(np.abs(VELOCITY))
    np.testing.assert_allclose(
        basis(VELOCITY), [np.cos(k * np.arccos(x)) for k in range(1, degree + 1)], atol=1e-8
    )
    assert basis.names == tuple(f"chebyshev_{k}" for k in range(1, degree + 1))


def test_rectifier():
    basis = BASES["rectifier"].fit(VELOCITY, 5)
    np.testing.assert_array_equal(basis(VELOCITY), [np.where(VELOCITY > 0, VELOCITY, 0.0)])
    assert basis.names == ("rectified_velocity",)


@pytest.mark.parametrize("degree", [4, 5, 8, 12])
def test_splines_contain_every_cubic_and_are_independent(degree):
    basis = BASES["spline"].fit(VELOCITY, degree)
    terms = basis(VELOCITY)
    assert terms.shape == (degree, VELOCITY.size)
    centred = (terms - terms.mean(axis=1, keepdims=True)).T
    assert np.linalg.matrix_rank(centred) == degree
    for power in (1, 2, 3):
        target = VELOCITY**power - np.mean(VELOCITY**power)
        residual = target - centred @ np.linalg.lstsq(centred, target, rcond=None)[0]
        assert np.max(np.abs(residual)) < 1e-9 * np.max(np.abs(target))
    # B-splines sum to one, so one minus the sum of the terms is the function that the basis leaves out: the first of a
    # clamped cubic family, which falls from 1 at the end knot to 0 at the next one.
    first, second = np.quantile(VELOCITY, [0.0, 1.0 / (degree - 2)])
    expected = np.maximum((second - VELOCITY) / (second - first), 0.0) ** 3
    np.testing.assert_allclose(1 - terms.sum(axis=0), expected, atol=1e-12)
    assert np.linalg.cond(centred / centred.std(axis=0)) < 1e3


def test_a_spline_is_constant_beyond_the_velocities_of_its_fit():
    basis = BASES["spline"].fit(VELOCITY, 6)
    ends = np.array([VELOCITY.min(), VELOCITY.max()])
    np.testing.assert_array_equal(basis(2 * ends), basis(ends))


def test_velocities_of_few_values_are_refused():
    with pytest.raises(DataError, match="too few values"):
        BASES["spline"].fit(np.sign(VELOCITY), 6)


@pytest.mark.parametrize("kind", BASES)
def test_what_every_basis_says_of_itself(kind):
    """Names and functions are as many as its degree, its limits are those of the velocity, and options know it."""
    basis = BASES[kind].fit(VELOCITY, 6)
    assert basis.kind == kind
    assert len(basis.names) == basis.degree == BASES[kind].count_terms(6)
    assert basis(VELOCITY).shape == (basis.degree, VELOCITY.size)
    low, high = basis.limits
    assert low <= VELOCITY.min() < VELOCITY.max() <= high
    assert np.isin([low, high], [*VELOCITY, *-VELOCITY]).all()
    assert np.mean(basis.quantiles[100] > VELOCITY) == pytest.approx(0.5, abs=0.01)
    assert BasisOptions(basis=kind).basis == kind
    least = BASES[kind].least_degree
    assert BASES[kind].fit(VELOCITY, least)(VELOCITY).shape[0] == least
