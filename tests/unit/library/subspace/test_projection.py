import sys

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from ankleloop import simulate
from ankleloop.errors import DataError
from ankleloop.joint.prepared import prepare
from ankleloop.subspace import moesp
from ankleloop.subspace.hankel import block_hankel
from ankleloop.subspace.projection import (
    ACCURACY,
    project_correlation,
    project_factor,
    project_gram,
)

TOLERANCE = 1e-8


def factor_rows(*matrices):
    """Triangular factor of the rows, each less its mean."""
    rows = np.vstack(matrices)
    return np.linalg.qr((rows - rows.mean(axis=1, keepdims=True)).T, mode="r")


def compute_gram(*matrices):
    rows = np.vstack([X - X.mean(axis=1, keepdims=True) for X in matrices])
    return rows @ rows.T


def project(U, Y, Z, form, rank_tolerance, order):
    arguments = (len(U), len(Z)), U.shape[1], rank_tolerance, order
    if form == "correlation":
        return project_correlation(compute_gram(U, Z, Y), *arguments)
    return project_factor(factor_rows(U, Z, Y), *arguments)


def remove_rows(X, U):
    """X Π⊥_U, by its definition."""
    return X - X @ np.linalg.pinv(U) @ U


def project_dense(U, Y, Z, form):
    """The matrix whose left singular vectors the projection returns, by dense formulas on rows without their means."""
    U, Y, Z = (X - X.mean(axis=1, keepdims=True) for X in (U, Y, Z))
    if form == "correlation":
        return remove_rows(Y @ Z.T, U @ Z.T)
    Y = remove_rows(Y, U)
    if Z.shape[0] == 0:
        return Y
    Z = remove_rows(Z, U)
    # Least squares of Y on Z: the part of Y in the row space of Z.
    return np.linalg.lstsq(Z.T, Y.T, rcond=None)[0].T @ Z


def multiply(projection):
    """Left vectors and singular values together, free of signs and of the order of equal values."""
    return projection.observability * projection.singular_values**2 @ projection.observability.T


def project_on_span(matrix, n):
    left = np.linalg.svd(matrix)[0][:, :n]
    return left @ left.T


def random_matrices(rng, u_rows, y_rows, z_rows, columns):
    return [rng.standard_normal((rows, columns)) for rows in (u_rows, y_rows, z_rows)]


# --- the algebra


@settings(deadline=None, max_examples=60)
@given(
    u_rows=st.integers(1, 8),
    y_rows=st.integers(2, 6),
    z_rows=st.integers(0, 9),
    extra=st.integers(0, 40),
    seed=st.integers(0, 2**32 - 1),
)
def test_ordinary_form(u_rows, y_rows, z_rows, extra, seed):
    # One column more than rows are the fewest possible: the mean takes one direction.
    columns = u_rows + y_rows + z_rows + 1 + extra
    U, Y, Z = random_matrices(np.random.default_rng(seed), u_rows, y_rows, z_rows, columns)
    projection = project(U, Y, Z, "ordinary", TOLERANCE, 0)
    expected = project_dense(U, Y, Z, "ordinary")
    np.testing.assert_allclose(
        multiply(projection) * columns, expected @ expected.T, rtol=1e-9, atol=1e-9 * columns
    )
    assert (projection.input_rank, projection.instrument_rank) == (u_rows, z_rows)


@settings(deadline=None, max_examples=60)
@given(
    u_rows=st.integers(1, 8),
    y_rows=st.integers(2, 6),
    order=st.integers(1, 3),
    spare=st.integers(0, 8),
    extra=st.integers(0, 40),
    seed=st.integers(0, 2**32 - 1),
)
def test_correlation_form(u_rows, y_rows, order, spare, extra, seed):
    z_rows = u_rows + order + spare
    columns = u_rows + y_rows + z_rows + 1 + extra
    U, Y, Z = random_matrices(np.random.default_rng(seed), u_rows, y_rows, z_rows, columns)
    projection = project(U, Y, Z, "correlation", TOLERANCE, order)
    expected = project_dense(U, Y, Z, "correlation")
    expected = expected @ expected.T
    np.testing.assert_allclose(
        multiply(projection) * columns**2, expected, rtol=1e-7, atol=1e-9 * np.trace(expected)
    )
    assert (projection.input_rank, projection.instrument_rank) == (u_rows, z_rows)


# --- the rank policy

ROWS, COLUMNS = 6, 200


def build_hankels(u, y):
    U, Y = (block_hankel(x, ROWS, ROWS, COLUMNS) for x in (u, y))
    return U, Y, block_hankel(u, 0, ROWS, COLUMNS)


@pytest.mark.parametrize(
    "instruments",
    ["none", "ordinary", "correlation"],
    ids=["ordinary-without", "ordinary-with", "correlation"],
)
@pytest.mark.parametrize("kind", ["duplicated", "scaled", "shifted", "combined"])
def test_dependent_rows_count_once(instruments, kind):
    rng = np.random.default_rng(0)
    u = rng.standard_normal((COLUMNS + 2 * ROWS - 1, 2))
    y = u[:, :1] + np.roll(u[:, 1:], 1, axis=0) + 0.1 * rng.standard_normal((len(u), 1))
    U, Y, Z = build_hankels(u, y)
    if instruments == "none":
        Z = Z[:0]
    elif instruments == "correlation":
        Z = np.vstack([Z, rng.standard_normal((12, COLUMNS))])  # enough rows for all of U
    form = "correlation" if instruments == "correlation" else "ordinary"
    more, rank = {
        "duplicated": (U[::2], 12),
        "scaled": (-3.0 * U[1::2], 12),
        # The first input one sample late: its Hankel rows are those of the input, and one from before the window.
        "shifted": (block_hankel(u[:, :1], ROWS - 1, ROWS, COLUMNS), 13),
        "combined": (U[:6] + 0.5 * U[6:], 12),
    }[kind]
    stacked = np.vstack([U, more])
    reduced = np.vstack([U, more[:1]]) if kind == "shifted" else U
    projection = project(stacked, Y, Z, form, TOLERANCE, 2)
    expected = project(reduced, Y, Z, form, TOLERANCE, 2)
    assert projection.input_rank == expected.input_rank == np.linalg.matrix_rank(stacked) == rank
    np.testing.assert_allclose(multiply(projection), multiply(expected), rtol=1e-9, atol=1e-12)
    first_two = projection.observability[:, :2]
    np.testing.assert_allclose(
        first_two @ first_two.T, project_on_span(project_dense(reduced, Y, Z, form), 2), atol=1e-9
    )


@pytest.mark.parametrize(("size", "counts"), [(1e-6, True), (1e-10, False)])
def test_a_direction_counts_above_the_tolerance(size, counts):
    U, Y, Z = random_matrices(np.random.default_rng(5), 3, 4, 0, 60)
    almost = np.vstack([U, U[:1] + size * np.random.default_rng(6).standard_normal((1, 60))])
    projection = project(almost, Y, Z, "ordinary", TOLERANCE, 1)
    assert projection.input_rank == 3 + counts


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_instruments_inside_the_inputs_are_refused_whatever_their_size(scale):
    U, Y, _ = random_matrices(np.random.default_rng(8), 6, 4, 0, 60)
    message = "the instruments have rank 0 beside the future inputs, but order 2 needs at least 2: use more"
    with pytest.raises(DataError, match=message):
        project(U, Y, scale * U[:3], "ordinary", TOLERANCE, 2)


# --- inner products


@settings(deadline=None, max_examples=60)
@given(
    seed=st.integers(0, 2**32 - 1),
    u_rows=st.integers(1, 8),
    y_rows=st.integers(2, 5),
    z_rows=st.integers(0, 14),
    small=st.floats(-13.0, 0.0),
    tolerance=st.sampled_from([1e-3, 1e-5, 1e-8, 0.0]),
)
@example(seed=0, u_rows=4, y_rows=2, z_rows=0, small=-6.875, tolerance=1e-8)
@example(seed=2, u_rows=2, y_rows=2, z_rows=1, small=-6.654296875, tolerance=1e-8)
def test_inner_products_give_the_projection_of_a_factor_or_none(
    seed, u_rows, y_rows, z_rows, small, tolerance
):
    """Also where squares hide a direction that a factor shows."""
    rng = np.random.default_rng(seed)
    U, Z, Y = (rng.standard_normal((rows, 300)) for rows in (u_rows, z_rows, y_rows))
    U[-1] = U[0] + 10.0**small * U[-1]
    arguments = (u_rows, z_rows), 300, tolerance, 1
    try:
        expected = project_factor(factor_rows(U, Z, Y), *arguments)
    except DataError:
        return
    projection = project_gram(compute_gram(U, Z, Y), *arguments)
    if projection is None:
        assert small < -3.0
        return
    if not 0.1 < 10.0**small / max(tolerance, 1e-12) < 10.0:  # at the tolerance the draw decides
        assert (projection.input_rank, projection.instrument_rank) == (
            expected.input_rank,
            expected.instrument_rank,
        )
        size = min(len(projection.singular_values), len(expected.singular_values))
        squares, exact = (part.singular_values[:size] ** 2 for part in (projection, expected))
        np.testing.assert_allclose(squares, exact, rtol=0.0, atol=ACCURACY * exact[0])


@pytest.mark.parametrize(
    ("basis", "noise"),
    [
        ("chebyshev", {}),
        ("rectifier", {}),
        ("rectifier", {"snr_db": None, "voluntary": 0.0, "reflex_gain": 20.0}),
    ],
)
def test_inner_products_suffice_for_the_regressors_of_the_paper(basis, noise, monkeypatch):
    """Rank deficient by construction: both routes agree far below the noise."""
    part = prepare(simulate(seed=5, **noise)).regressors(
        delay=0.04, basis=basis, degree=5, identification_rate=100.0, reference="reference"
    )
    arguments = {"reference": part.reference, "dynamic": part.reflex, "rank_tolerance": 1e-5}

    def identify():
        return moesp(
            part.inputs,
            part.torque,
            15,
            2,
            "past-reference",
            regression_tolerance=1e-3,
            **arguments,
        )

    estimate = identify()
    monkeypatch.setattr(sys.modules[moesp.__module__], "project_gram", lambda *_: None)
    expected = identify()
    assert (estimate.diagnostics["compression"], expected.diagnostics["compression"]) == (
        "gram",
        "qr",
    )
    assert estimate.diagnostics["rank"] == expected.diagnostics["rank"] < part.inputs.shape[1] * 15
    D, expected_D = estimate.matrices.D[0], expected.matrices.D[0]
    np.testing.assert_allclose(D[:3], expected_D[:3], rtol=1e-6)  # K, B, I
    np.testing.assert_allclose(D[3:], expected_D[3:], atol=5e-6 * np.abs(expected_D[3:]).max())
    np.testing.assert_allclose(
        estimate.singular_values[:2], expected.singular_values[:2], rtol=5e-6
    )
