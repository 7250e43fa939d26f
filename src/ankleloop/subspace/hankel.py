"""Block Hankel matrices (Eq. 15): their Gram matrix by displacement, and their columns some at a time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from ankleloop.errors import DataError
from ankleloop.kernels import as_samples, kernel
from ankleloop.options import check_integer

COLUMNS_AT_ONCE = 2048
PRODUCTS_OF_A_SUM = 256  # sums of sums round less than one long sum


def block_hankel(x: ArrayLike, first: int, rows: int, columns: int) -> np.ndarray:
    r"""Block Hankel matrix of a signal.

    .. math:: R_{i,j,n} = \begin{bmatrix} r(i) & \cdots & r(i+n-1) \\ \vdots & & \vdots \\
              r(i+j-1) & \cdots & r(i+j+n-2) \end{bmatrix}

    Equation 15 of Zhao, Ludvig and Kearney (ACC 2008), with i = `first`, j = `rows`, n = `columns`.

    Parameters
    ----------
    x : array_like, shape (N,) or (N, m)
        The signal; each sample gives one block row of m entries.
    first : int
        Sample in the upper left corner.
    rows, columns : int
        Block rows and columns.

    Returns
    -------
    ndarray, shape (rows * m, columns)

    Raises
    ------
    DataError
        If the signal is too short, or the numbers of rows and columns are not positive.

    Examples
    --------
    >>> block_hankel([0, 1, 2, 3, 4], first=1, rows=2, columns=3)
    array([[1., 2., 3.],
           [2., 3., 4.]])
    """
    block_rows = check_integer("block_hankel", "rows", rows)
    columns = check_integer("block_hankel", "columns", columns)
    first = check_integer("block_hankel", "first", first)
    signal = np.column_stack([np.asarray(x, dtype=float)])
    stop = first + block_rows + columns - 1
    if min(block_rows, columns) < 1 or first < 0 or stop > len(signal):
        raise DataError(
            f"a signal of {len(signal)} samples has no Hankel matrix of {block_rows} block rows and {columns} columns "
            f"from sample {first}: use a longer record or fewer block rows."
        )
    samples = signal[first:stop].ravel()
    channels = signal.shape[1]
    windows = np.lib.stride_tricks.sliding_window_view(samples, block_rows * channels)
    # Column-major, so that its transpose goes into least squares without a copy.
    return windows[::channels].copy().T


def generate_columns(x: np.ndarray, window: int) -> Iterator[np.ndarray]:
    """Hankel matrix of a record, some columns at a time.

    Shapes: x (N, m); returns (window * m, columns).
    """
    count = len(x) - window + 1
    for start in range(0, count, COLUMNS_AT_ONCE):
        yield block_hankel(x, start, window, min(COLUMNS_AT_ONCE, count - start))


def hankel_gram(
    x: np.ndarray, window: int, lags: np.ndarray | None = None, *, subtract_means: bool = True
) -> np.ndarray:
    r"""Gram matrix H Hᵀ of the Hankel matrix of a record, each row less its mean.

    Rows of a Hankel matrix are shifts of one signal. So the products of each pair of block rows follow from those of
    the pair before, by the samples that enter and leave the window of n columns,

    .. math:: G_{i+1,j+1} = G_{i,j} + w(i+n)\, w(j+n)^T - w(i)\, w(j)^T,

    and only the products with the first block row take sums over the record (Mastronardi, Kressner, Sima, Van Dooren
    and Van Huffel, "A fast algorithm for subspace state-space system identification via exploitation of the
    displacement structure", J. Comput. Appl. Math. 132, 71-81, 2001). A record without a single column has products of
    zero. `lags` says for each channel up to how many block rows later its products are needed; the rest is no product.

    Shapes: x (N, m), lags (m,); returns (window * m, window * m).
    """
    columns = len(x) - window + 1
    means = np.zeros(window * x.shape[1])
    if columns < 1:
        return np.outer(means, means)
    if lags is None:
        lags = np.full(x.shape[1], window)
    products = _sum_lagged_products(as_samples(x), columns, lags, window)
    head = x[: window - 1]
    tail = x[columns:]
    if subtract_means:
        sums = np.einsum("tc->c", x[:columns])
        later_sums = sums + np.cumsum(tail - head, axis=0)
        means = np.concatenate([sums, later_sums.ravel()]) * (1.0 / np.sqrt(columns))
    return _displace_products(products, head.ravel(), tail.ravel(), means)


# Contraction lets the compiler use fused multiply-adds; sums are not reordered.
@kernel(fastmath={"contract"})
def _sum_lagged_products(x, columns, lags, window):
    """Products with the first block row: sums over t of x(t) times x(t) … x(t + lags - 1).

    Samples follow each other in memory, so those of all lags are one row of numbers.
    """
    channels = x.shape[1]
    flat = x.ravel()
    sums = np.zeros((channels, window * channels))
    for start in range(0, columns, PRODUCTS_OF_A_SUM):
        part = np.zeros_like(sums)
        for t in range(start, min(start + PRODUCTS_OF_A_SUM, columns)):
            samples = flat[t * channels :]
            for i in range(channels):
                for k in range(lags[i] * channels):
                    part[i, k] += samples[i] * samples[k]
        sums += part
    return sums


@kernel()
def _displace_products(products, head, tail, means):
    """Gram matrix less products of means, row by row: each row follows from that of the block row before."""
    channels, width = products.shape
    gram = np.empty((width, width))
    for i in range(channels):
        for j in range(width):
            gram[i, j] = gram[j, i] = products[i, j] - means[i] * means[j]
    for i in range(channels, width):
        k = i - channels  # one block row before, as m is
        for m in range(width - channels):
            value = gram[k, m] + means[k] * means[m] + tail[k] * tail[m] - head[k] * head[m]
            gram[i, m + channels] = value - means[i] * means[m + channels]
    return gram
