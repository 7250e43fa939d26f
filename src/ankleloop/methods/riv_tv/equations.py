"""Equations of `riv-tv`: whitened regressors and instruments, less what repeats with the cycle."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.fft import irfft, rfft

from ankleloop.joint.time_varying_course import Splines
from ankleloop.methods.riv.equations import Parameters
from ankleloop.methods.riv_tv.inputs import Motion, TimeVaryingInputs
from ankleloop.signals.spectra import pass_band

RESOLUTION, FEWEST_BINS = 0.4, 20  # Hz, and frequencies, over which the noise spectrum is smoothed
NOISE_SPLINES = 8  # of the level of the noise
LOWEST_LEVEL = 0.05  # of the mean level of the noise
POWER_FLOOR = 1e-10  # of the largest power of the noise
CONSTANT = Splines(1, periodic=False, degree=0)


class Bases:
    """Splines of K, B, G and I; those of I are `CONSTANT` where it does not vary."""

    def __init__(self, splines: tuple[Splines, Splines, Splines, Splines]) -> None:
        self.all = splines
        k, b, g, i = (part.size for part in splines)
        self.names = "KBG" if i == 1 else "KBGI"  # of those that vary
        self.size = k + b + i + g  # number of linear parameters
        # Places of the coefficients of K, B, G and I among the linear parameters; those of G come last.
        self.blocks = slice(0, k), slice(k, k + b), slice(k + b + i, self.size), slice(k + b, k + b + i)

    def penalty(self, weights: np.ndarray, unknowns: int) -> np.ndarray:
        """Weighted sum of the penalties, shape (unknowns, unknowns)."""
        matrix = np.zeros((unknowns, unknowns))
        for splines, block, weight in zip(self.all, self.blocks, weights, strict=True):
            matrix[block, block] = weight * splines.penalty
        return matrix


class WhitenedSystem:
    """Whitened equations at some parameters."""

    def __init__(self, instruments: np.ndarray, regressors: np.ndarray, torque: np.ndarray) -> None:
        # Shape (unknowns, rows): derivatives of the torque with respect to the unknowns, by the predicted inputs and by
        # the measured ones.
        self.instruments, self.regressors = instruments, regressors
        self.torque = torque  # shape (rows,)
        self.normal, self.side = instruments @ regressors.T, instruments @ torque
        self.information = self.normal if instruments is regressors else instruments @ instruments.T

    def residual(self, linear: np.ndarray) -> np.ndarray:
        """Whitened torque less that of linear parameters, shape (rows,)."""
        return self.torque - linear @ self.regressors[: linear.size]


class TimeVaryingEquations:
    """Spectra of regressors and instruments of a trial for a delay of the reflex; whitened systems are made of them."""

    def __init__(self, inputs: TimeVaryingInputs, bases: Bases, delay: float, weighting: str = "noise") -> None:
        self.inputs, self.bases, self.weighting = inputs, bases, weighting
        self.rows = inputs.course.rows
        samples = self.rows.stop - self.rows.start
        self.band = pass_band(samples, inputs.rate)
        self.resolution = max(RESOLUTION, FEWEST_BINS * inputs.rate / samples)
        # Variance of the smoothed spectrum over its square; zero for flat weights.
        self.smoothing_variance = self.band.smoothing_variance(self.resolution) if weighting == "noise" else 0.0
        self.frequency = np.abs(inputs.s) / (2 * np.pi)
        self.inside = (self.frequency >= self.band.lowest) & (self.frequency <= self.band.highest)
        self.share = float(np.mean(self.inside))  # so many independent values a whitened sample has
        torque = inputs.trial.channel("torque", inputs.grid)
        self.torque = inputs.spectra(torque - torque.mean())
        k, b, self._gain, i = (splines(inputs.course.place).T for splines in bases.all)
        # Weights of the splines of K, B, G and I in their means over the record.
        self.mean_weights = [rows[:, self.rows].mean(axis=1) for rows in (k, b, self._gain, i)]
        self.measured = inputs.measure()
        self.predicted = inputs.predict(self.measured)
        self.own_instruments = self.predicted is self.measured
        for motion in {self.measured, self.predicted}:
            position, velocity, acceleration = motion.signals
            motion.spectra = inputs.spectra(np.vstack([k * position, b * velocity, i * acceleration]))
        self.set_delay(delay)

    def set_delay(self, delay: float) -> None:
        """Make the inputs of the reflex for a delay: one that acts behind the splines would move G over phase."""
        self.delay = delay
        for motion in {self.measured, self.predicted}:
            motion.drive = self.inputs.spectra(self._gain * motion.rectify(delay))

    def means(self, linear: np.ndarray) -> dict[str, float]:
        """Means of K, B, G and I over the record, of their coefficients."""
        parts = zip("KBGI", self.mean_weights, self.bases.blocks, strict=True)
        return {name: float(weights @ linear[block]) for name, weights, block in parts}

    def predict_torque(self, parameters: Parameters, motion: Motion) -> np.ndarray:
        """Transform of the torque of the model."""
        return parameters.torque(motion.spectra, motion.drive, self.inputs.s)

    def system(self, parameters: Parameters, whiten: Callable[[np.ndarray], np.ndarray]) -> WhitenedSystem:
        """System at some parameters, whitened by a function of `whitener`."""

        def differentiate(motion: Motion) -> np.ndarray:
            return whiten(parameters.differentiate(motion.spectra, motion.drive, self.inputs.s))

        regressors = differentiate(self.measured)
        instruments = regressors if self.own_instruments else differentiate(self.predicted)
        return WhitenedSystem(instruments, regressors, whiten(self.lead(parameters)))

    def lead(self, parameters: Parameters) -> np.ndarray:
        """Transform of the torque, ahead by its lag."""
        return self.torque * np.exp(self.inputs.s * parameters.lag) if parameters.lag else self.torque

    def whitener(self, weight: np.ndarray, level: np.ndarray | float = 1.0) -> Callable[[np.ndarray], np.ndarray]:
        """Function that makes signals, shape (..., rows), of spectra, and takes out of them what repeats.

        Frequencies are multiplied by a weight, and times divided by a level.

        Shapes: weight (frequencies,), level (rows,).
        """
        length, size = self.inputs.course.equal_cycles, self.inputs.size

        def weigh(spectra: np.ndarray) -> np.ndarray:
            return irfft(weight * spectra, size)[..., self.rows]

        def remove_mean(spectra: np.ndarray) -> np.ndarray:
            signals = weigh(spectra)
            cycles = signals.reshape(*signals.shape[:-1], -1, length)
            return (cycles - cycles.mean(axis=-2, keepdims=True)).reshape(signals.shape) / level

        def project(spectra: np.ndarray) -> np.ndarray:
            signals = weigh(spectra) / level
            return signals - (signals @ directions.T) @ directions

        if length:
            return remove_mean
        white = weigh(rfft(self.inputs.splines.T, size)) / level
        values, vectors = np.linalg.eigh(white @ white.T)
        large = values > 1e-12 * values[-1]
        directions = (vectors[:, large] / np.sqrt(values[large])).T @ white
        return project

    def noise(self, parameters: Parameters) -> np.ndarray:
        """Residual torque less what repeats with the cycle, shape (rows,)."""
        residual = self.lead(parameters) - self.predict_torque(parameters, self.measured)
        return self.whitener(np.ones(self.frequency.size))(residual)

    def noise_whitener(self, noise: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """Function that whitens noise: by the inverse of its spectrum, and of its level as a function of the place."""
        inputs, spectrum = self.inputs, self.spectrum(noise)
        if self.weighting == "flat":
            return self.whitener(np.where(self.inside, 1.0 / np.sqrt(spectrum.mean()), 0.0))
        weight = 1.0 / np.sqrt(np.interp(self.frequency, self.band.frequency, spectrum))
        weight = np.where(self.inside, weight, 0.0)
        padded = np.zeros(inputs.grid.samples)
        padded[self.rows] = noise
        power = irfft(weight * rfft(padded, inputs.size), inputs.size)[self.rows] ** 2
        splines = Splines(NOISE_SPLINES, inputs.course.periodic)(inputs.course.place[self.rows])
        values, mean = splines @ np.linalg.lstsq(splines, power, rcond=1e-6)[0], float(np.mean(power))
        return self.whitener(weight, np.sqrt(np.maximum(values, LOWEST_LEVEL * mean) / mean))

    def spectrum(self, noise: np.ndarray) -> np.ndarray:
        """Smoothed spectrum of the noise at the frequencies of the band [(N·m)²], white noise having its variance."""
        power = self.band.smooth(np.abs(self.band.transform(noise)) ** 2, self.resolution)
        power = power / np.sum(self.band.taper**2)
        return np.maximum(power, POWER_FLOOR * power.max())

    def colour(self, signals: np.ndarray, residual: np.ndarray) -> np.ndarray:
        """Whitened signals with the spectrum of a whitened residual over its mean, shape (..., rows).

        Noise weights leave about white noise, flat ones its colour.
        """
        spectrum = self.spectrum(residual)
        frequency = np.fft.rfftfreq(residual.size, 1.0 / self.inputs.rate)
        power = np.interp(frequency, self.band.frequency, spectrum / spectrum.mean(), left=0.0, right=0.0)
        return irfft(np.sqrt(power) * rfft(signals), residual.size)
