"""Tests of a residual within the pass band: whether it is white, and whether it depends on a signal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special

from ankleloop.signals.decimation import PASSBAND
from ankleloop.signals.spectra import Band

__all__ = ["ResidualTest", "residual_test"]

LAGS = 0.5  # s
GROUPS = 38  # bands of frequency whose power is compared
LEVEL = 0.01


@dataclass(frozen=True)
class ResidualTest:
    """Spectrum of a residual, its correlation with a signal, and the tests of both.

    Parameters
    ----------
    frequency, density : ndarray, shape (F,)
        One-sided power spectral density of the residual [(N·m)²/Hz] within the pass band [Hz].
    white : bool
        Whether it is white there.
    white_p : float
        Probability of a spectrum at least as uneven, if it were.
    lags : ndarray, shape (L,)
        Time by which the residual is behind the signal [s].
    correlation : ndarray, shape (L,)
        Correlation of residual and signal, each whitened within the pass band.
    limit : float
        99 % of such correlations are below it in magnitude if the two are unrelated.
    related : bool
        Whether the residual depends on the signal.
    related_p : float
        Probability of correlations at least as large, if it did not.
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


def residual_test(residual: np.ndarray, signal: np.ndarray, rate: float, lags: float = LAGS) -> ResidualTest:
    r"""Test a residual for whiteness, and for correlation with a signal that must not explain it.

    Decimated noise has nothing above the pass band, so its autocorrelation is not that of white noise, whatever the
    recorded noise was. Both tests use the pass band alone. Whiteness: the power of an equal number of frequencies in
    each of 38 bands has the same expectation; means of n squared magnitudes scatter as a χ² of 2n degrees of freedom.
    Correlation: residual and signal are whitened by their own spectra; then each of the cross-correlations at
    independent lags is normal with variance 1/m, m being the number of independent samples in the band.

    Parameters
    ----------
    residual : ndarray, shape (N,)
        Measured torque less the torque of a model [N·m].
    signal : ndarray, shape (N,)
        In open loop an input; in closed loop, where the inputs depend on the residual, an instrument.
    rate : float
        Sampling rate [Hz].
    lags : float
        Longest lag and lead [s].

    Returns
    -------
    ResidualTest

    Examples
    --------
    >>> noise, signal = np.random.default_rng(1).standard_normal((2, 5000))
    >>> test = residual_test(noise, signal, 100.0)
    >>> test.white, test.related, residual_test(noise + 0.3 * signal, signal, 100.0).related
    (True, False, True)
    """
    band = Band(residual.size, rate, 0.05, PASSBAND * rate)
    spectra = [band.transform(x) for x in (residual, signal)]
    power = np.abs(spectra[0]) ** 2
    white_p = _whiteness(power, band.correlation)
    reach = round(lags * rate)
    shifts = np.arange(-reach, reach + 1)
    scores = _correlation_scores(band, spectra, shifts)
    # A signal that fills only part of the band has that many fewer independent samples.
    independent = scores[:: max(1, round(0.5 / PASSBAND))]
    related_p = float(special.chdtrc(independent.size, np.sum(independent**2)))
    root = np.sqrt(band.frequency.size * 2.0)
    return ResidualTest(
        frequency=band.frequency,
        density=band.smooth(power, 0.4) / band.density,
        white=white_p >= LEVEL,
        white_p=white_p,
        lags=shifts / rate,
        correlation=scores / root,
        limit=float(special.ndtri(0.995) / root),
        related=related_p < LEVEL,
        related_p=related_p,
    )


def _whiteness(power: np.ndarray, correlation: float) -> float:
    """Probability of a spectrum at least as uneven as a periodogram, if the signal were white."""
    freedom = 2.0 / correlation
    groups = np.array_split(power, GROUPS)
    size = np.array([group.size for group in groups])
    ratio = np.array([group.mean() for group in groups]) / power.mean()
    # The logarithm of a mean of n squared magnitudes has a variance of nearly 1/n at any level of power.
    unevenness = np.sum(size * freedom / 2.0 * np.log(ratio) ** 2)
    return float(special.chdtrc(GROUPS - 1, unevenness))


def _correlation_scores(band: Band, spectra: list[np.ndarray], shifts: np.ndarray) -> np.ndarray:
    """Cross-correlation of two whitened signals over its standard deviation, if they are unrelated."""
    residual, signal = (x / np.sqrt(band.smooth(np.abs(x) ** 2, 1.0)) for x in spectra)
    cross = np.zeros(band.samples // 2 + 1, dtype=complex)
    bins = np.round(band.frequency * band.samples / band.rate).astype(int)
    cross[bins] = residual * signal.conj()
    # Products of unrelated whitened signals have unit power.
    deviation = np.sqrt(2.0 * bins.size * band.correlation) / band.samples
    return np.fft.irfft(cross, band.samples)[shifts] / deviation
