"""How well an estimate explains a signal."""

import numpy as np
from scipy import special

from ankleloop.errors import DataError

__all__ = ["confidence_margin", "vaf"]


def confidence_margin(sd, n, level=0.95):
    r"""Half width of the confidence interval of a mean over independent trials.

    .. math:: t_{(1 + level) / 2, \, n - 1} \; sd / \sqrt{n}

    Parameters
    ----------
    sd : float or array_like
        Standard deviation of the sample.
    n : int or array_like
        Number of trials; with a single one the interval is not defined (nan).
    level : float
        Confidence.

    Returns
    -------
    float or ndarray
        In the unit of `sd`.

    Examples
    --------
    >>> round(float(confidence_margin(1.0, 100)), 4)
    0.1984
    """
    sd, n = np.asarray(sd, dtype=float), np.asarray(n)
    freedom = np.where(n > 1, n - 1, 1)
    return np.where(n > 1, special.stdtrit(freedom, 0.5 + level / 2) * sd / np.sqrt(n), np.nan)


def vaf(measured, estimated):
    r"""Percentage of the variance of a signal that an estimate accounts for.

    .. math:: \%VAF = 100 \left(1 - \frac{\mathrm{var}(y - \hat y)}{\mathrm{var}(y)}\right)

    Equation 18 of Zhao, Ludvig and Kearney (ACC 2008). Both means are removed by the variances, so a constant
    offset costs nothing. 100 is a perfect estimate, 0 is no better than the mean; worse estimates are negative.

    Parameters
    ----------
    measured, estimated : array_like, shape (N,)
        The signal and its estimate, in the same unit.

    Returns
    -------
    float
        VAF [%].

    Raises
    ------
    DataError
        If the lengths differ, a value is not finite, or `measured` is constant.

    Examples
    --------
    >>> float(round(vaf([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 2.0, 4.0]), 6))
    85.0
    """
    measured = np.asarray(measured, dtype=float)
    estimated = np.asarray(estimated, dtype=float)
    if measured.ndim != 1 or measured.shape != estimated.shape:
        raise DataError(
            f"VAF needs two 1-D signals of equal length, got shapes {measured.shape} and {estimated.shape}: "
            "cut both to the same samples."
        )
    for name, signal in (("measured", measured), ("estimated", estimated)):
        bad = np.flatnonzero(~np.isfinite(signal))
        if bad.size:
            raise DataError(f"the {name} signal is not finite at sample {bad[0]} ({bad.size} samples in all).")
    variance = np.var(measured) if measured.size else 0.0
    # A constant differs from its mean by rounding only, so zero variance is judged against the signal's size.
    if variance <= (np.finfo(float).eps * np.max(np.abs(measured), initial=0.0)) ** 2:
        raise DataError("the measured signal is constant, so it has no variance to account for.")
    return float(100.0 * (1.0 - np.var(measured - estimated) / variance))
