"""Envelopes of long signals, which hold their peaks in few numbers."""

from __future__ import annotations

import numpy as np

from ankleloop.options import check_integer


def envelope(values: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest value in each bin of a signal.

    Every sample lies between the two ends of its bin, so that no peak is lost. A bin also holds the first sample of the
    next one: areas between both ends touch each other, as the line between two samples does.

    Shapes: values (N,); returns low, high (⌈N / width⌉,).
    """
    check_integer("envelope", "width", width, ge=1)
    starts = np.arange(0, values.size, width)
    if not starts.size:
        return values[:0], values[:0]
    low, high = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
    following = values[starts[1:]]
    low[:-1], high[:-1] = np.minimum(low[:-1], following), np.maximum(high[:-1], following)
    return low, high
