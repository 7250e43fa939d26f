"""Covariances and intervals of parameters, some of which have normally distributed logarithms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import exp, inf, sqrt
from typing import Any

import numpy as np
from scipy import special

LOGARITHMIC = ("omega_n", "zeta", "pole")  # parameters whose logarithms are normally distributed
WIDEST_INTERVAL = 50.0  # of such a logarithm


@dataclass(frozen=True)
class Uncertainty:
    """How uncertain parameters are."""

    covariance: Mapping[str, Mapping[str, float]] = field(default_factory=dict)  # by their names
    freedom: float = inf  # degrees of freedom of the covariance

    @classmethod
    def of(
        cls,
        values: Mapping[str, float],
        rows: Mapping[str, np.ndarray],
        covariance: np.ndarray,
        freedom: float = inf,
    ) -> Uncertainty:
        """That of parameters whose slopes, or those of their logarithms, by some unknowns are known.

        Shapes: rows (unknowns,), covariance (unknowns, unknowns).
        """
        names = [name for name in values if name in rows]
        scales = [values[name] if name in LOGARITHMIC else 1.0 for name in names]
        slopes = np.array([scale * rows[name] for scale, name in zip(scales, names, strict=True)])
        products = (slopes @ covariance @ slopes.T).tolist()
        table = {
            name: dict(zip(names, row, strict=True))
            for name, row in zip(names, products, strict=True)
        }
        return cls(table, float(freedom))

    @property
    def standard_errors(self) -> dict[str, float]:
        """Standard errors of the parameters."""
        return {name: sqrt(row[name]) for name, row in self.covariance.items()}

    @property
    def diagnostics(self) -> dict[str, Any]:
        """Entries of the diagnostics of an estimate."""
        return {
            "covariance": self.covariance,
            "standard_errors": self.standard_errors,
            "freedom": self.freedom,
        }

    def intervals(
        self, values: Mapping[str, float], level: float = 0.95
    ) -> dict[str, tuple[float, float]]:
        """Intervals of the parameters, by Student's distribution; the normal one for infinite freedom."""
        quantile = float(special.stdtrit(self.freedom, 0.5 * (1.0 + level)))
        intervals = {}
        for name, error in self.standard_errors.items():
            value = values[name]
            margin = quantile * error
            if name in LOGARITHMIC:
                ratio = exp(min(margin / value, WIDEST_INTERVAL))
                intervals[name] = (value / ratio, value * ratio)
            else:
                intervals[name] = (value - margin, value + margin)
        return intervals


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
