"""The projections from inner products of Hankel rows: several times faster than a factor of the rows.

Squaring costs half of the digits. So every step estimates the effect of rounding, and where that could change a rank or
a ten-millionth of the result the answer is None: the projection then has to be made by `ankleloop.subspace.projection`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from ankleloop.subspace.options import ProjectionForm
from ankleloop.subspace.projection import (
    LEAST_TOLERANCE,
    Projection,
    check_instrument_rank,
    check_instrument_rows,
    decompose_residual,
    subtract_fit,
)

__all__ = ["expect_accuracy", "project_gram"]

ROUNDING = 2e-16  # of a Gram matrix, relative to its largest eigenvalue
ACCURACY = 1e-4  # of the outputs less their fit; a bound that adds magnitudes, a hundred times the size of the errors
MARGIN = 10.0  # between a limit and a smallest eigenvalue, for the error of its estimate
WINDOWS = 3  # of the inputs that show their condition
LARGEST_ANGLE = 1e-5  # rad by which rounding may turn the subspace of the order; a bound, many times the error


def expect_accuracy(inputs: np.ndarray, window: int, rank_tolerance: float) -> bool:
    """Whether inner products of the Hankel rows of some inputs may be accurate enough for the ordinary form.

    Where all inputs are in a narrow band, the first windows of their sum show that they are not, in a small part of the
    time of `project_gram`.

    Shapes: inputs (N, m).
    """
    if rank_tolerance**2 >= window * ROUNDING:  # directions below the tolerance do not count, however inaccurate
        return True
    piece = inputs[: WINDOWS * window].sum(axis=1)
    columns = np.lib.stride_tricks.sliding_window_view(piece - piece.mean(), window)
    space = _factor_rows(columns.T @ columns, 0.0)
    return space is not None and space.exceeds(0.0, MARGIN)


def project_gram(
    gram: np.ndarray, sizes: tuple[int, int], columns: int, form: ProjectionForm, rank_tolerance: float, order: int
) -> Projection | None:
    """The same as `ankleloop.subspace.projection.project`, from the inner products of the rows.

    Shapes: gram (k, k).
    """
    m, k = np.cumsum(sizes)
    step = _project_ordinary if form == "ordinary" else _project_correlation
    return step(gram, m, k, columns, rank_tolerance, order)


def _project_ordinary(
    gram: np.ndarray, m: int, k: int, columns: int, rank_tolerance: float, order: int
) -> Projection | None:
    """The ordinary form; rows of the inputs end at m, those of the instruments at k."""
    inputs = _find_row_space(gram[:m, :m], rank_tolerance)
    if inputs is None:
        return None
    products = gram[:m, m:]
    components = inputs.compute_components(products)
    residual = gram[m:, m:] - components.T @ components
    weights = inputs.compute_weights(products, components)
    z = k - m
    if z == 0:
        return _project_outputs(residual, weights, inputs, columns, order)
    instruments = _find_row_space(residual[:z, :z], max(rank_tolerance, LEAST_TOLERANCE), gram[m:k, m:k])
    if instruments is None:
        return None
    check_instrument_rank(instruments.rank, order)
    fit = instruments.compute_components(residual[:z, z:])
    coefficients = instruments.compute_coefficients(fit)
    projection = decompose_residual(fit.T, (inputs.rank, instruments.rank), inputs.condition, columns, "ordinary")
    squares = columns * projection.singular_values**2
    if _bound_error(inputs, weights, coefficients) <= ACCURACY * squares[order - 1]:
        return projection
    if inputs.factor is None:
        return None
    # The coefficients themselves take more time than their bound. An eigenspace turns by the error over the gap between
    # its eigenvalues and the others, at most (Davis and Kahan).
    gap = squares[order - 1] - (squares[order] if order < len(squares) else 0.0)
    error = _bound_error(inputs, inputs.compute_coefficients(components), coefficients)
    return projection if error <= LARGEST_ANGLE * gap else None


def _bound_error(inputs: _RowSpace, weights: np.ndarray, coefficients: np.ndarray) -> float:
    """Effect of rounding on the inner products of the fit by the instruments.

    Shapes: weights (m, z + k), coefficients (z, k).
    """
    z, k = coefficients.shape
    # Sizes of the coefficients of all rows in the fit, and in the outputs less their fit by the inputs.
    fit_size = np.sqrt(np.sum((weights[:, :z] @ coefficients) ** 2) + np.sum(coefficients**2))
    output_size = np.sqrt(np.sum(weights[:, z:] ** 2) + k)
    return float(inputs.rounding * fit_size * (fit_size + 2.0 * output_size))


def _project_outputs(
    residual: np.ndarray, weights: np.ndarray, inputs: _RowSpace, columns: int, order: int
) -> Projection | None:
    """Without instruments: eigenvectors of the inner products of the outputs less their fit by the inputs."""
    values, vectors = np.linalg.eigh(residual)
    error = inputs.rounding * (np.sum(weights**2) + len(residual))
    if not error <= min(ACCURACY * values[-order], values[0]):  # data without noise, where rounding hides the order
        return None
    return Projection(vectors[:, ::-1], np.sqrt(values[::-1] / columns), inputs.rank, 0, inputs.condition)


def _project_correlation(
    gram: np.ndarray, m: int, k: int, columns: int, rank_tolerance: float, order: int
) -> Projection | None:
    """No digits are lost, as this form consists of inner products in any case; only the rank of Z may stay open."""
    check_instrument_rows(k - m, m, order)
    rank = _find_rank(gram[m:k, m:k], max(rank_tolerance, LEAST_TOLERANCE))
    if rank is None:
        return None
    residual, input_rank, condition = subtract_fit(gram[m:k, :m], gram[m:k, k:], rank_tolerance)
    return decompose_residual(residual.T, (input_rank, rank), condition, columns, "correlation")


@dataclass(frozen=True)
class _RowSpace:
    """Directions of some rows that count, from the inner products of the rows.

    Parameters
    ----------
    rank : int
        How many count.
    smallest, largest : float
        Extreme eigenvalues of those that count, or bounds of them.
    factor : ndarray or None
        Cholesky factor, where all count.
    values, vectors : ndarray or None
        Eigenvalues and eigenvectors of all directions, where some do not count.
    """

    rank: int
    smallest: float
    largest: float
    factor: np.ndarray | None
    values: np.ndarray | None = None
    vectors: np.ndarray | None = None

    @property
    def condition(self) -> float:
        """Ratio of the largest to the smallest singular value that counts; where all do, an estimate of it."""
        return float(np.sqrt(self.largest / self.smallest)) if self.rank else np.inf

    @property
    def rounding(self) -> float:
        """Error of inner products along unit directions."""
        return ROUNDING * self.largest

    def exceeds(self, limit: float, margin: float) -> bool:
        """Whether all eigenvalues are above a limit and rounding; the margin allows for the error of the estimate."""
        return self.smallest / margin > max(limit, self.rank * self.rounding)

    def compute_components(self, products: np.ndarray) -> np.ndarray:
        """Components of other rows along unit directions, from their inner products with the rows."""
        if self.values is None or self.vectors is None:
            return lapack.dtrtrs(self.factor, products, lower=1)[0]
        return self._compute_directions(self.values, self.vectors).T @ products

    def compute_coefficients(self, components: np.ndarray) -> np.ndarray:
        """Coefficients of the rows in their fit of other rows, from the components of these."""
        if self.values is None or self.vectors is None:
            return lapack.dtrtrs(self.factor, components, lower=1, trans=1)[0]
        return self._compute_directions(self.values, self.vectors) @ components

    def _compute_directions(self, values: np.ndarray, vectors: np.ndarray) -> np.ndarray:
        """Coefficients of the rows in unit directions."""
        selection = slice(len(values) - self.rank, None)
        return vectors[:, selection] / np.sqrt(values[selection])

    def compute_weights(self, products: np.ndarray, components: np.ndarray) -> np.ndarray:
        """Sizes of the coefficients of other rows on the directions, by which rounding is multiplied; or a bound.

        Rounding turns a direction that counts towards one that does not, by its size over the gap between the two
        eigenvalues. So the directions that do not count are weighted by this distance.
        """
        if self.values is None or self.vectors is None:
            return components / np.sqrt(self.smallest)
        distance = np.where(self.values >= self.smallest, self.values, self.smallest - self.values)
        return (self.vectors.T @ products) / distance[:, None]


def _find_row_space(gram: np.ndarray, rank_tolerance: float, total: np.ndarray | None = None) -> _RowSpace | None:
    """Directions whose eigenvalue is above the squared tolerance times the largest one, of `gram` or of `total`.

    None if rounding leaves open which these are. Eigenvectors are computed only if some direction does not count; if a
    bound of the condition shows that all count, a Cholesky factor is enough and takes a twentieth of the time.
    """
    bound = _bound_eigenvalues(gram if total is None else total)
    limit, rounding = rank_tolerance**2, len(gram) * ROUNDING
    space = _factor_rows(gram, limit * bound)
    if space is not None and space.exceeds(limit * bound, margin=len(gram)):
        return space
    if limit < rounding:  # then all count, or rounding leaves it open: eigenvectors would show no more
        return space if space is not None and space.exceeds(rounding * bound, margin=MARGIN) else None
    values, vectors = np.linalg.eigh(gram)
    largest = values[-1] if total is None else float(np.linalg.eigvalsh(total)[-1])
    rank = _count_directions(values, rank_tolerance, largest)
    if rank is None:
        return None
    return _RowSpace(rank, float(values[-rank]) if rank else np.inf, float(values[-1]), None, values, vectors)


def _find_rank(gram: np.ndarray, rank_tolerance: float) -> int | None:
    """How many directions of rows count; None if rounding leaves it open."""
    limit = rank_tolerance**2 * _bound_eigenvalues(gram)
    space = _factor_rows(gram, limit)
    if space is not None and space.exceeds(limit, margin=len(gram)):
        return len(gram)
    values = np.linalg.eigvalsh(gram)
    return _count_directions(values, rank_tolerance, values[-1])


def _count_directions(values: np.ndarray, rank_tolerance: float, largest: float) -> int | None:
    """How many eigenvalues are above the squared tolerance times the largest one; None if one is so within rounding."""
    limit = rank_tolerance**2 * largest
    if np.any(np.abs(values - limit) < max(10, len(values)) * ROUNDING * largest):
        return None
    return int(np.sum(values > limit))


def _bound_eigenvalues(gram: np.ndarray) -> float:
    """A bound of the largest eigenvalue: not less than it, and at most √n times as much."""
    return np.abs(gram).sum(axis=0).max()


def _factor_rows(gram: np.ndarray, limit: float) -> _RowSpace | None:
    """All directions by a Cholesky factor, with their estimated condition; None where a pivot is not above a limit."""
    factor, info = lapack.dpotrf(gram, lower=1)
    if info or np.min(np.diag(factor)) ** 2 <= limit:  # no eigenvalue is above the smallest pivot
        return None
    norm = _bound_eigenvalues(gram)
    reciprocal, _ = lapack.dpocon(factor, norm, uplo="L")
    return _RowSpace(len(gram), float(reciprocal * norm), float(norm), factor)
