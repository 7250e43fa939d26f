import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ankleloop import simulate
from ankleloop.errors import DataError
from ankleloop.joint.prepared import prepare
from ankleloop.methods.moesp import simulate_torques
from ankleloop.subspace import moesp
from ankleloop.subspace.gram_projection import project_gram
from ankleloop.subspace.projection import factor_rows, project


def compute_gram(*matrices):
    rows = np.vstack([X - X.mean(axis=1, keepdims=True) for X in matrices])
    return rows @ rows.T


def project_twice(U, Z, Y, form, tolerance=1e-8, order=1):
    """From inner products, and from a triangular factor."""
    arguments = (len(U), len(Z)), U.shape[1], form, tolerance, order
    return project_gram(compute_gram(U, Z, Y), *arguments), project(factor_rows(U, Z, Y), *arguments)


def project_on_span(projection, n):
    return projection.observability[:, :n] @ projection.observability[:, :n].T


@settings(deadline=None, max_examples=60)
@given(
    u_rows=st.integers(1, 8),
    y_rows=st.integers(2, 5),
    z_rows=st.integers(0, 14),
    form=st.sampled_from(["ordinary", "correlation"]),
    seed=st.integers(0, 2**32 - 1),
)
def test_inner_products_give_the_projection_of_a_factor(u_rows, y_rows, z_rows, form, seed):
    rng = np.random.default_rng(seed)
    U, Z, Y = (rng.standard_normal((rows, 300)) for rows in (u_rows, z_rows, y_rows))
    if form == "correlation" and z_rows < u_rows + 1:
        with pytest.raises(DataError, match="rows of instruments"):
            project_twice(U, Z, Y, form)
        return
    projection, expected = project_twice(U, Z, Y, form)
    size = min(len(projection.singular_values), len(expected.singular_values))
    np.testing.assert_allclose(
        projection.singular_values[:size], expected.singular_values[:size], rtol=1e-8, atol=1e-12
    )
    assert (projection.input_rank, projection.instrument_rank) == (expected.input_rank, expected.instrument_rank)
    # From inner products it is an estimate where all directions count.
    assert 0.3 * expected.condition <= projection.condition < 3.0 * np.sqrt(u_rows) * expected.condition


def test_a_rank_that_depends_on_rounding_gives_none():
    rng = np.random.default_rng(0)
    U, Z, Y = (rng.standard_normal((rows, 400)) for rows in (5, 4, 3))
    U[4] = U[0] + 1e-8 * U[4]
    projection, expected = project_twice(U, Z, Y, "ordinary", tolerance=1e-8)
    assert projection is None
    assert expected.input_rank in (4, 5)


def test_rows_that_repeat_do_not_count_twice():
    rng = np.random.default_rng(1)
    U, Z, Y = (rng.standard_normal((rows, 400)) for rows in (5, 4, 3))
    U = np.vstack([U, U[:2] - U[2:4]])
    projection, expected = project_twice(U, Z, Y, "ordinary", tolerance=1e-5)
    assert (projection.input_rank, expected.input_rank) == (5, 5)
    np.testing.assert_allclose(project_on_span(projection, 2), project_on_span(expected, 2), atol=1e-9)


def test_too_few_instruments_are_refused():
    rng = np.random.default_rng(2)
    U, Y = rng.standard_normal((3, 200)), rng.standard_normal((3, 200))
    with pytest.raises(DataError, match="the instruments have rank 0 beside the future inputs"):
        project_gram(compute_gram(U, U[:2] * 2, Y), (3, 2), 200, "ordinary", 1e-5, 1)


@pytest.mark.parametrize("basis", ["chebyshev", "rectifier"])
@pytest.mark.parametrize(
    ("instruments", "form"), [("past-reference", "ordinary"), ("past-input-output", "correlation")]
)
@pytest.mark.parametrize("noise", [{}, {"snr_db": None, "voluntary": 0.0, "reflex_gain": 20.0}])
def test_regressors_of_the_paper(basis, instruments, form, noise):
    """Rank deficient by construction: both compressions agree to a part in a million, and inner products suffice."""
    trial = simulate(seed=5, **noise)
    options = {"delay": 0.04, "basis": basis, "degree": 5, "identification_rate": 100.0, "reference": "reference"}
    part = prepare(trial).regressors(**options)
    arguments = {
        "reference": part.reference,
        "dynamic": part.reflex,
        "rank_tolerance": 1e-5,
        "regression_tolerance": 1e-3,
    }
    estimate, expected = (
        moesp(part.inputs, part.torque, 15, 2, instruments, form, compression=compression, **arguments)
        for compression in ("gram", "qr")
    )
    assert estimate.diagnostics["compression"] == "gram"
    assert expected.diagnostics["compression"] == "qr"
    assert estimate.diagnostics["rank"] == expected.diagnostics["rank"] < part.inputs.shape[1] * 15
    D, expected_D = estimate.matrices.D[0], expected.matrices.D[0]
    np.testing.assert_allclose(D[:3], expected_D[:3], rtol=1e-6)  # K, B, I
    np.testing.assert_allclose(D[3:], expected_D[3:], atol=1e-6 * np.abs(expected_D[3:]).max())
    torques = (simulate_torques(model.matrices, None, part).values() for model in (estimate, expected))
    for torque, expected_torque in zip(*torques, strict=True):
        np.testing.assert_allclose(torque, expected_torque, atol=1e-6 * np.abs(expected_torque).max())
    poles = [np.sort_complex(model.diagnostics["poles"]) for model in (estimate, expected)]
    np.testing.assert_allclose(*poles, rtol=1e-6)
    np.testing.assert_allclose(estimate.singular_values[:2], expected.singular_values[:2], rtol=1e-6)


def test_data_without_noise_are_factorised():
    """Past inputs and outputs of noise-free data depend on each other, which rounding of their squares hides."""
    rng = np.random.default_rng(3)
    u, y = rng.standard_normal((800, 1)), np.zeros((800, 1))
    for t in range(1, 800):
        y[t] = 0.7 * y[t - 1] + u[t - 1]
    estimate = moesp(u, y, 8, 1, "past-input-output")
    assert estimate.diagnostics["compression"] == "qr"
    assert estimate.diagnostics["poles"][0] == pytest.approx(0.7, abs=1e-10)


def open_loop_data():
    rng = np.random.default_rng(4)
    u = rng.standard_normal((600, 3))
    return u, np.cumsum(u @ [[0.1], [0.2], [0.3]], axis=0) * 0.01 + 0.1 * rng.standard_normal((600, 1))


def test_a_reference_that_is_the_input_is_the_past_input():
    u, y = open_loop_data()
    open_loop, past = moesp(u, y, 8, 1, "past-reference", reference=u), moesp(u, y, 8, 1, "past-input")
    np.testing.assert_array_equal(open_loop.matrices.A, past.matrices.A)
    np.testing.assert_array_equal(open_loop.matrices.D, past.matrices.D)


@pytest.mark.parametrize("projection", ["ordinary", "correlation"])
def test_leads_of_a_reference_that_is_the_input(projection):
    """They are rows of the future inputs as well."""
    u, y = open_loop_data()
    options = {"instrument_rows": 12, "instrument_leads": 2, "rank_tolerance": 1e-5}
    estimate, expected = (
        moesp(u, y, 8, 1, "past-reference", projection, u, compression=compression, **options)
        for compression in ("gram", "qr")
    )
    assert estimate.diagnostics["compression"] == "gram"
    for name in ("rank", "instrument_rank", "instrument_rows"):
        assert estimate.diagnostics[name] == expected.diagnostics[name]
    np.testing.assert_allclose(estimate.matrices.A, expected.matrices.A, rtol=1e-9)
    np.testing.assert_allclose(estimate.matrices.D, expected.matrices.D, rtol=1e-9)


def test_an_unknown_compression_is_refused():
    with pytest.raises(ValueError, match="compression must be one of 'gram' or 'qr'; got 'svd'"):
        moesp(np.ones((10, 1)), np.ones((10, 1)), 3, 1, compression="svd")
