"""Variance accounted for (VAF) by an estimate of a signal, and its confidence interval."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from ankleloop.errors import DataError
from ankleloop.options import as_real

TWO_SIDED = 1.959963984540054  # of the normal distribution, 95 %


def confidence_margin(sd: ArrayLike, n: ArrayLike) -> np.ndarray:
    r"""Half width of the 95 % confidence interval of a mean over independent trials.

    .. math:: t_{0.975, \, n - 1} \; sd / \sqrt{n}
    """
    trials = np.asarray(n, dtype=float)
    quantile = special.stdtrit(trials - 1.0, 0.975)
    return quantile * sd / np.sqrt(np.maximum(trials, 1.0))


def vaf(measured: ArrayLike, estimated: ArrayLike) -> float:
    r"""Percentage of the variance of a signal that an estimate accounts for.

    .. math:: \%VAF = 100 \left(1 - \frac{\mathrm{var}(y - \hat y)}{\mathrm{var}(y)}\right)

    Equation 18 of Zhao, Ludvig and Kearney (ACC 2008). Both means are removed by the variances, so a constant
    offset costs nothing. 100 is a perfect estimate, 0 is no better than the mean; worse estimates are negative.

    Parameters
    ----------
    measured, estimated : array_like, shape (N,)
        Signal and estimate, in the same unit.

    Returns
    -------
    float
        VAF [%].

    Raises
    ------
    DataError
        If the lengths differ, a value is not finite, or `measured` is constant.

    See Also
    --------
    ankleloop.evaluate : The same for all torques of an estimate, with intervals.

    Examples
    --------
    >>> float(round(vaf([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 2.0, 4.0]), 6))
    85.0
    """
    error, signal = _error_and_signal(measured, estimated)
    return 100.0 * (1.0 - (error @ error) / (signal @ signal))


def _error_and_signal(measured: ArrayLike, estimated: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Error and measured signal less their means."""
    y = as_real(measured, "measured signal")
    estimate = as_real(estimated, "estimated signal")
    if y.ndim != 1 or y.shape != estimate.shape or y.size < 2:
        raise DataError(
            f"VAF needs two 1-D signals of equal length, 2 samples or more; got measured of shape {y.shape} and "
            f"estimated of shape {estimate.shape}: cut both to the same samples."
        )
    for name, values in (("measured", y), ("estimated", estimate)):
        faults = np.flatnonzero(~np.isfinite(values))
        if faults.size:
            raise DataError(
                f"the {name} signal is not finite at sample {faults[0]} ({faults.size} samples in all)."
            )
    error = y - estimate
    error = error - error.mean()
    signal = y - y.mean()
    # A constant differs from its mean by rounding only, so its variance is compared with the size of the signal.
    rounding = np.finfo(float).eps * np.max(np.abs(y))
    if not signal @ signal / signal.size > rounding**2:
        raise DataError("the measured signal is constant, so it has no variance to account for.")
    return error, signal


def _sum_covariances(x: np.ndarray, width: int) -> float:
    r"""Variance of the mean of a correlated signal of zero mean, times its length (Newey and West 1987).

    .. math:: \gamma_0 + 2 \sum_{k=1}^{L} \left(1 - \frac{k}{L + 1}\right) \gamma_k, \qquad L + 1 = width

    Bartlett's weights never give a negative one. The sum is that of squared sums over a moving window; beyond its ends
    the signal is zero.
    """
    sums = np.cumsum(np.concatenate([x, np.zeros(width - 1)]))
    sums[width:] -= sums[:-width].copy()
    return float(sums @ sums) / (width * x.size)


def vaf_with_interval(
    measured: ArrayLike, estimated: ArrayLike, lags: int
) -> tuple[float, float, float]:
    r"""VAF, and the asymptotic 95 % interval of that of a fixed model in the long run.

    With error e and signal y, both of zero mean, the logarithm of q = var(e)/var(y) is asymptotically normal, with the
    long-run variance of

    .. math:: \psi_t = \frac{e_t^2}{\mathrm{var}(e)} - \frac{y_t^2}{\mathrm{var}(y)}

    over the length of the record. Squares of samples further apart than `lags` count as independent.

    Shapes: measured, estimated (N,).
    """
    error, signal = _error_and_signal(measured, estimated)
    if not error.any():
        return 100.0, 100.0, 100.0
    influence = error**2 / np.mean(error**2) - signal**2 / np.mean(signal**2)
    variance = _sum_covariances(influence, min(lags + 1, error.size)) / error.size
    factor = np.exp(TWO_SIDED * np.sqrt(variance))
    share = (error @ error) / (signal @ signal)
    value = 100.0 * (1.0 - share)
    low = 100.0 * (1.0 - share * factor)
    high = 100.0 * (1.0 - share / factor)
    return float(value), float(low), float(high)
