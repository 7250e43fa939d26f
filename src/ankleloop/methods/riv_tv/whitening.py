"""From spectra to whitened signals: the transform, the weights, and the noise that they are made of.

`riv` weighs frequencies of a band (`riv.equations.Point`), because its equations stand between spectra. Here they stand
between samples, each with parameters of its own: the weights are a filter, and a level that changes with time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy import linalg
from scipy.fft import irfft, next_fast_len, rfft

from ankleloop.joint.time_varying_course import Course, Splines
from ankleloop.methods.riv.equations import NOISE_RESOLUTION
from ankleloop.signals.spectra import pass_bands

PADDING = 1.0  # s of zeros behind a record, in which responses end
FEWEST_BINS = 20  # frequencies over which it is, in a short record
LEVEL_SPLINES = 8  # of the level of the noise
DEPENDENT_SPLINES = 1e-6  # of the largest singular value
LOWEST_LEVEL = 0.05  # of the mean level of the noise
WEIGHT_FLOOR = 1e-10  # of the largest power of the noise


class PaddedTransform:
    """Fourier transform of decimated records, one after the other, with zeros behind each of them."""

    def __init__(self, sizes: Sequence[int], rate: float) -> None:
        padding = round(PADDING * rate)
        self.sizes = sizes  # samples of each record
        self.samples = sum(sizes)
        self.rate = rate  # of the samples [Hz]
        self.length = self.samples + padding * (len(sizes) - 1)  # from the first sample to the last
        self.size = int(next_fast_len(self.length + padding, real=True))
        self.frequency = np.fft.rfftfreq(self.size, 1.0 / rate)  # [Hz], shape (frequencies,)
        self.s = 2j * np.pi * self.frequency  # Laplace variable [rad/s]
        # Where the samples stand among the zeros.
        self.places: slice | np.ndarray = slice(self.samples)
        if len(sizes) > 1:
            self.places = np.arange(self.samples) + padding * np.repeat(
                np.arange(len(sizes)), sizes
            )

    def spectra(self, signals: np.ndarray) -> np.ndarray:
        """Transforms of signals, shape (..., frequencies)."""
        if len(self.sizes) == 1:
            return rfft(signals, self.size)
        padded = np.zeros((*signals.shape[:-1], self.length))
        padded[..., self.places] = signals
        return rfft(padded, self.size)

    def signals(self, spectra: np.ndarray) -> np.ndarray:
        """Signals of transforms, shape (..., samples)."""
        return irfft(spectra, self.size)[..., self.places]

    def split(self, signals: np.ndarray) -> list[np.ndarray]:
        """The part of signals in each record."""
        return np.split(signals, np.cumsum(self.sizes)[:-1], axis=-1)


# Makes signals of spectra, of the samples that count alone: shape (..., rows).
Weighting = Callable[[np.ndarray], np.ndarray]


class NoiseModel:
    """How spectrum and level of the noise are estimated, and the weights that whiten it."""

    def __init__(self, course: Course, transform: PaddedTransform, weighting: str) -> None:
        rows = course.rows
        samples = course.segment.size
        frequency = transform.frequency
        self.transform = transform
        self.rows = rows
        self.weighting = weighting  # "noise" or "flat"
        self.band = pass_bands([part.segment.size for part in course.parts], transform.rate)
        self.resolution = max(NOISE_RESOLUTION, FEWEST_BINS * transform.rate / samples)  # [Hz]
        # Variance of the smoothed spectrum over its square.
        self.spectrum_variance = self.band.smoothing_variance(self.resolution)
        edges = self.band.longest
        self.highest = edges.highest  # Hz
        self.inside = (frequency >= edges.lowest) & (frequency <= edges.highest)
        # So many independent values a whitened sample has.
        self.share = float(np.mean(self.inside))
        # Splines of the level over the place, and the matrix that fits them.
        self._level_splines = Splines(LEVEL_SPLINES, course.periodic)(course.place[rows])
        self._level_fit = linalg.pinv(self._level_splines, rtol=DEPENDENT_SPLINES)

    @property
    def weight_variance(self) -> float:
        """Variance of the weights of frequencies over their square; flat ones have none."""
        return 0.0 if self.weighting == "flat" else self.spectrum_variance

    def spectrum(self, noise: np.ndarray) -> np.ndarray:
        """Smoothed spectrum of the noise over the band of the longest record [(N·m)²]; of white noise its variance."""
        periodogram = np.abs(self.band.transform(noise)) ** 2
        power = 0.5 * self.transform.rate * self.band.average(periodogram, self.resolution)
        return np.maximum(power, WEIGHT_FLOOR * power.max())

    def whiten(self, noise: np.ndarray) -> Weighting:
        """Weights that make noise white: the inverse of its spectrum, and of its level as a function of the place.

        Shapes: noise (rows,).
        """
        spectrum = self.spectrum(noise)
        if self.weighting == "flat":
            return self.weigh(spectrum.mean())
        power = np.interp(self.transform.frequency, self.band.longest.frequency, spectrum)
        stationary = self.weigh(power)
        padded = np.zeros(self.transform.samples)
        padded[self.rows] = noise
        white_power = stationary(self.transform.spectra(padded)) ** 2
        level = self._level_splines @ (self._level_fit @ white_power) / white_power.mean()
        return self.weigh(power, np.sqrt(np.maximum(level, LOWEST_LEVEL)))

    def weigh(self, power: np.ndarray | float, level: np.ndarray | float = 1.0) -> Weighting:
        """Weights that are the inverse of a power within the band, and zero elsewhere.

        Shapes: power (frequencies,), level (rows,).
        """
        weight = np.where(self.inside, 1.0 / np.sqrt(power), 0.0)

        def whiten(spectra: np.ndarray) -> np.ndarray:
            """Weights reach far: what the ends of short trials leave must not come into the samples that count."""
            if len(self.band.parts) > 1:
                spectra = self._clear_ends(spectra)
            return self.transform.signals(weight * spectra)[..., self.rows] / level

        return whiten

    def _clear_ends(self, spectra: np.ndarray) -> np.ndarray:
        """Spectra of signals that are zero beyond the samples that count."""
        signals = self.transform.signals(spectra)
        cleared = np.zeros_like(signals)
        cleared[..., self.rows] = signals[..., self.rows]
        return self.transform.spectra(cleared)

    def colour(self, signals: np.ndarray, residual: np.ndarray) -> np.ndarray:
        """Whitened signals with the spectrum of a whitened residual over its mean, shape (..., rows).

        Noise weights leave about white noise, flat ones its colour.
        """
        spectrum = self.spectrum(residual)
        frequency = np.fft.rfftfreq(residual.size, 1.0 / self.transform.rate)
        relative = spectrum / spectrum.mean()
        power = np.interp(frequency, self.band.longest.frequency, relative, left=0.0, right=0.0)
        return irfft(np.sqrt(power) * rfft(signals), residual.size)
