"""Is anything left in a residual that a model could explain? Tests within the pass band only."""

from dataclasses import dataclass

import numpy as np
from scipy import special

from ankleloop.signals.decimation import PASSBAND
from ankleloop.signals.spectra import Band

__all__ = ["ResidualTest", "residual_test"]

LAGS = 0.5  # s
GROUPS = 38  # bands of frequency among which the power is compared
LEVEL = 0.01


@dataclass(frozen=True)
class ResidualTest:
    """What is left of the torque, tested.

    Parameters
    ----------
    frequency, density : ndarray
        One-sided power spectral density of the residual [(N·m)²/Hz] within the pass band [Hz].
    white : bool
        Whether it is white there.
    white_p : float
        Probability of so uneven a spectrum, if it were.
    lags : ndarray
        Time by which the residual is behind the signal [s].
    correlation : ndarray
        Correlation of residual and signal, both whitened within the pass band.
    limit : float
        99 % of such correlations are below it in magnitude if the two are unrelated.
    related : bool
        Whether the residual depends on the signal.
    related_p : float
        Probability of such correlations if it did not.
    """

    frequency: np.ndarray
    density: np.ndarray
    white: bool
    white_p: float
    lags: np.ndarray
    correlation: np.ndarray
    limit: float
    related: bool
    related_p: float


def residual_test(residual, signal, rate, lags=LAGS):
    r"""Test a residual for whiteness, and for correlation with a signal that must not explain it.

    Decimated noise has nothing above the pass band, so its autocorrelation is not that of white noise whatever it was
    before. Both tests look at the pass band alone. Whiteness: the power of an equal number of frequencies in each of 38
    bands has the same expectation; means of n squared magnitudes scatter as a χ² of 2n degrees of freedom. Correlation:
    residual and signal are whitened by their own spectra; then each of the cross-correlations at independent lags is
    normal with variance 1/m, m being the number of independent samples in the band.

    Parameters
    ----------
    residual : ndarray, shape (N,)
        What a model leaves of the torque.
    signal : ndarray, shape (N,)
        An input, in open loop; an instrument, in closed loop, where the inputs depend on the residual.
    rate : float
        Sampling rate [Hz].
    lags : float
        Longest lag and lead [s].

    Returns
    -------
    ResidualTest

    Examples
    --------
    >>> e, x = np.random.default_rng(1).standard_normal((2, 5000))
    >>> one, other = residual_test(e, x, 100.0), residual_test(e + 0.3 * x, x, 100.0)
    >>> one.white, one.related, other.related
    (True, False, True)
    """
    band = Band(residual.size, rate, 0.05, PASSBAND * rate)
    spectra = [band.transform(x) for x in (residual, signal)]
    power = np.abs(spectra[0]) ** 2
    freedom = 2.0 / band.correlation
    groups = np.array_split(power, GROUPS)
    size = np.array([group.size for group in groups])
    ratio = np.array([group.mean() for group in groups]) / power.mean()
    # Logarithms of means of n squared magnitudes scatter by nearly 1/n, whatever the level.
    unevenness = np.sum(size * freedom / 2.0 * np.log(ratio) ** 2)
    white_p = float(special.chdtrc(GROUPS - 1, unevenness))
    whitened = [x / np.sqrt(band.smoothed(np.abs(x) ** 2, 1.0)) for x in spectra]
    full = np.zeros(residual.size // 2 + 1, dtype=complex)
    kept = np.round(band.frequency * residual.size / rate).astype(int)
    full[kept] = whitened[0] * whitened[1].conj()
    correlation = np.fft.irfft(full, residual.size)
    reach = round(lags * rate)
    shifts = np.arange(-reach, reach + 1)
    # Of unrelated signals the products have unit power; `scale` is the correlation's standard deviation.
    scale = np.sqrt(2.0 * kept.size * band.correlation) / residual.size
    found = correlation[shifts] / scale
    # Samples of a signal with a share of the band only are that much less independent.
    independent = found[:: max(1, round(0.5 / PASSBAND))]
    related_p = float(special.chdtrc(independent.size, np.sum(independent**2)))
    root = np.sqrt(kept.size * 2.0)
    return ResidualTest(
        frequency=band.frequency,
        density=band.smoothed(power, 0.4) / band.density,
        white=white_p >= LEVEL,
        white_p=white_p,
        lags=shifts / rate,
        correlation=found / root,
        limit=float(special.ndtri(0.995) / root),
        related=related_p < LEVEL,
        related_p=related_p,
    )
