"""The projections from inner products of Hankel rows: many times faster than factorising the Hankel matrices.

Squaring costs half of the digits. So every step estimates what rounding does to it, and where that could change a rank
or a ten-millionth of the result the answer is None: `project` is the route then.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from ankleloop.subspace.projection import (
    Projection,
    check_form,
    check_instrument_rank,
    check_instrument_rows,
    decomposed,
    left_over,
)

__all__ = ["project_gram"]

ROUNDING = 2e-16  # of a Gram matrix, over its largest eigenvalue
ACCURACY = 1e-4  # of what is left of the outputs; a bound that adds magnitudes, a hundred times what errors come to


def project_gram(gram, sizes, columns, form, rank_tolerance, order):
    """The projection of `project` from the inner products of the rows.

    Parameters
    ----------
    gram : ndarray, shape (k, k)
        Inner products of the rows of U, Z and Y, each less its mean.
    sizes : tuple of int
        Rows of U and of Z.
    columns : int
        Columns of the Hankel matrices.
    form : {"ordinary", "correlation"}
        Form of the projection.
    rank_tolerance : float
        Singular values below this fraction of the largest one are rounding.
    order : int
        Order to be found.

    Returns
    -------
    Projection or None
        None where squared data are not accurate enough.

    Raises
    ------
    DataError
        If too few instruments are left to see the order.
    """
    check_form(form)
    m, k = np.cumsum(sizes)
    step = _ordinary if form == "ordinary" else _correlation
    return step(gram, m, k, columns, rank_tolerance, order)


def _ordinary(gram, m, k, columns, rank_tolerance, order):
    inputs = _directions(gram[:m, :m], rank_tolerance)
    if inputs is None:
        return None
    others = gram[:m, m:]
    beside = inputs.components(others)
    left = gram[m:, m:] - beside.T @ beside
    z = k - m
    weights = inputs.weights(others, beside)
    if z == 0:
        return _from_outputs(left, weights, inputs, columns, order)
    instruments = _directions(left[:z, :z], max(rank_tolerance, 1e-12), gram[m:k, m:k])
    if instruments is None:
        return None
    check_instrument_rank(instruments.rank, order)
    explained = instruments.components(left[:z, z:])
    fit = instruments.fit(explained)
    # Coefficients of all rows in what is explained, and in the outputs beside the inputs.
    size = np.sqrt(np.sum((weights[:, :z] @ fit) ** 2) + np.sum(fit**2))
    other = np.sqrt(np.sum(weights[:, z:] ** 2) + fit.shape[1])
    error = inputs.rounding * size * (size + 2.0 * other)
    found = decomposed(explained.T, inputs.rank, instruments.rank, inputs.condition, columns, "ordinary")
    return found if error <= ACCURACY * columns * found.singular_values[order - 1] ** 2 else None


def _from_outputs(left, weights, inputs, columns, order):
    """Without instruments: eigenvectors of what the inputs leave of the outputs."""
    values, vectors = np.linalg.eigh(left)
    error = inputs.rounding * (np.sum(weights**2) + len(left))
    if not error <= min(ACCURACY * values[-order], values[0]):  # data without noise: the order would not show
        return None
    return Projection(vectors[:, ::-1], np.sqrt(values[::-1] / columns), inputs.rank, 0, inputs.condition)


def _correlation(gram, m, k, columns, rank_tolerance, order):
    """Nothing is lost: the form consists of inner products in any case."""
    check_instrument_rows(k - m, m, order)
    residual, inputs, condition = left_over(gram[m:k, :m], gram[m:k, k:], rank_tolerance)
    instruments, limit = gram[m:k, m:k], max(rank_tolerance**2, (k - m) * ROUNDING)
    rank = k - m
    if _factored(instruments, limit * _largest(instruments)) is None:
        values = np.linalg.eigvalsh(instruments)
        rank = int(np.sum(values > limit * values[-1]))
    return decomposed(residual.T, inputs, rank, condition, columns, "correlation")


@dataclass(frozen=True)
class _Directions:
    """Eigenvectors that count, or a Cholesky factor where all do; and those that do not, each over its distance."""

    rank: int
    smallest: float
    largest: float
    factor: np.ndarray | None
    values: np.ndarray | None = None
    vectors: np.ndarray | None = None

    @property
    def condition(self):
        """Ratio of the largest to the smallest singular value that counts; where all do, an estimate of it."""
        return float(np.sqrt(self.largest / self.smallest)) if self.rank else np.inf

    @property
    def rounding(self):
        """Error of inner products along unit directions."""
        return ROUNDING * self.largest

    def components(self, products):
        """Components of other rows along unit directions, from their inner products with the rows."""
        if self.vectors is None:
            return lapack.dtrtrs(self.factor, products, lower=1)[0]
        kept = slice(len(self.values) - self.rank, None)
        return (self.vectors[:, kept] / np.sqrt(self.values[kept])).T @ products

    def fit(self, components):
        """Coefficients of the rows in what they explain of others, from the components of these."""
        if self.vectors is None:
            return lapack.dtrtrs(self.factor, components, lower=1, trans=1)[0]
        kept = slice(len(self.values) - self.rank, None)
        return (self.vectors[:, kept] / np.sqrt(self.values[kept])) @ components

    def weights(self, products, components):
        """Sizes of the coefficients of other rows on the directions, which rounding goes with; or a bound of them.

        Rounding turns a direction that counts towards one that does not, by its size over the gap between the two, so
        those are weighed by their distance.
        """
        if self.vectors is None:
            return components / np.sqrt(self.smallest)
        distance = np.where(self.values >= self.smallest, self.values, self.smallest - self.values)
        return (self.vectors.T @ products) / distance[:, None]


def _directions(gram, rank_tolerance, whole=None):
    """Directions whose eigenvalue is above the squared tolerance times the largest one, or that of a whole of it.

    None if rounding leaves open which. Eigenvectors are made where a direction does not count; where all do, by a bound
    of the condition, a Cholesky factor is enough and takes a twentieth of the time.
    """
    found = _factored(gram, rank_tolerance**2 * _largest(gram if whole is None else whole))
    if found is not None:
        return found
    values, vectors = np.linalg.eigh(gram)
    largest = values[-1] if whole is None else float(np.linalg.eigvalsh(whole)[-1])
    limit = rank_tolerance**2 * largest
    if np.any(np.abs(values - limit) < 10 * ROUNDING * largest):
        return None
    rank = int(np.sum(values > limit))
    return _Directions(rank, float(values[-rank]) if rank else np.inf, float(values[-1]), None, values, vectors)


def _largest(gram):
    """A bound of the largest eigenvalue: not less than it, and at most √n times as much."""
    return np.abs(gram).sum(axis=0).max()


def _factored(gram, limit):
    """All directions by a Cholesky factor, if its estimated condition says that every eigenvalue is above a limit."""
    factor, failed = lapack.dpotrf(gram, lower=1)
    if failed or np.min(np.diag(factor)) ** 2 <= limit:  # no eigenvalue is above the smallest pivot
        return None
    norm = _largest(gram)
    reciprocal, _ = lapack.dpocon(factor, norm, uplo="L")
    smallest = reciprocal * norm
    if smallest / len(gram) <= max(limit, len(gram) * ROUNDING * norm):
        return None
    return _Directions(len(gram), float(smallest), float(norm), factor)
