"""Inner products of Hankel rows without the Hankel matrix, in constant memory however long the record is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np
from numba import njit

from ankleloop.errors import DataError
from ankleloop.kernels import kernel

__all__ = ["HankelGram", "HankelProducts"]

CHUNK = 256  # columns: sums of sums round less than one long sum


class HankelProducts(ABC):
    """Products of the samples of one record with those of its first block row, and its ends, accumulated over chunks.

    Parameters
    ----------
    block_rows : int
        Block rows of the Hankel matrix, which begins with the first sample.
    lags : sequence of int, optional
        For each channel, up to how many block rows later its products with other rows are computed: fewer take less
        time. All `block_rows` by default.
    """

    def __init__(self, block_rows: int, lags: Sequence[int] | np.ndarray | None = None) -> None:
        self.block_rows = block_rows
        self.lags = lags
        self.columns = 0
        self._head: np.ndarray | None = None
        self._tail: np.ndarray | None = None

    def add(self, chunk: np.ndarray) -> None:
        """Add the next samples of the record.

        Shapes: chunk (N, channels).
        """
        x = chunk if self._tail is None else np.concatenate([self._tail, chunk])
        columns = x.shape[0] - self.block_rows + 1
        if columns < 1:
            self._tail = x.copy()
            return
        if self._head is None:
            self._head = x[: self.block_rows - 1].copy()
        lags = np.full(x.shape[1], self.block_rows) if self.lags is None else np.asarray(self.lags)
        self._accumulate(np.ascontiguousarray(x), columns, lags)
        self._tail = x[columns:].copy()
        self.columns += columns

    @abstractmethod
    def _accumulate(self, x: np.ndarray, columns: int, lags: np.ndarray) -> None:
        """Add some columns to the products with the first block row, and to its sums."""

    def _edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Samples that leave and enter the window from one block row to the next."""
        if self._head is None or self._tail is None:
            raise DataError(f"the record is shorter than the {self.block_rows} samples of one Hankel column.")
        return self._head, self._tail


class HankelGram(HankelProducts):
    r"""Gram matrix H Hᵀ of a block-Hankel matrix, each row less its mean, accumulated over the chunks of one record.

    Rows of a Hankel matrix are shifts of one signal. So the products of each pair of block rows follow from those of
    the pair before, by the samples that enter and leave the window of n columns,

    .. math:: G_{i+1,j+1} = G_{i,j} + w(i+n)\, w(j+n)^T - w(i)\, w(j)^T,

    and only the products with the first block row take sums over the record (Mastronardi, Kressner, Sima, Van Dooren
    and Van Huffel, "A fast algorithm for subspace state-space system identification via exploitation of the
    displacement structure", J. Comput. Appl. Math. 132, 71-81, 2001).

    Parameters
    ----------
    block_rows, lags
        As `HankelProducts` takes them.
    """

    def __init__(self, block_rows: int, lags: Sequence[int] | np.ndarray | None = None) -> None:
        super().__init__(block_rows, lags)
        self._products: np.ndarray | float = 0.0
        self._sums: np.ndarray | float = 0.0

    def _accumulate(self, x: np.ndarray, columns: int, lags: np.ndarray) -> None:
        self._products = self._products + _sum_lagged_products(x, columns, self.block_rows, lags)
        self._sums = self._sums + np.ones(columns) @ x[:columns]

    def matrix(self, rows: np.ndarray | None = None) -> np.ndarray:
        """The Gram matrix of the samples added so far.

        Shapes: returns (rows, rows).
        """
        head, tail = self._edges()
        shifts = np.vstack([np.zeros(head.shape[1]), tail - head])
        means = (self._sums + np.cumsum(shifts, axis=0)).ravel() / np.sqrt(self.columns)
        rows = np.arange(means.size) if rows is None else rows
        order = np.argsort(rows)
        ascending = rows[order]
        if np.any(ascending[1:] == ascending[:-1]):
            unique, places = np.unique(rows, return_inverse=True)
            return self.matrix(unique)[np.ix_(places, places)]
        places = order.astype(np.uint64)
        return _displace_products(
            self._products, head.ravel(), tail.ravel(), means, ascending.astype(np.uint64), places
        )


# Contraction lets the compiler use fused multiply-adds; sums are not reordered.
@njit(fastmath={"contract"})
def _add_columns(flat, start, stop, lags, part):
    """Add the products of some columns, one column at a time."""
    channels = len(part)
    for at in range(start * channels, stop * channels, channels):
        for i in range(channels):
            for k in range(lags[i] * channels):
                part[i, k] += flat[at + i] * flat[at + k]


@kernel(fastmath={"contract"})
def _sum_lagged_products(x, columns, block_rows, lags):
    """Products with the first block row: sums over t of x(t) times x(t) … x(t + block_rows - 1).

    Samples follow each other in memory, so those of all lags are one row of numbers. Taking four columns at a time, the
    sums are loaded and stored a fourth as often; taking two channels at a time, samples are loaded half as often.
    """
    channels = x.shape[1]
    flat, width = x.ravel(), block_rows * channels
    sums, part = np.zeros((channels, width)), np.zeros((channels, width))
    for start in range(0, columns, CHUNK):
        stop = min(start + CHUNK, columns)
        whole = stop - (stop - start) % 4
        part[:] = 0.0
        for t in range(start, whole, 4):
            at, last = t * channels, (t + 3) * channels
            x0, x1 = flat[at : at + width], flat[at + channels : at + channels + width]
            x2, x3 = flat[last - channels : last - channels + width], flat[last : last + width]
            i = 0
            while i < channels:
                a0, a1, a2, a3 = x0[i], x1[i], x2[i], x3[i]
                row = part[i]
                if i + 1 == channels or lags[i] != lags[i + 1]:
                    for k in range(lags[i] * channels):
                        row[k] += a0 * x0[k] + a1 * x1[k] + a2 * x2[k] + a3 * x3[k]
                    i += 1
                    continue
                b0, b1, b2, b3 = x0[i + 1], x1[i + 1], x2[i + 1], x3[i + 1]
                other = part[i + 1]
                for k in range(lags[i] * channels):
                    p, q, r, s = x0[k], x1[k], x2[k], x3[k]
                    row[k] += a0 * p + a1 * q + a2 * r + a3 * s
                    other[k] += b0 * p + b1 * q + b2 * r + b3 * s
                i += 2
        _add_columns(flat, whole, stop, lags, part)
        sums += part
    for i in range(channels):
        sums[i, lags[i] * channels :] = np.nan
    return sums


@kernel()
def _displace_products(products, head, tail, means, rows, places):
    """Rows of the Gram matrix one after the other: each follows from that of the block row before by displacement.

    The rows to take come in ascending order, each once, with their places in the result; both unsigned, because
    unsigned indices need no check for negative ones.
    """
    channels, width = products.shape
    size, count = rows.size, 0
    last_rows, row = products.copy(), np.empty(width)
    gram = np.empty((size, size))
    for i in range(width):
        last_row = last_rows[i % channels]
        if i >= channels:
            before, after = head[i - channels], tail[i - channels]
            for j in range(i - channels, width - channels):
                row[j + channels] = last_row[j] + after * tail[j] - before * head[j]
            last_row[i:] = row[i:]
        if count == size or rows[count] != i:
            continue
        for k in range(count, size):
            value = last_row[rows[k]] - means[i] * means[rows[k]]
            gram[places[count], places[k]] = value
            gram[places[k], places[count]] = value
        count += 1
    return gram
