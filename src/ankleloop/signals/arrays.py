"""Arrays of real numbers from what a caller passes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ankleloop.arguments import show_value
from ankleloop.errors import DataError

__all__ = ["as_real"]


def as_real(values: ArrayLike, name: str) -> np.ndarray:
    """Real numbers as an array of floats, without a copy where they are one.

    Parameters
    ----------
    values : array_like
        Integers or floating-point numbers.
    name : str
        Signal, for the message.

    Returns
    -------
    ndarray
        Shape of `values`.

    Raises
    ------
    DataError
        For texts, flags, complex numbers, objects, and lists of different lengths.

    Examples
    --------
    >>> as_real([1, 2], "measured signal")
    array([1., 2.])
    >>> as_real("no", "measured signal")
    Traceback (most recent call last):
      ...
    ankleloop.errors.DataError: the measured signal must be an array of real numbers, got 'no'.
    """
    try:
        array = np.asarray(values)
    except (TypeError, ValueError):  # lists of different lengths
        array = np.array(None)
    if array.dtype.kind not in "iuf":
        raise DataError(f"the {name} must be an array of real numbers, got {show_value(values)}.")
    return array.astype(float, copy=False)
