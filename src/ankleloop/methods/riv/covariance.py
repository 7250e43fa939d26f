"""Covariance and intervals of the parameters of `riv`: asymptotic, or robust where the model is incomplete."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy import special
from scipy.fft import dct

from ankleloop.joint.regressors import MOTION
from ankleloop.methods.riv.equations import NOISE_RESOLUTION, Point, solve_scaled
from ankleloop.signals.vaf import TWO_SIDED

SEGMENT = 1.0  # s: over this the products of residual and instruments may be correlated
SLOWEST = 2  # cosines that a drift within the record would fill
FEWEST = 8  # cosines of a short record
LAGS = 0.5  # s
WHITENING = 1.0  # Hz
LEVEL = 0.01
LOGARITHMIC = ("omega_n", "zeta", "pole")  # parameters whose logarithms are normally distributed
WIDEST = 50.0  # of such a logarithm


def choose_covariance(point: Point, free: np.ndarray, kind: str | None) -> tuple[np.ndarray, float, dict[str, Any]]:
    """Covariance of a kind, half of a 95 % interval over its standard error, and how it was computed, as diagnostics.

    By default it is the robust one if the residual depends on the movement.
    """
    p = movement_p(point)
    if kind == "asymptotic" or (kind is None and p >= LEVEL):
        return asymptotic_covariance(point, free), TWO_SIDED, {"intervals": "asymptotic", "movement_p": p}
    matrix, freedom = robust_covariance(point, free)
    segment = point.equations.band.samples / point.equations.band.rate / freedom
    description = {"intervals": "robust", "movement_p": p, "interval_segment": segment}
    return matrix, float(special.stdtrit(freedom, 0.975)), description


def movement_p(point: Point) -> float:
    """Probability of correlations of residual and movement at least as large, if the model were complete.

    The movement is what the instruments are made of: the predicted position, and the predicted drive of the reflex. In
    closed loop it does not depend on the noise, so that only a model that lacks something correlates the two.
    All are whitened. Lags within half a second are 1/(2b) apart in a band of width b; there the correlations of white
    signals are independent. The smaller one of the two probabilities counts, twice.
    """
    e, band = point.equations, point.equations.band
    drive = point.parameters.linear[MOTION:] @ e.predicted[MOTION:]
    residual = point.residual / np.sqrt(point.noise)
    first, count = band.first_bin, band.frequency.size
    size = 2 * (first + count)
    reach = int(LAGS * size * band.rate / band.samples)
    probabilities = []
    for signal in (e.predicted[0], drive):
        cross = np.zeros(first + count + 1, dtype=complex)
        cross[first:-1] = residual * signal.conj() / np.sqrt(band.smooth(np.abs(signal) ** 2, WHITENING))
        products = 0.5 * size * np.fft.irfft(cross, size)[np.arange(-reach, reach + 1)]
        energy = np.sum(products**2) / (0.5 * count * band.correlation)
        probabilities.append(special.chdtrc(products.size, energy))
    return float(min(1.0, 2.0 * min(probabilities)))


def asymptotic_covariance(point: Point, free: np.ndarray) -> np.ndarray:
    """Covariance of the parameters where the model is complete.

    Weights from the noise are an estimate themselves. To first order in the variance a of a smoothed periodogram over
    its square the equations scatter by 1 + 3a more than with the true spectrum, where this formula says 1 + a.

    Shapes: returns (free, free).
    """
    select, e = np.ix_(free, free), point.equations
    inverse = solve_scaled(point.normal[select], np.eye(free.size))
    factor = 1.0 + 2.0 * e.band.smoothing_variance(NOISE_RESOLUTION) if e.weighting == "noise" else 1.0
    return factor * inverse @ point.scatter[select] @ inverse.T


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
    scores = time_scores(point)[free]
    inverse = solve_scaled(point.slope[np.ix_(free, free)], np.eye(free.size))
    freedom = max(round(band.samples / band.rate / SEGMENT) - SLOWEST, FEWEST)
    cosines = dct(scores, norm="ortho", axis=1)[:, 1 + SLOWEST : 1 + SLOWEST + freedom]
    influence = inverse @ cosines
    independent = 2.0 * point.noise.size / band.correlation
    factor = band.samples / freedom * independent / (independent - free.size)
    if point.equations.weighting == "noise":  # the weights follow the residual whose scatter is computed here
        factor *= 1.0 + band.smoothing_variance(NOISE_RESOLUTION)
    return factor * influence @ influence.T, freedom


def time_scores(point: Point) -> np.ndarray:
    """Contributions of each time to the left side of the equations, shape (unknowns, samples).

    A sum over frequencies of two spectra is a sum over time of their signals: the weighted residual, and instruments
    with the same weights. Where the weights are an estimate from the residual, and residual and instruments are
    correlated at single frequencies though not on the whole, the squares of the residual contribute as well.
    """
    e, band = point.equations, point.equations.band
    root = np.sqrt(point.level)
    scores = band.signals(point.instruments / root) * band.signals(point.residual / root)
    if e.weighting == "noise":
        products = np.real(point.weighted * point.residual) / point.level
        filters = np.array([band.smooth(row, NOISE_RESOLUTION) for row in products])
        scores -= band.signals(filters * point.residual) * band.signals(point.residual)
    return 0.5 * band.samples * scores


def estimate_deviations(point: Point, covariance: np.ndarray, free: np.ndarray) -> dict[str, float]:
    """Standard deviations of the physical parameters, or of their logarithms; those of the reflex by differences."""
    nonlinearity, reflex, slopes = point.path.nonlinearity, slice(MOTION, point.parameters.linear.size), []
    values, deviations = np.array(nonlinearity.rectifier[:2]), np.sqrt(np.diag(covariance))
    for step in np.diag(0.1 * deviations[reflex]):
        shifted = replace(nonlinearity, coefficients=nonlinearity.coefficients + step).rectifier[:2]
        slopes.append((np.array(shifted) - values) / step.sum())
    gain, threshold = np.sqrt(np.diag(np.transpose(slopes) @ covariance[reflex, reflex] @ slopes)).tolist()
    names = np.array(point.names)[free].tolist()
    return dict(zip(names, deviations.tolist(), strict=True)) | {"G": gain, "threshold": threshold}


def estimate_intervals(
    values: Mapping[str, float], deviations: Mapping[str, float], quantile: float
) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
    """Standard errors and intervals of parameters, some of which have the deviations of their logarithms."""
    factors = {name: values[name] if name in LOGARITHMIC else 1.0 for name in values if name in deviations}
    errors, intervals = {name: factor * deviations[name] for name, factor in factors.items()}, {}
    for name, error in errors.items():
        value, margin = values[name], quantile * error
        intervals[name] = value - margin, value + margin
        if name in LOGARITHMIC:
            ratio = float(np.exp(min(margin / value, WIDEST)))
            intervals[name] = value / ratio, value * ratio
    return errors, intervals
