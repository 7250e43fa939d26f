"""Equations of `riv-tv`: whitened regressors and instruments, less what repeats with the cycle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.fft import irfft, rfft

from ankleloop.joint.dynamics import ReflexDynamics
from ankleloop.joint.time_varying_course import Splines
from ankleloop.methods.time_varying_inputs import MEAN_SPLINES, TimeVaryingInputs
from ankleloop.signals.spectra import pass_band

RESOLUTION, FEWEST_BINS = 0.4, 20  # Hz, and frequencies, over which the noise spectrum is smoothed
NOISE_SPLINES = 8  # of the level of the noise
LOWEST_LEVEL = 0.05  # of the mean level of the noise
POWER_FLOOR = 1e-10  # of the largest power of the noise
CONSTANT = Splines(1, periodic=False, degree=0)


@dataclass(frozen=True)
class Bases:
    """Splines of K, B, G and I."""

    stiffness: Splines  # splines of K
    viscosity: Splines  # splines of B
    gain: Splines  # splines of G
    inertia: Splines = CONSTANT  # splines of I; by default it is constant

    @property
    def all(self) -> tuple[Splines, Splines, Splines, Splines]:
        """The four of them, in the order of `names`."""
        return self.stiffness, self.viscosity, self.gain, self.inertia

    @property
    def names(self) -> tuple[str, ...]:
        """Those that vary: K, B, G, and I where it does."""
        return ("K", "B", "G") if self.inertia.size == 1 else ("K", "B", "G", "I")

    @cached_property
    def blocks(self) -> tuple[slice, slice, slice, slice]:
        """Places of the coefficients of K, B, G and I among the linear parameters; those of G come last."""
        k, b, g, i = (splines.size for splines in self.all)
        return slice(0, k), slice(k, k + b), slice(k + b + i, k + b + i + g), slice(k + b, k + b + i)

    @property
    def size(self) -> int:
        """Number of linear parameters."""
        return self.blocks[2].stop

    def penalty(self, weights: np.ndarray) -> np.ndarray:
        """Weighted sum of the penalties, shape (size, size)."""
        matrix = np.zeros((self.size, self.size))
        for splines, block, weight in zip(self.all, self.blocks, weights, strict=True):
            matrix[block, block] = weight * splines.penalty
        return matrix


@dataclass(frozen=True, eq=False)
class TimeVaryingParameters:
    """Coefficients of K, B, I and G, dynamics of the reflex, and what delays add."""

    linear: np.ndarray  # shape (size,): coefficients of K, B, I and G
    dynamics: ReflexDynamics  # dynamics of the reflex
    shift: float = 0.0  # delay of the reflex less that of the inputs [s]
    lag: float = 0.0  # lag of the torque channel behind the position [s]


@dataclass(frozen=True, eq=False)
class WhitenedSystem:
    """Whitened instruments, regressors and residual at some parameters."""

    # Shape (unknowns, rows): derivatives of the torque with respect to the unknowns, by the predicted inputs.
    instruments: np.ndarray
    regressors: np.ndarray  # the same by the measured inputs
    torque: np.ndarray  # shape (rows,): whitened torque
    share: float  # share of the frequencies that count: so many independent values a sample has

    @cached_property
    def normal(self) -> np.ndarray:
        """Products of instruments and regressors."""
        return self.instruments @ self.regressors.T

    @cached_property
    def information(self) -> np.ndarray:
        """Products of the instruments."""
        if self.instruments is self.regressors:
            return self.normal
        return self.instruments @ self.instruments.T

    @cached_property
    def side(self) -> np.ndarray:
        """Products of instruments and torque."""
        return self.instruments @ self.torque

    def residual(self, linear: np.ndarray) -> np.ndarray:
        """Whitened torque less that of linear parameters, shape (rows,)."""
        return self.torque - linear @ self.regressors[: linear.size]


class TimeVaryingEquations:
    """Spectra of regressors and instruments of a trial, from which whitened systems are made.

    Parameters
    ----------
    inputs : TimeVaryingInputs
        Inputs of the trial.
    bases : Bases
        Splines of K, B, G and I.
    delay : float
        Reflex delay of the inputs [s].
    order : {2, 3}
        Poles of the reflex dynamics.
    estimate_delay : bool
        Whether the delay of the reflex is an unknown.
    torque_lag : float or None
        Lag of the torque behind the position [s]; None makes it an unknown.
    weighting : {"noise", "flat"}
        Weights of frequencies and of phases.
    """

    def __init__(
        self,
        inputs: TimeVaryingInputs,
        bases: Bases,
        delay: float,
        *,
        order: int = 2,
        estimate_delay: bool,
        torque_lag: float | None,
        weighting: str,
    ) -> None:
        self.inputs, self.bases, self.delay = inputs, bases, delay
        self.order, self.estimate_delay, self.weighting = order, estimate_delay, weighting
        self.torque_lag, self.estimate_lag = torque_lag or 0.0, torque_lag is None
        self.rows = inputs.course.rows
        samples = self.rows.stop - self.rows.start
        self.band = pass_band(samples, inputs.rate)
        self.resolution = max(RESOLUTION, FEWEST_BINS * inputs.rate / samples)
        self.frequency = np.abs(inputs.s) / (2 * np.pi)
        self.inside = (self.frequency >= self.band.lowest) & (self.frequency <= self.band.highest)
        self.torque = inputs.spectra(inputs.torque[None])[0]
        self.place = [splines(inputs.course.place) for splines in bases.all]
        self.motion = self._motion_spectra(inputs.motion)
        own = inputs.own_instruments
        self.predicted_motion = self.motion if own else self._motion_spectra(inputs.predicted_motion)
        self._set_drives()

    def _set_drives(self) -> None:
        inputs = self.inputs
        self.drive = self._drive_spectra(inputs.drive(self.delay))
        own = inputs.own_instruments
        self.predicted_drive = self.drive if own else self._drive_spectra(inputs.predicted_drive(self.delay))

    def move_delay(self, parameters: TimeVaryingParameters) -> TimeVaryingParameters:
        """Make the inputs anew for the delay that was estimated: a delay behind the splines would move G over phase."""
        self.delay += parameters.shift
        self._set_drives()
        return replace(parameters, shift=0.0)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the unknowns that are not linear."""
        lag = ("torque_lag",) if self.estimate_lag else ()
        poles = ("omega_n", "zeta", "pole")[: self.order]
        return (*poles, *(("delay",) if self.estimate_delay else ()), *lag)

    @cached_property
    def mean_weights(self) -> list[np.ndarray]:
        """Weights of the splines of K, B, G and I in their means over the record."""
        place = self.inputs.course.place[self.rows]
        return [splines(place).mean(axis=0) for splines in self.bases.all]

    def means(self, linear: np.ndarray) -> dict[str, float]:
        """Means of K, B, G and I over the record, of their coefficients."""
        parts = zip("KBGI", self.mean_weights, self.bases.blocks, strict=True)
        return {name: float(weights @ linear[block]) for name, weights, block in parts}

    def _motion_spectra(self, motion: np.ndarray) -> np.ndarray:
        position, velocity, acceleration = motion
        columns = np.vstack([self.place[0].T * position, self.place[1].T * velocity, self.place[3].T * acceleration])
        return self.inputs.spectra(columns)

    def _drive_spectra(self, drive: np.ndarray) -> np.ndarray:
        return self.inputs.spectra(self.place[2].T * drive)

    def responses(self, parameters: TimeVaryingParameters) -> tuple[np.ndarray, np.ndarray]:
        """Response of the reflex, and its derivatives with respect to its dynamics and to its delay."""
        s = self.inputs.s
        response, derivatives = parameters.dynamics.response(s)
        rows = np.array([*derivatives, -s * response] if self.estimate_delay else derivatives)
        if parameters.shift:
            delay = np.exp(-s * parameters.shift)
            response, rows = delay * response, delay * rows
        return response, rows

    def _derivatives(
        self, motion: np.ndarray, drive: np.ndarray, parameters: TimeVaryingParameters, weight: np.ndarray
    ) -> np.ndarray:
        """Weighted derivatives of the torque with respect to the unknowns, as signals, shape (unknowns, rows)."""
        response, rows = self.responses(parameters)
        gain = parameters.linear[self.bases.blocks[2]]
        reflex = gain @ drive
        spectra = [weight * motion, (weight * response) * drive, rows * (weight * reflex)]
        if self.estimate_lag:
            intrinsic = parameters.linear[: len(motion)] @ motion
            spectra.append((-self.inputs.s * weight * (intrinsic + response * reflex))[None])
        return irfft(np.vstack(spectra), self.inputs.size, axis=1)[:, self.rows]

    def system(self, parameters: TimeVaryingParameters, weight: np.ndarray, level: np.ndarray) -> WhitenedSystem:
        """Whitened system at some parameters.

        Shapes: weight (frequencies,), level (rows,).
        """
        torque = self.lead(parameters) * weight
        locked = self._locked_part(weight, level)
        regressors = self._derivatives(self.motion, self.drive, parameters, weight)
        y = irfft(torque, self.inputs.size)[self.rows]
        own = self.inputs.own_instruments
        instruments = (
            None if own else self._derivatives(self.predicted_motion, self.predicted_drive, parameters, weight)
        )
        regressors, y = locked(regressors), locked(y[None])[0]
        return WhitenedSystem(
            regressors if instruments is None else locked(instruments), regressors, y, float(np.mean(self.inside))
        )

    def lead(self, parameters: TimeVaryingParameters) -> np.ndarray:
        """Transform of the torque, ahead by its lag."""
        return self.torque * np.exp(self.inputs.s * parameters.lag) if parameters.lag else self.torque

    def whitener(self, weight: np.ndarray, level: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """Function that makes whitened signals, shape (signals, rows), of spectra."""
        locked = self._locked_part(weight, level)
        return lambda spectra: locked(irfft(weight * spectra, self.inputs.size, axis=1)[:, self.rows])

    def _locked_part(self, weight: np.ndarray, level: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """Function that takes what repeats with the cycle out of whitened signals, and divides them by the level."""
        course = self.inputs.course
        if length := course.equal_cycles:

            def remove(x: np.ndarray) -> np.ndarray:
                folded = x.reshape(len(x), -1, length)
                return (folded - folded.mean(axis=1, keepdims=True)).reshape(len(x), -1) / level

            return remove
        splines = Splines(MEAN_SPLINES, course.periodic)(course.place).T
        white = irfft(weight * rfft(splines, self.inputs.size, axis=1), self.inputs.size, axis=1)[:, self.rows]
        white = white / level
        values, vectors = np.linalg.eigh(white @ white.T)
        large = values > 1e-12 * values[-1]
        directions = (vectors[:, large] / np.sqrt(values[large])).T @ white

        def project(x: np.ndarray) -> np.ndarray:
            x = x / level
            return x - (x @ directions.T) @ directions

        return project

    def locked_dimension(self) -> int:
        """Number of parameters of what repeats with the cycle, or changes slowly."""
        return self.inputs.course.equal_cycles or MEAN_SPLINES

    def torques(self, parameters: TimeVaryingParameters) -> tuple[np.ndarray, np.ndarray]:
        """Intrinsic and reflex torque less what repeats with the cycle, two arrays of shape (N,)."""
        response, _ = self.responses(parameters)
        intrinsic = parameters.linear[: len(self.motion)] @ self.motion
        reflex = response * (parameters.linear[self.bases.blocks[2]] @ self.drive)
        both = irfft(np.stack([intrinsic, reflex]), self.inputs.size, axis=1)[:, : self.inputs.grid.samples]
        return both[0], both[1]

    def noise(self, parameters: TimeVaryingParameters) -> np.ndarray:
        """Residual torque less what repeats with the cycle, shape (rows,)."""
        torque = irfft(self.lead(parameters), self.inputs.size)[self.rows]
        residual = torque - np.sum([part[self.rows] for part in self.torques(parameters)], axis=0)
        ones = np.ones(self.frequency.size)
        return self._locked_part(ones, np.ones(residual.size))(residual[None])[0]

    def spectrum(self, noise: np.ndarray) -> np.ndarray:
        """Smoothed spectrum of the noise at the frequencies of the band [(N·m)²], white noise having its variance."""
        power = self.band.smooth(np.abs(self.band.transform(noise)) ** 2, self.resolution)
        power = power / np.sum(self.band.taper**2)
        return np.maximum(power, POWER_FLOOR * power.max())

    def colour(self, signals: np.ndarray, residual: np.ndarray) -> np.ndarray:
        """Whitened signals with the spectrum of a whitened residual over its mean, shape (signals, rows).

        Noise weights leave about white noise, flat ones its colour.
        """
        spectrum = self.spectrum(residual)
        frequency = np.fft.rfftfreq(residual.size, 1.0 / self.inputs.rate)
        power = np.interp(frequency, self.band.frequency, spectrum / spectrum.mean(), left=0.0, right=0.0)
        return irfft(np.sqrt(power) * rfft(signals, axis=1), residual.size, axis=1)

    def weight(self, noise: np.ndarray) -> np.ndarray:
        """Weight of each frequency, the inverse root of the spectrum of the noise, shape (frequencies,)."""
        spectrum = self.spectrum(noise)
        if self.weighting == "flat":
            spectrum = np.full(spectrum.size, spectrum.mean())
        values = 1.0 / np.sqrt(np.interp(self.frequency, self.band.frequency, spectrum))
        return np.where(self.inside, values, 0.0)

    def level(self, noise: np.ndarray, weight: np.ndarray) -> np.ndarray:
        """Standard deviation of the whitened noise over its mean, a function of the place, shape (rows,)."""
        rows = self.rows
        if self.weighting == "flat":
            return np.ones(noise.size)
        padded = np.zeros(self.inputs.grid.samples)
        padded[rows] = noise
        white = irfft(weight * rfft(padded, self.inputs.size), self.inputs.size)[rows]
        splines = Splines(NOISE_SPLINES, self.inputs.course.periodic)(self.inputs.course.place[rows])
        values = splines @ np.linalg.lstsq(splines, white**2, rcond=1e-6)[0]
        mean = float(np.mean(white**2))
        return np.sqrt(np.maximum(values, LOWEST_LEVEL * mean) / mean)

    @property
    def smoothing_variance(self) -> float:
        """Variance of the smoothed spectrum over its square; zero for flat weights."""
        return self.band.smoothing_variance(self.resolution) if self.weighting == "noise" else 0.0
