"""Standard errors, intervals and covariances of parameters, some of which have normally distributed logarithms."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from scipy import special

LOGARITHMIC = ("omega_n", "zeta", "pole")  # parameters whose logarithms are normally distributed
WIDEST_INTERVAL = 50.0  # of such a logarithm


def find_quantile(level: float, freedom: float) -> float:
    """Half of an interval over the standard error, by Student's distribution; the normal one for infinite freedom."""
    probability = 0.5 * (1.0 + level)
    if np.isinf(freedom):
        return float(special.ndtri(probability))
    return float(special.stdtrit(freedom, probability))


def compute_intervals(
    values: Mapping[str, float], errors: Mapping[str, float], quantile: float
) -> dict[str, tuple[float, float]]:
    """Intervals of the parameters that have standard errors."""
    intervals = {}
    for name, error in errors.items():
        value = values[name]
        margin = quantile * error
        if name in LOGARITHMIC:
            ratio = float(np.exp(min(margin / value, WIDEST_INTERVAL)))
            intervals[name] = (value / ratio, value * ratio)
        else:
            intervals[name] = (value - margin, value + margin)
    return intervals


def tabulate_covariance(
    values: Mapping[str, float], rows: Mapping[str, np.ndarray], covariance: np.ndarray
) -> pd.DataFrame:
    """Covariance of parameters whose slopes, or those of their logarithms, by some unknowns are known.

    Shapes: rows (unknowns,), covariance (unknowns, unknowns).
    """
    names = [name for name in values if name in rows]
    scales = [values[name] if name in LOGARITHMIC else 1.0 for name in names]
    slopes = np.array([scale * rows[name] for scale, name in zip(scales, names, strict=True)])
    return pd.DataFrame(slopes @ covariance @ slopes.T, index=names, columns=names)


def standard_errors(covariance: pd.DataFrame) -> dict[str, float]:
    """Standard errors of the parameters of a covariance."""
    errors = np.sqrt(np.diag(covariance.to_numpy(dtype=float)))
    return dict(zip(covariance.index, errors.tolist(), strict=True))


def extend_intervals(
    intervals: Mapping[str, tuple[float, float]],
    values: Mapping[str, float],
    shifts: Mapping[str, float],
) -> dict[str, tuple[float, float]]:
    """Intervals that hold the values after relative shifts as well."""
    extended = dict(intervals)
    for name, shift in shifts.items():
        if name in intervals:
            ends = (*intervals[name], values[name] * (1.0 + shift))
            extended[name] = (min(ends), max(ends))
    return extended
