import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ankleloop.errors import DataError
from ankleloop.subspace.hankel import block_hankel
from ankleloop.subspace.projection import _find_directions
from ankleloop.subspace.projection import project as project_factor

TOLERANCE = 1e-8


def factor_rows(*matrices):
    """Triangular factor of the rows, each less its mean."""
    rows = np.vstack(matrices)
    return np.linalg.qr((rows - rows.mean(axis=1, keepdims=True)).T, mode="r")


def project(U, Y, Z, form, rank_tolerance, order):
    return project_factor(factor_rows(U, Z, Y), (len(U), len(Z)), U.shape[1], form, rank_tolerance, order)


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


def simulate_data(columns=200, rows=6, seed=0, inputs=2, order=2, noise=0.1):
    """Hankel matrices of a noisy second-order system with one output; the past inputs are the instruments."""
    rng = np.random.default_rng(seed)
    samples = columns + 2 * rows - 1
    u = rng.standard_normal((samples, inputs))
    A = np.diag([0.8, -0.5])
    B, C = rng.standard_normal((2, inputs)), np.ones((1, 2))
    y, x = np.empty((samples, 1)), np.zeros(order)
    for t in range(samples):
        y[t] = C @ x + u[t].sum()
        x = A @ x + B @ u[t]
    y += noise * rng.standard_normal(y.shape)
    return u, y


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
    np.testing.assert_allclose(multiply(projection) * columns, expected @ expected.T, rtol=1e-9, atol=1e-9 * columns)
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
    np.testing.assert_allclose(multiply(projection) * columns**2, expected, rtol=1e-7, atol=1e-9 * np.trace(expected))
    assert (projection.input_rank, projection.instrument_rank) == (u_rows, z_rows)


@pytest.mark.parametrize("form", ["ordinary", "correlation"])
def test_left_vectors_are_orthonormal_and_singular_values_fall(form):
    U, Y, Z = random_matrices(np.random.default_rng(1), 4, 5, 8, 60)
    projection = project(U, Y, Z, form, TOLERANCE, 2)
    np.testing.assert_allclose(projection.observability.T @ projection.observability, np.eye(5), atol=1e-14)
    assert np.all(np.diff(projection.singular_values) <= 0)
    assert projection.singular_values[-1] >= 0


@pytest.mark.parametrize("form", ["ordinary", "correlation"])
def test_singular_values_do_not_grow_with_the_record(form):
    values = []
    for columns in (10_000, 40_000):
        U, Y, Z = random_matrices(np.random.default_rng(3), 2, 3, 8, columns)
        values.append(project(U + Z[5:7], Y + Z[:3], Z, form, TOLERANCE, 1).singular_values)
    np.testing.assert_allclose(values[1], values[0], rtol=0.05)


def test_singular_values_of_the_ordinary_form_are_standard_deviations():
    U, Y, Z = random_matrices(np.random.default_rng(3), 2, 3, 0, 20_000)
    np.testing.assert_allclose(project(U, 2.0 * Y, Z, "ordinary", TOLERANCE, 1).singular_values, 2.0, rtol=0.03)


@pytest.mark.parametrize("form", ["ordinary", "correlation"])
def test_a_constant_offset_does_not_matter(form):
    matrices = random_matrices(np.random.default_rng(4), 4, 5, 8, 60)
    plain = project(*matrices, form, TOLERANCE, 2)
    offset = project(*(X + 10.0 * (k + 1) for k, X in enumerate(matrices)), form, TOLERANCE, 2)
    np.testing.assert_allclose(multiply(offset), multiply(plain), rtol=1e-10, atol=1e-12)
    assert (offset.input_rank, offset.instrument_rank) == (plain.input_rank, plain.instrument_rank)


# --- the rank policy

ROWS, COLUMNS = 6, 200


def build_hankels(u, y, past=ROWS):
    U, Y = (block_hankel(x, ROWS, ROWS, COLUMNS) for x in (u, y))
    return U, Y, block_hankel(u, ROWS - past, past, COLUMNS)


@pytest.mark.parametrize(
    "instruments", ["none", "ordinary", "correlation"], ids=["ordinary-without", "ordinary-with", "correlation"]
)
@pytest.mark.parametrize("kind", ["duplicated", "scaled", "shifted", "combined"])
def test_dependent_rows_count_once(instruments, kind):
    u, y = simulate_data()
    U, Y, Z = build_hankels(u, y)
    if instruments == "none":
        Z = Z[:0]
    elif instruments == "correlation":
        Z = np.vstack([Z, np.random.default_rng(9).standard_normal((12, COLUMNS))])  # enough rows for all of U
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
    assert (projection.condition > 1e5) == counts


def test_rank_of_inputs_and_instruments():
    rng = np.random.default_rng(7)
    columns = 80
    U = rng.standard_normal((7, 3)) @ rng.standard_normal((3, columns))
    fresh = rng.standard_normal((4, columns))
    Z = np.vstack([U[:2], fresh, fresh[:2] - fresh[2:]])
    Y = rng.standard_normal((5, columns))
    projection = project(U, Y, Z, "ordinary", TOLERANCE, 4)
    # Instruments that repeat future inputs add no directions.
    assert (projection.input_rank, projection.instrument_rank) == (3, 4)
    projection = project(U[:3], Y, Z, "correlation", TOLERANCE, 2)
    assert (projection.input_rank, projection.instrument_rank) == (3, 6)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_instruments_inside_the_inputs_are_refused_whatever_their_size(scale):
    U, Y, _ = random_matrices(np.random.default_rng(8), 6, 4, 0, 60)
    message = "the instruments have rank 0 beside the future inputs, but order 2 needs at least 2: use more"
    with pytest.raises(DataError, match=message):
        project(U, Y, scale * U[:3], "ordinary", TOLERANCE, 2)


# --- errors


@pytest.mark.parametrize("order", [1, 3])
def test_the_error_states_the_rows_that_the_correlation_form_needs(order):
    U, Y, Z = random_matrices(np.random.default_rng(9), 6, 4, 6 + order, 60)
    project(U, Y, Z, "correlation", TOLERANCE, order)
    message = rf"has {5 + order} rows of instruments, but needs at least {6 + order} \(.*Raise instrument_rows"
    with pytest.raises(DataError, match=message):
        project(U, Y, Z[1:], "correlation", TOLERANCE, order)


@settings(deadline=None, max_examples=100)
@given(size=st.integers(2, 30), rank=st.integers(1, 30), spread=st.floats(0.0, 8.0), seed=st.integers(0, 2**32 - 1))
def test_directions_that_count_are_those_of_the_singular_vectors(size, rank, spread, seed):
    rank = min(rank, size)
    rng = np.random.default_rng(seed)
    left, right = (np.linalg.qr(rng.standard_normal((size, size)))[0] for _ in range(2))
    values = np.concatenate([10.0 ** -np.linspace(0.0, spread, rank), np.full(size - rank, 1e-15)])
    matrix = left * values @ right
    directions = _find_directions(matrix, matrix, 1e-12)
    assert directions.shape == (size, rank)
    np.testing.assert_allclose(directions.T @ directions, np.eye(rank), atol=1e-13)
    np.testing.assert_allclose(directions @ directions.T, left[:, :rank] @ left[:, :rank].T, atol=1e-4)
    np.testing.assert_allclose(directions @ (directions.T @ matrix), matrix, atol=1e-13)
