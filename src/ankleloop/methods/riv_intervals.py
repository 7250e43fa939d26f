"""Physical parameters of `riv`, their standard errors and intervals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ankleloop.joint.hammerstein import ReflexPath, StaticNonlinearity
from ankleloop.methods.riv_covariance import RivCovariance
from ankleloop.methods.riv_equations import MOTION, RivEquations, RivParameters, RivPoint

__all__ = ["estimate_errors", "estimate_intervals", "parameter_values", "reflex_path"]

LOGARITHMIC = ("omega_n", "zeta", "pole")  # parameters the logarithms of which are normally distributed
WIDEST = 50.0  # of such a logarithm


def reflex_path(equations: RivEquations, parameters: RivParameters) -> ReflexPath:
    """Nonlinearity and dynamics of the reflex."""
    nonlinearity = StaticNonlinearity(equations.regressors.basis, parameters.linear[MOTION:])
    return ReflexPath(nonlinearity, parameters.dynamics)


def parameter_values(equations: RivEquations, parameters: RivParameters) -> dict[str, float]:
    """K, B, I, delay and the parameters of the reflex, by name."""
    values = dict(zip("KBI", map(float, parameters.linear[:MOTION]), strict=True))
    values["delay"] = float(equations.regressors.delay + parameters.shift)
    return values | reflex_path(equations, parameters).parameters


def estimate_errors(point: RivPoint, path: ReflexPath, covariance: RivCovariance, free: np.ndarray) -> dict[str, float]:
    """Standard errors of the physical parameters that are estimated."""
    names = np.array(point.equations.names)[free]
    deviations = dict(zip(names.tolist(), np.sqrt(np.diag(covariance.matrix)).tolist(), strict=True))
    errors = {name: deviations[name] for name in "KBI"}
    linear = slice(MOTION, point.parameters.linear.size)
    errors |= _rectifier_errors(path.nonlinearity, covariance.matrix[linear, linear])
    values = path.dynamics.values
    errors |= {name: values[name] * deviations[name] for name in LOGARITHMIC if name in deviations}
    return errors | {name: deviations[name] for name in ("delay",) if name in deviations}


def estimate_intervals(
    values: Mapping[str, float], errors: Mapping[str, float], quantile: float
) -> dict[str, tuple[float, float]]:
    """Intervals of the parameters that have standard errors."""
    intervals = {}
    for name, error in errors.items():
        value, margin = values[name], quantile * error
        ratio = float(np.exp(min(margin / value, WIDEST))) if name in LOGARITHMIC else 1.0
        intervals[name] = (value / ratio, value * ratio) if name in LOGARITHMIC else (value - margin, value + margin)
    return intervals


def _rectifier_errors(nonlinearity: StaticNonlinearity, covariance: np.ndarray) -> dict[str, float]:
    """Standard errors of gain and threshold, by differences with respect to the coefficients."""
    if nonlinearity.basis.kind == "rectifier":
        return {"G": float(np.sqrt(covariance[0, 0]))}
    values = np.array(nonlinearity.fit_rectifier()[:2])
    steps = 0.1 * np.sqrt(np.diag(covariance))
    slopes = []
    for k, step in enumerate(steps):
        coefficients = nonlinearity.coefficients + step * np.eye(steps.size)[k]
        shifted = replace(nonlinearity, coefficients=coefficients).fit_rectifier()[:2]
        slopes.append((np.array(shifted) - values) / step)
    slope = np.array(slopes)
    errors = np.sqrt(np.diag(slope.T @ covariance @ slope))
    return dict(zip(("G", "threshold"), map(float, errors), strict=True))
