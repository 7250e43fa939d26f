"""Spectra of records: tapered transforms within a band, and smooth noise spectra."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import accumulate
from math import inf

import numpy as np
from scipy.fft import irfft, rfft

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
        return rfft(tapered, axis=-1)[..., self.bins]

    def signals(self, spectra: np.ndarray) -> np.ndarray:
        """Signals whose transforms are given within the band and zero elsewhere, shape (..., samples)."""
        below = np.zeros((*spectra.shape[:-1], self.bins.start))
        return irfft(np.concatenate([below, spectra], axis=-1), self.samples, axis=-1)

    def correlate(self, cross: np.ndarray, reach: int) -> np.ndarray:
        """Sums of cross spectra at lags that are 1/(2 b) apart in a band of width b, shape (2 reach + 1,)."""
        size = 2 * self.bins.stop
        padded = np.pad(cross, (self.bins.start, 1))
        return 0.5 * size * irfft(padded, size)[np.arange(-reach, reach + 1)]

    def smooth(self, power: np.ndarray, resolution: float) -> np.ndarray:
        """Smooth a periodogram over a width in frequency.

        Shapes: power (frequencies,); returns (frequencies,).
        """
        return smooth(power, resolution * self.samples / self.rate)

    def smoothing_variance(self, resolution: float) -> float:
        """Variance of a smoothed periodogram over its square."""
        window = _window(resolution * self.samples / self.rate, self.frequency.size)
        return float(self.correlation * np.sum(window**2))


@dataclass(frozen=True)
class Bands:
    """Fourier transforms of several records: their samples one after the other, their frequencies side by side.

    Each record has its own mean and taper. What is smoothed over frequency is the mean over the records.
    """

    parts: tuple[Band, ...]  # one for each record

    @property
    def highest(self) -> float:
        """Upper edge of the band [Hz]."""
        return self.parts[0].highest

    @property
    def samples(self) -> int:
        """Number of samples."""
        return sum(part.samples for part in self.parts)

    @property
    def rate(self) -> float:
        """Sampling rate [Hz]."""
        return self.parts[0].rate

    @cached_property
    def frequency(self) -> np.ndarray:
        """Frequencies of all records [Hz], shape (frequencies,)."""
        return np.concatenate([part.frequency for part in self.parts])

    @cached_property
    def s(self) -> np.ndarray:
        """Laplace variable on the imaginary axis [rad/s], shape (frequencies,)."""
        return 2j * np.pi * self.frequency

    @cached_property
    def correlation(self) -> float:
        """Factor by which the tapers raise variances."""
        factors = [part.correlation for part in self.parts]
        return float(np.average(factors, weights=[part.samples for part in self.parts]))

    def transform(self, x: np.ndarray) -> np.ndarray:
        """Fourier transforms of tapered records less their means.

        Shapes: x (..., samples); returns (..., frequencies).
        """
        pairs = self._split_samples(x)
        return np.concatenate([part.transform(values) for part, values in pairs], axis=-1)

    def signals(self, spectra: np.ndarray) -> np.ndarray:
        """Signals of transforms that are zero beyond the band, shape (..., samples)."""
        pairs = self._split_spectra(spectra)
        return np.concatenate([part.signals(values) for part, values in pairs], axis=-1)

    def weigh_samples(self, spectra: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Transforms of signals of which each sample has a weight.

        Shapes: spectra (..., frequencies), weights (samples,); returns (..., frequencies).
        """
        pairs = self._split_samples(weights * self.signals(spectra))
        parts = [rfft(values, axis=-1)[..., part.bins] for part, values in pairs]
        return np.concatenate(parts, axis=-1)

    def centre(self, x: np.ndarray) -> np.ndarray:
        """A signal less its mean in each record, shape (samples,)."""
        return np.concatenate([values - values.mean() for _, values in self._split_samples(x)])

    def contributions(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """What each time contributes to the products of spectra, of which the sum over frequencies has the real part.

        Shapes: first, second (..., frequencies); returns (..., samples).
        """
        sizes = [part.samples for part in self.parts]
        return 0.5 * np.repeat(sizes, sizes) * (self.signals(first) * self.signals(second))

    def correlate(self, cross: np.ndarray, reach: int) -> np.ndarray:
        """Sums of cross spectra at lags that are 1/(2 b) apart in a band of width b, shape (2 reach + 1,)."""
        products = [part.correlate(values, reach) for part, values in self._split_spectra(cross)]
        return np.sum(products, axis=0)

    @cached_property
    def longest(self) -> Band:
        """The band of the longest record."""
        return max(self.parts, key=lambda part: part.samples)

    def average(self, power: np.ndarray, resolution: float) -> np.ndarray:
        """Mean of the smoothed power spectral densities, the records weighing as they are long.

        Shapes: power (frequencies,); returns as the frequencies of the longest record.
        """
        frequency = self.longest.frequency
        total = np.zeros(frequency.size)
        for part, values in self._split_spectra(power):
            density = part.smooth(values, resolution) / part.density
            share = part.samples / self.samples
            total += share * np.interp(frequency, part.frequency, density)
        return total

    def smooth(self, power: np.ndarray, resolution: float) -> np.ndarray:
        """Smooth the mean periodogram, shape (frequencies,)."""
        mean = self.average(power, resolution)
        frequency = self.longest.frequency
        densities = [np.interp(part.frequency, frequency, mean) for part in self.parts]
        pairs = zip(self.parts, densities, strict=True)
        return np.concatenate([part.density * density for part, density in pairs])

    def smoothing_variance(self, resolution: float) -> float:
        """Variance of a smoothed mean periodogram over its square."""
        shares = np.array([part.samples / self.samples for part in self.parts])
        variances = [part.smoothing_variance(resolution) for part in self.parts]
        return float(np.sum(shares**2 * variances))

    def _split_samples(self, x: np.ndarray) -> list[tuple[Band, np.ndarray]]:
        """Each band with the signals of its record."""
        return self._split(x, [part.samples for part in self.parts])

    def _split_spectra(self, spectra: np.ndarray) -> list[tuple[Band, np.ndarray]]:
        """Each band with the spectra of its record."""
        return self._split(spectra, [part.frequency.size for part in self.parts])

    def _split(self, values: np.ndarray, sizes: Sequence[int]) -> list[tuple[Band, np.ndarray]]:
        """Each band with its part of values along their last axis."""
        stops = accumulate(sizes)
        return [
            (part, values[..., stop - size : stop])
            for part, size, stop in zip(self.parts, sizes, stops, strict=True)
        ]


@lru_cache(maxsize=8)
def pass_band(samples: int, rate: float, highest: float = inf) -> Band:
    """The band of an identification: from 0.05 Hz to the end of the pass band of the decimation, or to a lower one."""
    return Band(samples, rate, lowest=LOWEST_FREQUENCY, highest=min(highest, PASSBAND * rate))


def pass_bands(sizes: Sequence[int], rate: float, highest: float = inf) -> Bands:
    """The band of an identification from records of so many samples."""
    return Bands(tuple(pass_band(samples, rate, highest) for samples in sizes))


def segment_spectra(records: Sequence[np.ndarray], length: int, step: int) -> np.ndarray:
    """Fourier transforms of segments of records that are long enough, each less its mean and under a Hann window.

    Shapes: records (N,); returns (segments, length // 2 + 1).
    """
    segments = np.concatenate(
        [
            np.lib.stride_tricks.sliding_window_view(record, length)[::step]
            for record in records
            if record.size >= length
        ]
    )
    deviations = segments - segments.mean(axis=1, keepdims=True)
    return rfft(deviations * np.hanning(length), axis=1)


def mean_power(spectra: np.ndarray) -> np.ndarray:
    """Mean squared magnitude over segments, shape (F,)."""
    return np.mean(np.abs(spectra) ** 2, axis=0)


def coherence(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Squared coherence of two signals, from the transforms of their segments.

    Shapes: x, y (segments, F); returns (F,).
    """
    cross = np.mean(x * y.conj(), axis=0)
    return np.abs(cross) ** 2 / np.maximum(mean_power(x) * mean_power(y), TINY)


def smooth(power: np.ndarray, width: float) -> np.ndarray:
    """Smooth a periodogram with a Hann window; it is mirrored at its ends.

    Shapes: power (F,); returns (F,).
    """
    window = _window(width, power.size)
    half = window.size // 2
    mirrored = np.concatenate([power[half:0:-1], power, power[-2 : -half - 2 : -1]])
    return np.convolve(mirrored, window, mode="valid")


@lru_cache(maxsize=64)
def _window(width: float, size: int) -> np.ndarray:
    """Hann window of unit sum, no longer than the periodogram allows."""
    half = int(min(max(4, round(width)), size - 1))
    window = np.hanning(2 * half + 3)[1:-1]
    return window / window.sum()
