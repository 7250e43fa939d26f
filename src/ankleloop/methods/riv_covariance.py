"""Covariance and intervals of the parameters of `riv`: asymptotic, or robust where the model is incomplete."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy import special
from scipy.fft import dct

from ankleloop.joint.hammerstein import ReflexPath, StaticNonlinearity
from ankleloop.joint.regressors import MOTION
from ankleloop.methods.riv_equations import NOISE_RESOLUTION, RivEquations, RivParameters, RivPoint, solve_scaled
from ankleloop.signals.vaf import TWO_SIDED

SEGMENT = 1.0  # s: over this the products of residual and instruments may be correlated
SLOWEST = 2  # cosines that a drift within the record would fill
FEWEST = 8  # cosines of a short record
LAGS = 0.5  # s
WHITENING = 1.0  # Hz
LEVEL = 0.01
LOGARITHMIC = ("omega_n", "zeta", "pole")  # parameters the logarithms of which are normally distributed
WIDEST = 50.0  # of such a logarithm


@dataclass(frozen=True, eq=False)
class RivCovariance:
    """Covariance of the free unknowns, and how it was computed."""

    kind: Literal["asymptotic", "robust"]  # which of the two it is
    matrix: np.ndarray  # shape (free, free): the covariance
    quantile: float  # half of a 95 % interval over its standard error
    segment: float | None  # length of the segments of the record that count as independent [s], of a robust one
    movement_p: float  # see `movement_p`


def choose_covariance(
    point: RivPoint, free: np.ndarray, kind: Literal["asymptotic", "robust"] | None = None
) -> RivCovariance:
    """Covariance of a kind; by default the robust one if the residual depends on the movement."""
    p = movement_p(point)
    if kind == "asymptotic" or (kind is None and p >= LEVEL):
        return RivCovariance("asymptotic", asymptotic_covariance(point, free), TWO_SIDED, None, p)
    matrix, freedom = robust_covariance(point, free)
    segment = point.equations.band.samples / point.equations.band.rate / freedom
    return RivCovariance("robust", matrix, float(special.stdtrit(freedom, 0.975)), segment, p)


def movement_p(point: RivPoint) -> float:
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


def asymptotic_covariance(point: RivPoint, free: np.ndarray) -> np.ndarray:
    """Covariance of the parameters where the model is complete.

    Weights from the noise are an estimate themselves. To first order in the variance a of a smoothed periodogram over
    its square the equations scatter by 1 + 3a more than with the true spectrum, where this formula says 1 + a.

    Shapes: returns (free, free).
    """
    select, e = np.ix_(free, free), point.equations
    inverse = solve_scaled(point.normal[select], np.eye(free.size))
    factor = 1.0 + 2.0 * e.band.smoothing_variance(NOISE_RESOLUTION) if e.weighting == "noise" else 1.0
    return factor * inverse @ point.scatter[select] @ inverse.T


def robust_covariance(point: RivPoint, free: np.ndarray) -> tuple[np.ndarray, int]:
    r"""Covariance of the parameters about those of an infinitely long record, whatever the residual is.

    The solution scatters as :math:`H^{-1} \sum_t s(t)`, H being the slope of the equations with that of weights and
    instruments, and s(t) the contribution of a time to their left side, see `time_scores`. A residual that depends on
    the movement correlates these contributions over time. Their spectrum at low frequencies is the variance of their
    sum: the mean of the squares of their first cosine transforms is it, from as many as there are segments of one
    second in the record (Müller 2007; Lazarus, Lewis, Stock and Watson 2018). The estimate has as many degrees of
    freedom. The first two cosines are left out: they hold what drifts over the record, which the same record, repeated,
    would do again.

    Shapes: returns covariance (free, free).

    References
    ----------
    U. K. Müller, "A theory of robust long-run variance estimation", Journal of Econometrics 141(2), 1331-1352, 2007.
    E. Lazarus, D. J. Lewis, J. H. Stock, M. W. Watson, "HAR inference: recommendations for practice", Journal of
    Business & Economic Statistics 36(4), 541-559, 2018.
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


def time_scores(point: RivPoint) -> np.ndarray:
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
        filters = np.array([e.smooth(row) for row in products])
        scores -= band.signals(filters * point.residual) * band.signals(point.residual)
    return 0.5 * band.samples * scores


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
