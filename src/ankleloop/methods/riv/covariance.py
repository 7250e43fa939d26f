"""Covariance of the parameters of `riv`, and contributions of times to its equations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.fft import dct

from ankleloop.joint.apparatus import Apparatus
from ankleloop.joint.regressors import MOTION
from ankleloop.methods.riv.equations import Point
from ankleloop.signals.least_squares import solve_scaled

SCORE_CORRELATION = 1.0  # s: over this the products of residual and instruments may be correlated
DRIFT_COSINES = 2  # those that a drift within the record would fill
FEWEST_COSINES = 8  # of a short record
GRADIENT_STEP = 0.1  # of a standard deviation of a coefficient, for the slopes of G and threshold


def robust_covariance(point: Point, free: np.ndarray) -> tuple[np.ndarray, int]:
    r"""Covariance of the parameters about those of an infinitely long record, whatever the residual is.

    The solution scatters as :math:`H^{-1} \sum_t s(t)`, H being the slope of the equations with that of weights and
    instruments, and s(t) the contribution of a time to their left side, see `time_scores`. A residual that depends on
    the movement correlates these contributions over time. Their spectrum at low frequencies is the variance of their
    sum: the mean of the squares of their first cosine transforms is it, from as many as there are segments of one
    second in the record (Müller, Journal of Econometrics 141(2), 1331-1352, 2007; Lazarus, Lewis, Stock and Watson,
    Journal of Business & Economic Statistics 36(4), 541-559, 2018). The estimate has as many degrees of freedom. The
    first two cosines are left out: they hold what drifts over the record, which the same record, repeated, would do
    again.

    Shapes: returns covariance (free, free).
    """
    band = point.equations.band
    segments = round(band.samples / band.rate / SCORE_CORRELATION)
    freedom = max(segments - DRIFT_COSINES, FEWEST_COSINES)
    first = 1 + DRIFT_COSINES  # the zeroth one is the mean
    transforms = dct(time_scores(point)[free], norm="ortho", axis=1)
    cosines = transforms[:, first : first + freedom]
    influence = solve_scaled(point.slope[np.ix_(free, free)], cosines)
    independent = 2.0 * point.noise.size / band.correlation
    factor = band.samples / freedom * independent / (independent - free.size)
    # Weights follow the residual whose scatter is computed here.
    factor *= 1.0 + point.equations.smoothing_variance
    return factor * influence @ influence.T, freedom


def apparatus_covariance(point: Point, free: np.ndarray, apparatus: Apparatus) -> np.ndarray:
    """Covariance of the solution that an apparatus makes which is subtracted of the torque.

    Its errors are those of known torques, and move the solution as such torques would.

    Shapes: returns (free, free).
    """
    equations = point.equations
    columns = equations.select_recorded(equations.band.transform(equations.apparatus_inputs))
    products = np.real(point.weighted[free] @ columns.T)
    influence = solve_scaled(point.normal[np.ix_(free, free)], products)
    return influence @ apparatus.scatter @ influence.T


def time_scores(point: Point) -> np.ndarray:
    """Contributions of each time to the left side of the equations, shape (unknowns, samples).

    A sum over frequencies of two spectra is a sum over time of their signals: the weighted residual, and instruments
    with the same weights. Where the weights are an estimate from the residual, and residual and instruments are
    correlated at single frequencies though not on the whole, the squares of the residual contribute as well.
    """
    equations = point.equations
    band = equations.band
    root = np.sqrt(point.level)
    scores = band.contributions(point.instruments / root, point.residual / root)
    if equations.weighting == "noise":
        products = np.real(point.weighted * point.residual) / point.level
        filtered = equations.smooth_rows(products) * point.residual
        scores -= band.contributions(filtered, point.residual)
    return scores


def parameter_rows(point: Point, covariance: np.ndarray, free: np.ndarray) -> dict[str, np.ndarray]:
    """Slopes of the physical parameters, or of their logarithms, by the free unknowns; those of G by differences.

    Shapes: covariance (free, free), by which steps are as long as the unknowns are uncertain; returns (free,).
    """
    path = point.reflex_path
    coefficients = slice(MOTION, point.parameters.linear.size)
    ramp = np.array(path.rectifier[:2])
    deviations = np.sqrt(np.diag(covariance))
    units = np.eye(free.size)
    rows = dict(zip(np.array(point.names)[free].tolist(), units, strict=True))
    slopes = np.zeros((2, free.size))
    for number in range(coefficients.start, coefficients.stop):
        step = GRADIENT_STEP * deviations[number] * units[number]
        shifted = replace(path, coefficients=path.coefficients + step[coefficients])
        slopes[:, number] = (np.array(shifted.rectifier[:2]) - ramp) / step.sum()
    return {**rows, "G": slopes[0], "threshold": slopes[1]}
