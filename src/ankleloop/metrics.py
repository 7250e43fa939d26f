"""How well an estimate explains a signal."""

import numpy as np

from ankleloop.errors import DataError

__all__ = ["vaf"]


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
