"""Block Hankel matrices (Eq. 15)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ankleloop.arguments import check_integer
from ankleloop.errors import DataError

__all__ = ["block_hankel"]


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
    rows, columns = (check_integer("block_hankel", name, n) for name, n in (("rows", rows), ("columns", columns)))
    first = check_integer("block_hankel", "first", first)
    x = np.asarray(x, dtype=float)
    x = x[:, None] if x.ndim == 1 else x
    if min(rows, columns) < 1 or first < 0 or first + rows + columns - 1 > x.shape[0]:
        raise DataError(
            f"a signal of {x.shape[0]} samples has no Hankel matrix of {rows} block rows and {columns} columns from "
            f"sample {first}: use a longer record or fewer block rows."
        )
    # Column-major, so that its transpose goes into least squares without a copy.
    windows = np.lib.stride_tricks.sliding_window_view(x[first : first + rows + columns - 1], rows, axis=0)
    return windows.transpose(0, 2, 1).reshape(columns, rows * x.shape[1]).T
