"""Tests of a residual within the pass band: whether it is white, and whether it depends on a signal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg, special

from ankleloop.errors import DataError
from ankleloop.signals.spectra import Band, pass_band

LAGS = 0.5  # s
GROUPS = 38  # bands of frequency whose power is compared
LEVEL = 0.01
WHITENING = 1.0  # Hz, half width of the smoothing that gives the spectra for whitening


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
        99 % of the correlations at single lags are below it in magnitude if the two are unrelated.
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


def residual_test(residual: np.ndarray, signal: np.ndarray, rate: float) -> ResidualTest:
    r"""Test a residual for whiteness, and for correlation with a signal that must not explain it.

    Decimated noise has nothing above the pass band, so its autocorrelation is not that of white noise, whatever the
    recorded noise was. Both tests use the m frequencies of the pass band alone, and the covariance that the taper w of
    the record gives them,

    .. math:: |\rho(d)|^2 = \Bigl| \sum_t w_t^2 e^{-2 \pi i t d / N} \Bigr|^2 \Big/ \Bigl( \sum_t w_t^2 \Bigr)^2 .

    Whiteness: Bartlett's test (1937) that the power in 38 bands of equal width has the same expectation. Means of
    squared magnitudes are variances; the sum of their degrees of freedom is 2m over the factor by which the taper
    raises the scatter between the bands.

    Relation: residual and signal are whitened by their own smooth spectra. The residual's spectrum R is then fitted by
    the signal's spectrum S at lags τ that are 1/(2b) apart, b the width of the band, and so nearly uncorrelated,

    .. math:: \min_a \sum_f \Bigl| R(f) - S(f) \sum_j a_j e^{-2 \pi i f \tau_j} \Bigr|^2 .

    Of an unrelated Gaussian residual, r lags explain a share of the power that has a beta distribution with the
    parameters r/2 and (r/μ - r)/2, μ being its expectation with this signal and taper: r/2m without a taper.

    Shapes: residual (N,), signal (N,).

    References
    ----------
    M. S. Bartlett, "Properties of sufficiency and statistical tests", Proceedings of the Royal Society A 160, 268-282,
    1937.
    """
    band = pass_band(residual.size, rate)
    times = _independent_lags(band)
    fewest = max(2 * GROUPS, 2 * times.size)
    if band.frequency.size < fewest:
        raise DataError(
            f"{residual.size / rate:.3g} s have {band.frequency.size} frequencies in the pass band, but the tests of "
            f"the residual need {fewest}: use a longer record."
        )
    power = np.abs(band.transform(residual)) ** 2
    white_p = _whiteness(power, band)
    white_residual, white_signal = (_whiten(band, x) for x in (residual, signal))
    related_p = _relation(band, white_residual, white_signal, times)
    reach = round(LAGS * rate)
    shifts = np.arange(-reach, reach + 1)
    size = np.sqrt(np.sum(np.abs(white_residual) ** 2) * np.sum(np.abs(white_signal) ** 2))
    correlation = band.signals(white_residual * white_signal.conj()) * band.samples / (2.0 * size)
    return ResidualTest(
        frequency=band.frequency,
        density=band.smooth(power, 0.4) / band.density,
        white=white_p >= LEVEL,
        white_p=white_p,
        lags=shifts / rate,
        correlation=correlation[shifts],
        limit=float(special.ndtri(0.995) * np.sqrt(0.5 * band.correlation / power.size)),
        related=related_p < LEVEL,
        related_p=related_p,
    )


def _whiten(band: Band, x: np.ndarray) -> np.ndarray:
    """Spectrum of a signal in the band, divided by its smooth magnitude."""
    spectrum = band.transform(x)
    return spectrum / np.sqrt(band.smooth(np.abs(spectrum) ** 2, WHITENING))


def _independent_lags(band: Band) -> np.ndarray:
    """Lags [s] at which correlations of white signals within the band are uncorrelated."""
    width = band.highest - band.lowest
    reach = int(2.0 * LAGS * width)
    return np.arange(-reach, reach + 1) / (2.0 * width)


def _whiteness(power: np.ndarray, band: Band) -> float:
    """Probability of a spectrum at least as uneven as a periodogram, if the signal were white."""
    groups = np.array_split(power, GROUPS)
    sizes = np.array([group.size for group in groups])
    freedom = 2.0 * sizes / _band_scatter(band, sizes)
    unevenness = freedom.sum() * np.log(power.mean()) - freedom @ np.log(
        [group.mean() for group in groups]
    )
    correction = 1.0 + (np.sum(1.0 / freedom) - 1.0 / freedom.sum()) / (3.0 * (GROUPS - 1))
    return float(special.chdtrc(GROUPS - 1, unevenness / correction))


def _band_scatter(band: Band, sizes: np.ndarray) -> float:
    """Factor by which the taper raises the variance between the means of neighbouring frequencies.

    It is less than that of the whole band, because it makes neighbouring bands alike, too.
    """
    transform = np.abs(np.fft.rfft(band.taper**2)[: sizes.min()]) ** 2
    distance = np.arange(1, transform.size)
    within = (
        1.0
        + 2.0 * np.mean([(1.0 - distance / size) @ transform[1:] for size in sizes]) / transform[0]
    )
    return (sizes.size * within - band.correlation) / (sizes.size - 1)


def _relation(band: Band, residual: np.ndarray, signal: np.ndarray, times: np.ndarray) -> float:
    """Probability that lags of a signal explain at least as much of a residual, if the two were unrelated."""
    regressors = signal[:, None] * np.exp(-2j * np.pi * np.outer(band.frequency, times))
    gram = np.real(regressors.conj().T @ regressors)
    basis = linalg.solve_triangular(linalg.cholesky(gram, lower=True), regressors.T, lower=True)
    share = np.sum(np.real(basis.conj() @ residual) ** 2) / np.sum(np.abs(residual) ** 2)
    # The taper weights white noise over the record; so the expectation of its products with the basis is known.
    energy = np.sum(band.signals(basis) ** 2, axis=0)
    expectation = 0.25 * band.samples**2 * np.average(energy, weights=band.taper**2) / signal.size
    return float(
        special.betaincc(
            0.5 * times.size, 0.5 * times.size * (1.0 / expectation - 1.0), min(share, 1.0)
        )
    )
