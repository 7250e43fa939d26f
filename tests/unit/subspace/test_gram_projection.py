import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ankleloop import simulate
from ankleloop.errors import DataError
from ankleloop.joint.regressors import build_regressors
from ankleloop.methods.moesp import torques
from ankleloop.subspace import moesp
from ankleloop.subspace.gram_projection import project_gram
from ankleloop.subspace.projection import project


def gram_of(*matrices):
    rows = np.vstack([X - X.mean(axis=1, keepdims=True) for X in matrices])
    return rows @ rows.T


def both(U, Z, Y, form, tolerance=1e-8, order=1):
    fast = project_gram(gram_of(U, Z, Y), (len(U), len(Z)), U.shape[1], form, tolerance, order)
    return fast, project(U, Y, Z, form, tolerance, order)


def spanned(found, n):
    return found.observability[:, :n] @ found.observability[:, :n].T


@settings(deadline=None, max_examples=60)
@given(
    u_rows=st.integers(1, 8),
    y_rows=st.integers(2, 5),
    z_rows=st.integers(0, 14),
    form=st.sampled_from(["ordinary", "correlation"]),
    seed=st.integers(0, 2**32 - 1),
)
def test_the_same_as_by_factorisation(u_rows, y_rows, z_rows, form, seed):
    rng = np.random.default_rng(seed)
    U, Z, Y = (rng.standard_normal((rows, 300)) for rows in (u_rows, z_rows, y_rows))
    if form == "correlation" and z_rows < u_rows + 1:
        with pytest.raises(DataError, match="rows of instruments"):
            both(U, Z, Y, form)
        return
    fast, slow = both(U, Z, Y, form)
    size = min(len(fast.singular_values), len(slow.singular_values))
    np.testing.assert_allclose(fast.singular_values[:size], slow.singular_values[:size], rtol=1e-8, atol=1e-12)
    assert (fast.input_rank, fast.instrument_rank) == (slow.input_rank, slow.instrument_rank)
    # By this route it is an estimate where all directions count.
    assert 0.3 * slow.condition <= fast.condition < 3.0 * np.sqrt(u_rows) * slow.condition


def test_a_rank_that_rounding_decides_is_left_open():
    rng = np.random.default_rng(0)
    U, Z, Y = (rng.standard_normal((rows, 400)) for rows in (5, 4, 3))
    U[4] = U[0] + 1e-8 * U[4]
    fast, slow = both(U, Z, Y, "ordinary", tolerance=1e-8)
    assert fast is None
    assert slow.input_rank in (4, 5)


def test_rows_that_repeat_do_not_count_twice():
    rng = np.random.default_rng(1)
    U, Z, Y = (rng.standard_normal((rows, 400)) for rows in (5, 4, 3))
    U = np.vstack([U, U[:2] - U[2:4]])
    fast, slow = both(U, Z, Y, "ordinary", tolerance=1e-5)
    assert (fast.input_rank, slow.input_rank) == (5, 5)
    np.testing.assert_allclose(spanned(fast, 2), spanned(slow, 2), atol=1e-9)


def test_too_few_instruments_are_refused():
    rng = np.random.default_rng(2)
    U, Y = rng.standard_normal((3, 200)), rng.standard_normal((3, 200))
    with pytest.raises(DataError, match="the instruments have rank 0 beside the future inputs"):
        project_gram(gram_of(U, U[:2] * 2, Y), (3, 2), 200, "ordinary", 1e-5, 1)


@pytest.mark.parametrize("basis", ["chebyshev", "rectifier"])
@pytest.mark.parametrize(
    ("instruments", "form"), [("past-reference", "ordinary"), ("past-input-output", "correlation")]
)
@pytest.mark.parametrize("noise", [{}, {"snr_db": None, "voluntary": 0.0, "reflex_gain": 20.0}])
def test_the_regressors_of_the_paper(basis, instruments, form, noise):
    """Rank deficient by construction: both routes agree to a part in a million, and the fast one is taken."""
    trial = simulate(seed=5, **noise)
    options = {"delay": 0.04, "basis": basis, "degree": 5, "identification_rate": 100.0, "reference": "reference"}
    part = build_regressors(trial, **options)
    given = {"reference": part.reference, "dynamic": part.reflex, "rank_tolerance": 1e-5, "regression_tolerance": 1e-3}
    fast, slow = (
        moesp(part.inputs, part.torque, 15, 2, instruments, form, compression=route, **given)
        for route in ("gram", "qr")
    )
    assert fast.diagnostics["compression"] == "gram"
    assert slow.diagnostics["compression"] == "qr"
    assert fast.diagnostics["rank"] == slow.diagnostics["rank"] < part.inputs.shape[1] * 15
    direct, expected = fast.matrices.D[0], slow.matrices.D[0]
    np.testing.assert_allclose(direct[:3], expected[:3], rtol=1e-6)  # K, B, I
    np.testing.assert_allclose(direct[3:], expected[3:], atol=1e-6 * np.abs(expected[3:]).max())
    for one, other in zip(*(torques(found.matrices, None, part).values() for found in (fast, slow)), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-6 * np.abs(other).max())
    poles = [np.sort_complex(found.diagnostics["poles"]) for found in (fast, slow)]
    np.testing.assert_allclose(*poles, rtol=1e-6)
    np.testing.assert_allclose(fast.singular_values[:2], slow.singular_values[:2], rtol=1e-6)


def test_what_squares_cannot_carry_is_factorised():
    """Past inputs and outputs of noise-free data depend on each other, and their inner products do not tell how."""
    rng = np.random.default_rng(3)
    u, y = rng.standard_normal((800, 1)), np.zeros((800, 1))
    for t in range(1, 800):
        y[t] = 0.7 * y[t - 1] + u[t - 1]
    found = moesp(u, y, 8, 1, "past-input-output")
    assert found.diagnostics["compression"] == "qr"
    assert found.diagnostics["poles"][0] == pytest.approx(0.7, abs=1e-10)


def test_a_reference_that_is_the_input_is_the_past_input():
    rng = np.random.default_rng(4)
    u = rng.standard_normal((600, 3))
    y = np.cumsum(u @ [[0.1], [0.2], [0.3]], axis=0) * 0.01 + 0.1 * rng.standard_normal((600, 1))
    open_loop, past = moesp(u, y, 8, 1, "past-reference", reference=u), moesp(u, y, 8, 1, "past-input")
    np.testing.assert_array_equal(open_loop.matrices.A, past.matrices.A)
    np.testing.assert_array_equal(open_loop.matrices.D, past.matrices.D)


def test_an_unknown_route_is_refused():
    with pytest.raises(ValueError, match="unknown compression 'svd'; known: gram, qr"):
        moesp(np.ones((10, 1)), np.ones((10, 1)), 3, 1, compression="svd")
