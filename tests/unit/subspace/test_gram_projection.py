import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from ankleloop import simulate
from ankleloop.errors import DataError
from ankleloop.joint.models import simulate_torques
from ankleloop.joint.prepared import prepare
from ankleloop.subspace import moesp, simulate_response
from ankleloop.subspace.gram_projection import expect_accuracy, project_gram
from ankleloop.subspace.hankel import block_hankel
from ankleloop.subspace.projection import project


def factor_rows(*matrices):
    """Triangular factor of the rows, each less its mean."""
    rows = np.vstack(matrices)
    return np.linalg.qr((rows - rows.mean(axis=1, keepdims=True)).T, mode="r")


def compute_gram(*matrices):
    rows = np.vstack([X - X.mean(axis=1, keepdims=True) for X in matrices])
    return rows @ rows.T


def project_twice(U, Z, Y, form, tolerance=1e-8, order=1):
    """From inner products, and from a triangular factor."""
    arguments = (len(U), len(Z)), U.shape[1], form, tolerance, order
    return project_gram(compute_gram(U, Z, Y), *arguments), project(factor_rows(U, Z, Y), *arguments)


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


# --- the rank policy is that of both forms and of both routes


def directions(rng, sizes, columns=600):
    """Rows with these singular values, apart from a common factor."""
    rows = np.linalg.qr(rng.standard_normal((columns, len(sizes))))[0]
    rows -= rows.mean(axis=0)
    mixing = np.linalg.qr(rng.standard_normal((len(sizes), len(sizes))))[0]
    return mixing @ (np.linalg.qr(rows)[0] * sizes).T, rows


@pytest.mark.parametrize("tolerance", [3e-3, 3e-5, 3e-7])
def test_a_tolerance_means_the_same_in_both_forms_if_the_instruments_show_all_inputs_alike(tolerance):
    """The correlation form sees U Z': with instruments of equal size its singular values fall as those of U do."""
    rng = np.random.default_rng(6)
    sizes = 10.0 ** -np.arange(0.5, 8.0)
    U, basis = directions(rng, sizes)
    extra = rng.standard_normal((4, 600))
    Z = np.vstack([np.linalg.qr(basis)[0].T * 20.0, extra - extra.mean(axis=1, keepdims=True)])
    Y = rng.standard_normal((3, 600))
    expected = int(np.sum(sizes > tolerance * sizes[0]))
    ranks = {
        (form, route): projection.input_rank
        for form in ("ordinary", "correlation")
        for route, projection in zip(("gram", "qr"), project_twice(U, Z, Y, form, tolerance), strict=True)
        if projection is not None
    }
    assert set(ranks.values()) == {expected}
    assert {("ordinary", "qr"), ("correlation", "qr"), ("correlation", "gram")} <= set(ranks)


@settings(deadline=None, max_examples=60)
@given(
    seed=st.integers(0, 2**32 - 1),
    small=st.floats(-13.0, -1.0),
    tolerance=st.sampled_from([1e-3, 1e-5, 1e-8, 1e-10, 0.0]),
    form=st.sampled_from(["ordinary", "correlation"]),
)
def test_inner_products_give_the_ranks_of_a_factor_or_none(seed, small, tolerance, form):
    """Also where squares hide a direction of the instruments that a factor shows."""
    rng = np.random.default_rng(seed)
    U, Z, Y = (rng.standard_normal((rows, 300)) for rows in (3, 9, 4))
    Z[8] = Z[7] + 10.0**small * rng.standard_normal(300)
    projection, expected = project_twice(U, Z, Y, form, tolerance)
    ratio = 10.0**small / max(tolerance, 1e-12)
    if projection is None or 0.05 < ratio < 20.0:  # at the tolerance, singular values decide, which vary with the draw
        return
    assert projection.instrument_rank == expected.instrument_rank == 8 + (ratio > 1)
    assert projection.input_rank == expected.input_rank == 3


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


def simulate_coloured(seed, pole, noise, samples=1200):
    """Two inputs through three equal poles, and two noisy outputs of order 2."""
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((samples + 500, 2))
    for _ in range(3):
        for t in range(1, len(u)):
            u[t] += pole * u[t - 1]
    A, B, C = np.array([[0.7, 0.4], [-0.4, 0.7]]), rng.standard_normal((2, 2)), rng.standard_normal((2, 2))
    y = simulate_response(A, B, C, np.zeros((2, 2)), u[500:])
    return u[500:], y + noise * y.std(axis=0) * rng.standard_normal(y.shape)


@pytest.mark.parametrize("instruments", ["none", "past-input", "past-input-output"])
def test_inner_products_are_used_only_where_they_are_accurate(instruments):
    """Inputs that are harder and harder to tell apart: both routes occur, and where squares are used they agree."""
    routes = set()
    for seed, (pole, noise) in enumerate((pole, noise) for pole in (0.0, 0.8, 0.98) for noise in (1e-1, 1e-3, 1e-6)):
        u, y = simulate_coloured(seed, pole, noise)
        estimate, expected = (moesp(u, y, 12, 2, instruments, compression=route) for route in ("gram", "qr"))
        routes.add(estimate.diagnostics["compression"])
        poles = [np.sort_complex(model.diagnostics["poles"]) for model in (estimate, expected)]
        np.testing.assert_allclose(*poles, atol=1e-7)
    assert routes == {"gram", "qr"}


def test_a_small_problem_is_factorised_at_once():
    u, y = open_loop_data()
    assert moesp(u[:200], y[:200], 5, 1).diagnostics["compression"] == "qr"
    assert moesp(u, y, 12, 1).diagnostics["compression"] == "gram"


@pytest.mark.parametrize("band", [0.05, 0.1, 0.15, 0.4, None])
def test_inputs_in_a_narrow_band_show_that_inner_products_do_not_suffice(band):
    rng = np.random.default_rng(8)
    u = rng.standard_normal((2500, 2))
    u = signal.sosfilt(signal.butter(4, band, output="sos"), u, axis=0)[500:] if band else u
    u /= u.std(axis=0)
    y = u[:, :1] + 0.5 * np.roll(u[:, 1:], 1, axis=0) + 0.1 * rng.standard_normal((len(u), 1))
    U, Z, Y = block_hankel(u, 20, 20, 1900), block_hankel(u, 0, 20, 1900), block_hankel(y, 20, 20, 1900)
    expected = expect_accuracy(u, 40, 1e-8)
    assert expected == (band is None or band > 0.2)
    assert (project_twice(U, Z, Y, "ordinary")[0] is not None) == expected
    assert expect_accuracy(u, 40, 1e-3)  # then directions that rounding hides do not count
