"""Triangular factor of Hankel rows without the Hankel matrix, as accurate as by a QR factorisation of it.

The factor of a QR factorisation is the Cholesky factor of the inner products. Squaring costs half of the digits, so
both are computed with twice as many: each number is the sum of two doubles, of which the second one holds what the
first one rounds away (Dekker, "A floating-point technique for extending the available precision", Numer. Math. 18,
224-242, 1971). Products are exact by fused multiply-adds. The displacement structure of the rows makes this several
times faster than Householder reflections of all columns.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit
from scipy.linalg import lapack

from ankleloop.kernels import kernel
from ankleloop.signals.fused import fuse
from ankleloop.subspace.hankel_gram import HankelProducts

__all__ = ["HankelFactor", "combine_factors", "factor_products", "update_factor"]

NEGLIGIBLE = 1e-30  # part of the square of a row beside those before it: rounding of the row itself
LANES = 8  # doubles of the longest vector
CHUNK = 16  # columns: the longer a sum is, the more is rounded of what it rounds away
BLOCK = 16  # columns of a panel: narrow ones leave most of the work to matrix products


class HankelFactor(HankelProducts):
    """Triangular factor R of a block-Hankel matrix H, RᵀR = H Hᵀ, accumulated over the chunks of one record.

    Parameters
    ----------
    block_rows, lags
        As `HankelProducts` takes them.
    subtract_means : bool
        Whether each row is less its mean.
    """

    def __init__(
        self, block_rows: int, lags: Sequence[int] | np.ndarray | None = None, *, subtract_means: bool = True
    ) -> None:
        super().__init__(block_rows, lags)
        self.subtract_means = subtract_means
        self._high: np.ndarray | None = None
        self._low: np.ndarray | None = None

    def _accumulate(self, x: np.ndarray, columns: int, lags: np.ndarray) -> None:
        channels = x.shape[1]
        if self._high is None or self._low is None:  # products with the first block row, and a last row of sums
            self._high, self._low = np.zeros((2, channels + 1, self.block_rows * channels))
        _sum_products(x, columns, lags, self._high, self._low)

    def matrix(self, rows: np.ndarray | None = None, count: int | None = None) -> np.ndarray:
        """The factor of the samples added so far.

        Shapes: returns (count, rows).
        """
        head, tail = self._edges()
        rows = np.arange(head.size + head.shape[1]) if rows is None else rows
        order = np.argsort(rows, kind="stable")
        products = _displace_products(
            self._high,
            self._low,
            head.ravel(),
            tail.ravel(),
            rows[order].astype(np.uint64),
            order.astype(np.uint64),
            self.columns,
        )
        # A constant offset is one more input whose Hankel rows are all alike: a row of ones before all others takes it.
        first = int(not self.subtract_means)
        rest = 1 - first
        count = rows.size if count is None else count
        return factor_products(products[0, first:, first:], products[1, first:, first:], rest + count)[rest:, rest:]


@njit(inline="always")
def _add(a, b):
    """Sum of two doubles, and what it rounds away."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


@njit(inline="always")
def _multiply(a_high, a_low, b_high, b_low):
    """Product of two pairs."""
    high = a_high * b_high
    return high, fuse(a_low, b_high, fuse(a_high, b_low, fuse(a_high, b_high, -high)))


@kernel()
def _sum_products(x, columns, lags, high, low):
    """Products with the first block row: sums over t of x(t) times x(t) … x(t + lags - 1), and sums of x(t)."""
    channels, width = x.shape[1], high.shape[1]
    flat = x.ravel()
    sums, rests = np.empty((channels, width)), np.empty((channels, width))
    # A sum that begins with a number far above all products takes half of the operations to find what it rounds away.
    start = 2.0 ** np.ceil(np.log2(4.0 * CHUNK * np.abs(flat).max() ** 2))
    for first in range(0, columns, CHUNK):
        sums[:], rests[:] = start, 0.0
        for at in range(first * channels, min(first + CHUNK, columns) * channels, channels):
            for i in range(channels):
                a, row, rest = flat[at + i], sums[i], rests[i]
                numbers = flat[at : at + lags[i] * channels]
                for k in range(len(numbers)):
                    product = a * numbers[k]
                    error = fuse(a, numbers[k], -product)
                    total = row[k] + product
                    rest[k] += (product - (total - row[k])) + error
                    row[k] = total
        for i in range(channels):
            for k in range(lags[i] * channels):
                high[i, k], rounding = _add(high[i, k], sums[i, k] - start)
                low[i, k] += rounding + rests[i, k]
    for at in range(0, columns * channels, channels):
        for i in range(channels):
            high[channels, i], rounding = _add(high[channels, i], flat[at + i])
            low[channels, i] += rounding


@kernel()
def _displace_products(high, low, head, tail, rows, places, columns):
    """Gram matrix of a row of ones and of some rows, each from the products of the block row before by displacement.

    The rows come in ascending order, with their places in the result; both unsigned, for speed. Only its upper triangle
    is computed, in two parts that add up to it.
    """
    channels, width = len(high) - 1, high.shape[1]
    size, count = rows.size, 0
    last_high, last_low = high.copy(), low.copy()
    row, rest = np.empty(width), np.empty(width)
    sums_high, sums_low = high[channels].copy(), low[channels].copy()
    gram = np.zeros((2, size + 1, size + 1))
    gram[0, 0, 0] = columns
    for i in range(width):
        last_row, last_rest = last_high[i % channels], last_low[i % channels]
        if i >= channels:
            k = i - channels
            before, after = -head[k], tail[k]
            for j in range(np.uint64(k), np.uint64(width - channels)):
                p, p_error = _multiply(after, 0.0, tail[j], 0.0)
                q, q_error = _multiply(before, 0.0, head[j], 0.0)
                total, p_rounding = _add(last_row[j], p)
                total, q_rounding = _add(total, q)
                row[j], rest[j] = _add(total, last_rest[j] + (p_error + q_error + p_rounding + q_rounding))
            last_row[i:], last_rest[i:] = row[k : width - channels], rest[k : width - channels]
            total, rounding = _add(sums_high[k], after)
            total, more = _add(total, before)
            sums_high[i], sums_low[i] = _add(total, sums_low[k] + rounding + more)
        while count < size and rows[count] == i:
            place = places[count] + 1
            gram[0, 0, place], gram[1, 0, place] = sums_high[i], sums_low[i]
            for k in range(count, size):
                first, second = min(place, places[k] + 1), max(place, places[k] + 1)
                gram[0, first, second], gram[1, first, second] = last_row[rows[k]], last_rest[rows[k]]
            count += 1
    return gram


@kernel()
def _subtract_rows(flat, flat_low, factors, target, first, second, count):
    """Add multiples of two rows to a row, all of them pairs, from given places on; vectorised."""
    a, a_low, b, b_low = factors
    target, first, second = np.uint64(target), np.uint64(first), np.uint64(second)
    for step in range(np.uint64(count)):
        k, i, j = target + step, first + step, second + step
        p, p_error = _multiply(a, a_low, flat[i], flat_low[i])
        q, q_error = _multiply(b, b_low, flat[j], flat_low[j])
        total, p_rounding = _add(flat[k], p)
        flat[k], q_rounding = _add(total, q)
        flat_low[k] += (p_error + p_rounding) + (q_error + q_rounding)


@kernel()
def factor_products(high, low, count):
    """Triangular factor R of the sum of two matrices, RᵀR = high + low, by Cholesky's method with twice the digits.

    A row that depends on those before it is left with rounding alone. It is set to zero.

    Shapes: high, low (k, k); returns (count, k).
    """
    n = len(high)
    stride = (n + LANES - 1) // LANES * LANES  # so that every row consists of whole vectors
    factor, rests = np.zeros((count, stride)), np.zeros((count, stride))
    factor[:, :n], rests[:, :n] = high[:count], low[:count]
    flat, flat_low = factor.ravel(), rests.ravel()
    for j in range(count):
        row, rest = factor[j], rests[j]
        limit = NEGLIGIBLE * row[j]
        first = j // LANES * LANES  # entries before the diagonal take part, and are set to zero at the end
        for i in range(0, j, 2):
            second = min(i + 1, j - 1)  # twice the same row where one is left over: then the second one counts zero
            part = 1.0 if second > i else 0.0
            factors = -factor[i, j], -rests[i, j], -part * factor[second, j], -part * rests[second, j]
            _subtract_rows(
                flat, flat_low, factors, j * stride + first, i * stride + first, second * stride + first, stride - first
            )
        pivot, pivot_low = _add(row[j], rest[j])
        if not pivot > limit:
            row[:] = 0.0
            rest[:] = 0.0
            continue
        # One step of Newton's method doubles the digits of the square root, another one those of its inverse.
        root = np.sqrt(pivot)
        root, root_low = _add(root, (fuse(-root, root, pivot) + pivot_low) / (2.0 * root))
        inverse = 1.0 / root
        inverse_low = inverse * (fuse(-inverse, root, 1.0) - inverse * root_low)
        for k in range(j, n):
            p, p_error = _multiply(row[k], rest[k], inverse, inverse_low)
            row[k], rest[k] = _add(p, p_error)
        row[:j] = 0.0
        rest[:j] = 0.0
    return factor[:, :n].copy()


def combine_factors(factors: Sequence[np.ndarray]) -> np.ndarray:
    """Triangular factor of all columns, from those of several records.

    Shapes: factors (k, k); returns (k, k).
    """
    if len(factors) == 1:
        return factors[0]
    combined = np.array(factors[0], order="F")
    for factor in factors[1:]:
        combined = update_factor(combined, np.array(factor, order="F"))
    return combined


def update_factor(factor: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Triangular factor of the rows of a factor and of more rows.

    Shapes: factor (k, k), rows (n, k); returns (k, k).
    """
    return lapack.dtpqrt(0, min(BLOCK, len(factor)), factor, rows, overwrite_a=1, overwrite_b=1)[0]
