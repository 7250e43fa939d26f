"""Arrays of real numbers from what a caller passes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ankleloop.errors import DataError
from ankleloop.options import show_value


def as_real(values: ArrayLike, name: str) -> np.ndarray:
    """Real numbers as an array of floats, without a copy where they are one."""
    try:
        array = np.asarray(values)
    except (TypeError, ValueError):  # lists of different lengths
        array = np.array(None)
    if array.dtype.kind not in "iuf":
        raise DataError(f"the {name} must be an array of real numbers, got {show_value(values)}.")
    return array.astype(float, copy=False)
