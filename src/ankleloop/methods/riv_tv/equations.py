"""Options of `riv-tv`, and its equations: whitened regressors and instruments, less what repeats with the cycle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, field_validator, model_validator
from scipy import linalg
from scipy.fft import irfft, next_fast_len, rfft

from ankleloop.errors import DataError
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.time_varying_course import Splines, make_course
from ankleloop.methods.method import NOMINAL_DELAY, RectifierOptions, RefinedOptions
from ankleloop.methods.riv.equations import DELAY_LIMITS, Parameters
from ankleloop.options import as_plain, option
from ankleloop.signals.decimation import PASSBAND, decimate, decimation_margin
from ankleloop.signals.spectra import pass_band, smooth

LEADS, LAGS = 0.15, 0.60  # s of the response to the reference
RIDGE = 1e-3  # of the power of the reference: it settles what lies beyond the pass band
FOLDS = 4
REFERENCE_RESOLUTION = 0.8  # Hz
MEAN_SPLINES = 24  # of what repeats with the cycle, or changes slowly
PADDING = 1.0  # s of zeros behind a record, in which responses end
RESOLUTION, FEWEST_BINS = 0.4, 20  # Hz, and frequencies, over which the noise spectrum is smoothed
NOISE_SPLINES = 8  # of the level of the noise
LOWEST_LEVEL = 0.05  # of the mean level of the noise
POWER_FLOOR = 1e-10  # of the largest power of the noise
Knots = Annotated[int, Field(ge=1, le=200)]


class RivTvOptions(RefinedOptions, RectifierOptions):
    """Options of refined instrumental variables for joints that change in time."""

    delay: float | None = option(
        NOMINAL_DELAY, "reflex delay; null estimates it", unit="s", ge=0, le=1
    )
    cycle_onsets: tuple[float, ...] | str | None = option(
        None,
        "start of every cycle, and end of the last one; or the variable that holds the phase, 0 to 1",
        unit="s",
    )
    schedule: str | None = option(
        None,
        "scheduling variable of the trial: K, B and G are functions of it; null without cycles: of time",
    )
    knots: tuple[Knots, Knots, Knots] = option(
        (12, 8, 12), "numbers of splines of K, B and G; penalties smooth them"
    )
    inertia_knots: Knots = option(
        1, "number of splines of I, of a posture or a limb that changes; 1 for a constant"
    )
    interpolation: Literal["cubic", "constant"] = option(
        "cubic",
        "cubic splines; or values that are constant over equal intervals, as of short segments",
    )
    torque_lag: float | None = option(
        0.0,
        "lag of the torque channel behind the position; null estimates it",
        unit="s",
        ge=-0.05,
        le=0.05,
    )
    rest_position: float | None = option(
        None,
        "position at which the elastic torque is zero; null: the mean position",
        unit="rad",
        ge=-10,
        le=10,
    )

    @field_validator("cycle_onsets", "knots", mode="before")
    @classmethod
    def _as_tuple(cls, values: Any) -> Any:
        """Numbers come as lists from YAML, and as arrays from NumPy."""
        values = np.asarray(values) if hasattr(values, "__array__") else values
        return (
            tuple(map(as_plain, values))
            if isinstance(values, (list, tuple, np.ndarray))
            else values
        )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.interpolation == "cubic" and (min(self.knots) < 4 or 1 < self.inertia_knots < 4):
            raise ValueError(
                f"knots of cubic splines must be at least 4, got {self.knots} and {self.inertia_knots}."
            )
        if self.cycle_onsets is not None and self.schedule is not None:
            raise ValueError(
                "cycle_onsets and schedule exclude each other: K, B and G are functions of one of them."
            )
        return self


@dataclass(eq=False)
class Motion:
    """Motion of the joint, measured or predicted, and its part of the equations."""

    signals: (
        np.ndarray
    )  # shape (3, N): position less what repeats or changes slowly, velocity and acceleration
    rectify: Callable[[float], np.ndarray]  # rectified velocity, shape (N,), by its delay
    # Transforms of the products with splines, of K, B and I, and of G: shapes (splines, frequencies).
    spectra: np.ndarray = field(init=False)
    drive: np.ndarray = field(init=False)


class Bases:
    """Splines of K, B, G and I; a single one is a constant."""

    def __init__(self, options: RivTvOptions, *, periodic: bool) -> None:
        k, b, g, i = counts = *options.knots, options.inertia_knots
        degree = 3 if options.interpolation == "cubic" else 0
        self.all = [Splines(count, periodic, degree if count > 1 else 0) for count in counts]
        self.names = "KBG" if i == 1 else "KBGI"  # of those that vary
        self.size = k + b + i + g  # number of linear parameters
        # Places of the coefficients of K, B, G and I among the linear parameters; those of G come last.
        self.blocks = (
            slice(0, k),
            slice(k, k + b),
            slice(k + b + i, self.size),
            slice(k + b, k + b + i),
        )

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
    """Spectra of regressors and instruments of a trial for a delay of the reflex; whitened systems are made of them.

    The instruments are made of the position that the reference predicts; the position itself as reference gives least
    squares.
    """

    def __init__(self, trial: PreparedTrial, options: RivTvOptions) -> None:
        delay, latest = (
            (NOMINAL_DELAY, DELAY_LIMITS[1])
            if options.delay is None
            else (options.delay, options.delay)
        )
        self.grid = grid = trial.grid(options.identification_rate, latest)
        self.course = course = make_course(trial, grid, options.cycle_onsets, options.schedule)
        self.bases = Bases(options, periodic=course.periodic)
        self.options, self.rows = options, course.rows
        self.rate = trial.rate / grid.factor  # of the decimated samples [Hz]
        # Length of the padded records that are transformed, and the Laplace variable at their frequencies [rad/s].
        self.size = int(next_fast_len(grid.samples + round(PADDING * self.rate), real=True))
        self.s = 2j * np.pi * np.fft.rfftfreq(self.size, 1.0 / self.rate)
        self.frequency = np.abs(self.s) / (2 * np.pi)
        samples = self.rows.stop - self.rows.start
        self.band = pass_band(samples, self.rate)
        self.resolution = max(RESOLUTION, FEWEST_BINS * self.rate / samples)
        # Variance of the smoothed spectrum over its square; zero for flat weights.
        self.smoothing_variance = (
            self.band.smoothing_variance(self.resolution) if options.weighting == "noise" else 0.0
        )
        self.inside = (self.frequency >= self.band.lowest) & (self.frequency <= self.band.highest)
        self.share = float(np.mean(self.inside))  # so many independent values a whitened sample has
        # Splines of what repeats or changes slowly, and the matrix that fits them to the samples that count.
        self.slow_splines = Splines(MEAN_SPLINES, course.periodic)(course.place)
        self._fit = linalg.pinv(self.slow_splines[self.rows], rtol=1e-6)
        self._slow_spectra = rfft(self.slow_splines.T, self.size)
        self._remove_repeated = self.whitener(np.ones(self.frequency.size))
        # Splines of the level of the noise, and the matrix that fits them.
        self._level_splines = Splines(NOISE_SPLINES, course.periodic)(course.place[self.rows])
        self._level_fit = linalg.pinv(self._level_splines, rtol=1e-6)
        self.position = trial.motion(grid)[0]
        self.slow = self.slow_part(self.position)
        signal = trial.channel(options.reference, grid)
        self.reference = signal - self.slow_part(
            signal
        )  # less what repeats or changes slowly, shape (N,)
        torque = trial.channel("torque", grid)
        self.torque = self.spectra(torque - torque.mean())
        k, b, self._gain, i = (splines(course.place).T for splines in self.bases.all)
        # Weights of the linear parameters in the means of K, B, I and G over the record, shape (4, parameters).
        self.mean_weights = linalg.block_diag(
            *(rows[:, self.rows].mean(axis=1) for rows in (k, b, i, self._gain))
        )
        signals = np.stack([self.position - self.slow, *trial.motion(grid)[1:]])
        self.measured = Motion(
            signals, lambda delay: decimate(np.maximum(0.0, trial.velocity(delay)), *grid)
        )
        self.predicted = self._predict()
        self.motions = list(dict.fromkeys([self.measured, self.predicted]))
        for motion in self.motions:
            position, velocity, acceleration = motion.signals
            motion.spectra = self.spectra(np.vstack([k * position, b * velocity, i * acceleration]))
        self.set_delay(delay)

    def _predict(self) -> Motion:
        """The motion that slow movement and reference explain; the measured one where the position is the reference."""
        if self.options.reference == "position":
            return self.measured
        factor, samples = self.grid.factor, self.grid.samples
        perturbation = predict_perturbation(self.measured.signals[0], self.reference, self.rate)
        velocity = self.s * rfft(self.slow - self.slow.mean() + perturbation, self.size)
        # Beyond the pass band of the decimation a derivative would only amplify.
        velocity[np.abs(self.s) > 2 * np.pi * 0.5 * (PASSBAND + 0.5) * self.rate] = 0.0

        def rectify(delay: float) -> np.ndarray:
            recorded = irfft(velocity * np.exp(-self.s * delay), factor * self.size) * factor
            margin, rectified = decimation_margin(factor), np.maximum(0.0, recorded)
            extended = np.concatenate([rectified[-margin:], rectified[: factor * samples + margin]])
            return decimate(extended, factor, margin, samples)

        derivatives = irfft(np.stack([velocity, self.s * velocity]), self.size)[:, :samples]
        return Motion(np.vstack([perturbation, derivatives]), rectify)

    def slow_part(self, x: np.ndarray) -> np.ndarray:
        """Part of signals that is a smooth function of the place, shape (..., N)."""
        return (x[..., self.rows] @ self._fit.T) @ self.slow_splines.T

    def spectra(self, signals: np.ndarray) -> np.ndarray:
        """Transforms of signals less what repeats with the cycle, or changes slowly.

        What repeats is far larger than what does not. It goes before any filter, whose response to the ends of the
        record would reach into the samples that count.

        Shapes: signals (..., N); returns (..., frequencies).
        """
        rows, length = self.rows, self.course.equal_cycles
        if length:
            mean = signals[..., rows].reshape(*signals.shape[:-1], -1, length).mean(axis=-2)
            repeated = mean[..., (np.arange(signals.shape[-1]) - rows.start) % length]
        else:
            repeated = self.slow_part(signals)
        return rfft(signals - repeated, self.size)

    def set_delay(self, delay: float) -> None:
        """Make the inputs of the reflex for a delay: one that acts behind the splines would move G over phase."""
        self.delay = delay
        for motion in self.motions:
            motion.drive = self.spectra(self._gain * motion.rectify(delay))

    def means(self, linear: np.ndarray) -> dict[str, float]:
        """Means of K, B, I and G over the record, of their coefficients."""
        return dict(zip("KBIG", (self.mean_weights @ linear).tolist(), strict=True))

    def system(
        self, parameters: Parameters, whiten: Callable[[np.ndarray], np.ndarray]
    ) -> WhitenedSystem:
        """System at some parameters, whitened by a function of `whitener`."""
        rows = [
            whiten(parameters.differentiate(motion.spectra, motion.drive, self.s))
            for motion in self.motions
        ]
        return WhitenedSystem(rows[-1], rows[0], whiten(self.lead(parameters)))

    def lead(self, parameters: Parameters) -> np.ndarray:
        """Transform of the torque, ahead by its lag."""
        return self.torque * np.exp(self.s * parameters.lag) if parameters.lag else self.torque

    def whitener(
        self, weight: np.ndarray, level: np.ndarray | float = 1.0
    ) -> Callable[[np.ndarray], np.ndarray]:
        """Function that makes signals, shape (..., rows), of spectra, and takes out of them what repeats.

        Frequencies are multiplied by a weight, and times divided by a level.

        Shapes: weight (frequencies,), level (rows,).
        """
        length, size = self.course.equal_cycles, self.size

        def whiten(spectra: np.ndarray) -> np.ndarray:
            signals = irfft(weight * spectra, size)[..., self.rows]
            if length:
                cycles = signals.reshape(*signals.shape[:-1], -1, length)
                return (cycles - cycles.mean(axis=-2, keepdims=True)).reshape(signals.shape) / level
            signals = signals / level
            return signals - (signals @ directions.T) @ directions

        if not length:
            directions = np.zeros(
                (1, self.rows.stop - self.rows.start)
            )  # of what repeats or changes slowly
            white = whiten(self._slow_spectra)
            values, vectors = np.linalg.eigh(white @ white.T)
            large = values > 1e-12 * values[-1]
            directions = (vectors[:, large] / np.sqrt(values[large])).T @ white
        return whiten

    def noise_whitener(self, parameters: Parameters) -> Callable[[np.ndarray], np.ndarray]:
        """Function that whitens noise: by the inverse of its spectrum, and of its level as a function of the place.

        The noise is the residual torque less what repeats with the cycle.
        """
        residual = self.lead(parameters) - parameters.torque(
            self.measured.spectra, self.measured.drive, self.s
        )
        noise = self._remove_repeated(residual)
        spectrum = self.spectrum(noise)
        if self.options.weighting == "flat":
            return self.whitener(np.where(self.inside, 1.0 / np.sqrt(spectrum.mean()), 0.0))
        weight = np.where(
            self.inside,
            1.0 / np.sqrt(np.interp(self.frequency, self.band.frequency, spectrum)),
            0.0,
        )
        padded = np.zeros(self.grid.samples)
        padded[self.rows] = noise
        power = irfft(weight * rfft(padded, self.size), self.size)[self.rows] ** 2
        values, mean = self._level_splines @ (self._level_fit @ power), float(np.mean(power))
        return self.whitener(weight, np.sqrt(np.maximum(values, LOWEST_LEVEL * mean) / mean))

    def spectrum(self, noise: np.ndarray) -> np.ndarray:
        """Smoothed spectrum of the noise at the frequencies of the band [(N·m)²], white noise having its variance."""
        power = self.band.smooth(np.abs(self.band.transform(noise)) ** 2, self.resolution) / np.sum(
            self.band.taper**2
        )
        return np.maximum(power, POWER_FLOOR * power.max())

    def colour(self, signals: np.ndarray, residual: np.ndarray) -> np.ndarray:
        """Whitened signals with the spectrum of a whitened residual over its mean, shape (..., rows).

        Noise weights leave about white noise, flat ones its colour.
        """
        spectrum = self.spectrum(residual)
        frequency = np.fft.rfftfreq(residual.size, 1.0 / self.rate)
        power = np.interp(
            frequency, self.band.frequency, spectrum / spectrum.mean(), left=0.0, right=0.0
        )
        return irfft(np.sqrt(power) * rfft(signals), residual.size)


def predict_perturbation(y: np.ndarray, x: np.ndarray, rate: float) -> np.ndarray:
    """What leads and lags of the reference explain of a signal; each quarter by the response of the other three.

    So no noise of a sample is part of its own instrument. The response is fitted twice, the second time to signals
    that are whitened, below the pass band, by the residual of the first.

    Shapes: y, x (N,); returns (N,).
    """
    padding = round(LAGS * rate), round(LEADS * rate)
    if y.size < 4 * (sum(padding) + 1):
        raise DataError(
            f"the record of {y.size / rate:.3g} s is too short for a response to the reference."
        )
    lagged = _shift(x, padding)
    residual = y - _predict_folds(lagged, y, lagged)
    size = int(next_fast_len(y.size + round(PADDING * rate), real=True))
    power = smooth(
        np.abs(rfft(residual - residual.mean(), size)) ** 2, REFERENCE_RESOLUTION * size / rate
    )
    weight = np.where(
        np.fft.rfftfreq(size) <= PASSBAND,
        1.0 / np.sqrt(np.maximum(power, 1e-10 * power.max())),
        0.0,
    )
    x, y = irfft(weight / weight.max() * rfft(np.stack([x, y]), size), size)[:, : y.size]
    return _predict_folds(_shift(x, padding), y, lagged)


def _shift(x: np.ndarray, padding: tuple[int, int]) -> np.ndarray:
    """Lags and leads of a signal, from the oldest lag to the furthest lead, shape (lags + leads + 1, N)."""
    return np.ascontiguousarray(
        np.lib.stride_tricks.sliding_window_view(np.pad(x, padding), x.size)
    )


def _predict_folds(lagged: np.ndarray, y: np.ndarray, source: np.ndarray) -> np.ndarray:
    """Each part of a signal by the leads and lags of a source and the response that the other parts have.

    Shapes: lagged, source (taps, N), y (N,); returns (N,).
    """
    edges = -(-y.size * np.arange(1, FOLDS) // FOLDS)
    parts = [np.split(signals, edges, axis=-1) for signals in (lagged, y, source)]
    grams = np.array([part @ part.T for part in parts[0]])
    sides = np.array([part @ target for part, target in zip(*parts[:2], strict=True)])
    gram, side = grams.sum(axis=0) - grams, sides.sum(axis=0) - sides
    ridge = RIDGE * np.einsum("fii->f", gram) / gram.shape[1]
    responses = np.linalg.solve(
        gram + ridge[:, None, None] * np.eye(gram.shape[1]), side[..., None]
    )[..., 0]
    return np.concatenate(
        [response @ part for response, part in zip(responses, parts[2], strict=True)]
    )
