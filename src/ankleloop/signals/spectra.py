"""Spectra of records: tapered transforms within a band, and smooth noise spectra."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from ankleloop.signals.decimation import PASSBAND
from ankleloop.signals.least_squares import TINY

LOWEST_FREQUENCY = 0.05  # Hz: drifts and means lie below
TAPER_SHARE = 0.1  # of the record, half of it at either end


@dataclass(frozen=True)
class Band:
    """Fourier transforms of records of one length, between two frequencies."""

    samples: int  # length of the records
    rate: float  # sampling rate [Hz]
    lowest: float  # lower edge of the band [Hz]
    highest: float  # upper edge of the band [Hz]

    @cached_property
    def taper(self) -> np.ndarray:
        """Cosine taper, shape (samples,): it keeps the ends of a record from leaking into other frequencies."""
        ramp = max(1, round(0.5 * TAPER_SHARE * self.samples))
        rise = 0.5 * (1.0 - np.cos(np.pi * (np.arange(ramp) + 0.5) / ramp))
        return np.concatenate([rise, np.ones(self.samples - 2 * ramp), rise[::-1]])

    @cached_property
    def bins(self) -> slice:
        """Those of the frequencies of the records that lie within the band."""
        frequency = np.fft.rfftfreq(self.samples, 1.0 / self.rate)
        first = np.searchsorted(frequency, self.lowest)
        stop = np.searchsorted(frequency, self.highest, side="right")
        return slice(first, stop)

    @cached_property
    def frequency(self) -> np.ndarray:
        """Frequencies of the band [Hz], shape (frequencies,)."""
        return np.fft.rfftfreq(self.samples, 1.0 / self.rate)[self.bins]

    @cached_property
    def s(self) -> np.ndarray:
        """Laplace variable on the imaginary axis [rad/s], shape (frequencies,)."""
        return 2j * np.pi * self.frequency

    @cached_property
    def correlation(self) -> float:
        """Factor by which the taper raises variances: it correlates neighbouring frequencies."""
        return self.samples * np.sum(self.taper**4) / np.sum(self.taper**2) ** 2

    @cached_property
    def density(self) -> float:
        """Divisor of squared magnitudes that gives a one-sided power spectral density."""
        return 0.5 * self.rate * np.sum(self.taper**2)

    def transform(self, x: np.ndarray) -> np.ndarray:
        """Fourier transform of tapered records less their means.

        Shapes: x (..., N); returns (..., frequencies).
        """
        tapered = (x - x.mean(axis=-1, keepdims=True)) * self.taper
        return np.fft.rfft(tapered, axis=-1)[..., self.bins]

    def signals(self, spectra: np.ndarray) -> np.ndarray:
        """Signals whose transforms are given within the band and zero elsewhere, shape (..., samples)."""
        transform = np.zeros((*spectra.shape[:-1], self.samples // 2 + 1), dtype=complex)
        transform[..., self.bins] = spectra
        return np.fft.irfft(transform, self.samples, axis=-1)

    def smooth(self, power: np.ndarray, resolution: float) -> np.ndarray:
        """Smooth a periodogram over a width in frequency.

        Shapes: power (frequencies,); returns (frequencies,).
        """
        return smooth(power, resolution * self.samples / self.rate)

    def smoothing_variance(self, resolution: float) -> float:
        """Variance of a smoothed periodogram over its square."""
        window = _window(resolution * self.samples / self.rate, self.frequency.size)
        return float(self.correlation * np.sum(window**2))


@lru_cache(maxsize=8)
def pass_band(samples: int, rate: float) -> Band:
    """The band of an identification: from 0.05 Hz to the end of the pass band of the decimation."""
    return Band(samples, rate, lowest=LOWEST_FREQUENCY, highest=PASSBAND * rate)


def segment_spectra(x: np.ndarray, length: int, step: int) -> np.ndarray:
    """Fourier transforms of segments of a record, each less its mean and under a Hann window.

    Shapes: x (N,); returns (segments, length // 2 + 1).
    """
    segments = np.lib.stride_tricks.sliding_window_view(x, length)[::step]
    deviations = segments - segments.mean(axis=1, keepdims=True)
    return np.fft.rfft(deviations * np.hanning(length), axis=1)


def coherence(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Squared coherence of two signals, from the transforms of their segments.

    Shapes: x, y (segments, F); returns (F,).
    """
    cross = np.mean(x * y.conj(), axis=0)
    power_x = np.mean(np.abs(x) ** 2, axis=0)
    power_y = np.mean(np.abs(y) ** 2, axis=0)
    return np.abs(cross) ** 2 / np.maximum(power_x * power_y, TINY)


def smooth(power: np.ndarray, width: float) -> np.ndarray:
    """Smooth a periodogram with a Hann window; it is mirrored at its ends.

    Shapes: power (F,); returns (F,).
    """
    window = _window(width, power.size)
    mirrored = np.pad(power, window.size // 2, mode="reflect")
    return np.convolve(mirrored, window, mode="valid")


def _window(width: float, size: int) -> np.ndarray:
    """Hann window of unit sum, no longer than the periodogram allows."""
    half = int(min(max(4, round(width)), size - 1))
    window = np.hanning(2 * half + 3)[1:-1]
    return window / window.sum()
