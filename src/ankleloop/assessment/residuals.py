"""Tests of a residual within the pass band: whether it is white, and whether it depends on a signal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg, special

from ankleloop.errors import DataError
from ankleloop.signals.spectra import Band, pass_band

CORRELATION_LAGS = 0.5  # s
WHITENESS_BANDS = 38  # of frequency, whose power is compared
TEST_LEVEL = 0.01
DENSITY_RESOLUTION = 0.4  # Hz, half width of the smoothing of the density that is shown
WHITENING_RESOLUTION = 1.0  # Hz, that of the spectra for whitening


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
    1937. https://doi.org/10.1098/rspa.1937.0109
    """
    band = pass_band(residual.size, rate)
    times = _independent_lags(band)
    fewest = 2 * max(WHITENESS_BANDS, times.size)
    if band.frequency.size < fewest:
        raise DataError(
            f"{residual.size / rate:.3g} s have {band.frequency.size} frequencies in the pass band, but the tests of "
            f"the residual need {fewest}: use a longer record."
        )
    power = np.abs(band.transform(residual)) ** 2
    white_p = _whiteness(power, band)
    white_residual = _whiten(band, residual)
    white_signal = _whiten(band, signal)
    related_p = _relation(band, white_residual, white_signal, times)
    reach = round(CORRELATION_LAGS * rate)
    shifts = np.arange(-reach, reach + 1)
    size = np.sqrt(_energy(white_residual) * _energy(white_signal))
    correlation = band.signals(white_residual * white_signal.conj()) * band.samples / (2.0 * size)
    deviation = np.sqrt(0.5 * band.correlation / power.size)
    return ResidualTest(
        frequency=band.frequency,
        density=band.smooth(power, DENSITY_RESOLUTION) / band.density,
        white=white_p >= TEST_LEVEL,
        white_p=white_p,
        lags=shifts / rate,
        correlation=correlation[shifts],
        limit=float(special.ndtri(1.0 - 0.5 * TEST_LEVEL) * deviation),
        related=related_p < TEST_LEVEL,
        related_p=related_p,
    )


def _energy(spectrum: np.ndarray) -> float:
    """Sum of the squared magnitudes of a spectrum."""
    return float(np.sum(np.abs(spectrum) ** 2))


def _whiten(band: Band, x: np.ndarray) -> np.ndarray:
    """Spectrum of a signal in the band, divided by its smooth magnitude."""
    spectrum = band.transform(x)
    power = band.smooth(np.abs(spectrum) ** 2, WHITENING_RESOLUTION)
    return spectrum / np.sqrt(power)


def _independent_lags(band: Band) -> np.ndarray:
    """Lags [s] at which correlations of white signals within the band are uncorrelated."""
    width = band.highest - band.lowest
    reach = int(2.0 * CORRELATION_LAGS * width)
    return np.arange(-reach, reach + 1) / (2.0 * width)


def _whiteness(power: np.ndarray, band: Band) -> float:
    """Probability of a spectrum at least as uneven as a periodogram, if the signal were white."""
    groups = np.array_split(power, WHITENESS_BANDS)
    sizes = np.array([group.size for group in groups])
    means = np.array([group.mean() for group in groups])
    freedom = 2.0 * sizes / _band_scatter(band, sizes)
    whole = freedom.sum()
    unevenness = whole * np.log(power.mean()) - freedom @ np.log(means)
    others = WHITENESS_BANDS - 1
    correction = 1.0 + (np.sum(1.0 / freedom) - 1.0 / whole) / (3.0 * others)
    return float(special.chdtrc(others, unevenness / correction))


def _band_scatter(band: Band, sizes: np.ndarray) -> float:
    """Factor by which the taper raises the variance between the means of neighbouring frequencies.

    It is less than that of the whole band, because it makes neighbouring bands alike, too.
    """
    transform = np.fft.rfft(band.taper**2)[: sizes.min()]
    covariance = np.abs(transform) ** 2
    distance = np.arange(1, covariance.size)
    sums = [(1.0 - distance / size) @ covariance[1:] for size in sizes]
    within = 1.0 + 2.0 * np.mean(sums) / covariance[0]
    return (sizes.size * within - band.correlation) / (sizes.size - 1)


def _relation(band: Band, residual: np.ndarray, signal: np.ndarray, times: np.ndarray) -> float:
    """Probability that lags of a signal explain at least as much of a residual, if the two were unrelated."""
    phases = np.exp(-2j * np.pi * np.outer(band.frequency, times))
    regressors = signal[:, None] * phases
    gram = np.real(regressors.conj().T @ regressors)
    basis = linalg.solve_triangular(linalg.cholesky(gram, lower=True), regressors.T, lower=True)
    products = np.real(basis.conj() @ residual)
    share = np.sum(products**2) / _energy(residual)
    # The taper weights white noise over the record; so the expectation of its products with the basis is known.
    energy = np.sum(band.signals(basis) ** 2, axis=0)
    mean_energy = np.average(energy, weights=band.taper**2)
    expectation = 0.25 * band.samples**2 * mean_energy / signal.size
    explained = 0.5 * times.size
    rest = explained * (1.0 / expectation - 1.0)
    return float(special.betaincc(explained, rest, min(share, 1.0)))
