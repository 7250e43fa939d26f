"""Inputs of a joint that changes in time: measured ones, those that the reference predicts, and checks of both."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy import linalg
from scipy.fft import irfft, next_fast_len, rfft

from ankleloop.errors import DataError
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.regressors import Grid
from ankleloop.joint.time_varying_course import Course, Splines
from ankleloop.signals.decimation import PASSBAND, decimate, decimation_margin
from ankleloop.signals.spectra import smooth

LEADS, LAGS = 0.15, 0.60  # s
RIDGE = 1e-3  # of the power of the reference: it settles what lies beyond the pass band
FOLDS = 4
RESOLUTION = 0.8  # Hz
MEAN_SPLINES = 24  # of what repeats with the cycle, or changes slowly
PADDING = 1.0  # s of zeros behind a record, in which responses end
LOCKED = 0.3  # share of the perturbation that has to differ from cycle to cycle
ROUNDS = 5
MOVEMENT_BAND, FLOOR_BAND = (0.6, 1.5), (2.0, 6.0)  # frequencies of a cycle, and those of the perturbation beside it
MOVEMENT_POWER = 8.0  # of a movement over that of the perturbation; by chance up to 5
SAME_PHASE = 0.9  # length of the mean of unit vectors
SLOW, LATEST, LATER = 1.0, 1.0, 0.1  # Hz; s; what another time explains more of the movement
FOLLOWED = 0.3  # of the slow movement, at least, by a schedule that it follows


@dataclass(eq=False)
class Motion:
    """Motion of the joint, measured or predicted, and its part of the equations."""

    signals: np.ndarray  # shape (3, N): position less what repeats or changes slowly, velocity and acceleration
    rectify: Callable[[float], np.ndarray]  # rectified velocity, shape (N,), by its delay
    # Transforms of the products with splines, of K, B and I, and of G: shapes (splines, frequencies).
    spectra: np.ndarray = field(init=False)
    drive: np.ndarray = field(init=False)


class TimeVaryingInputs:
    """Decimated signals of a trial, and the same of the position that the reference predicts.

    The position itself serves as reference for least squares.
    """

    def __init__(self, trial: PreparedTrial, grid: Grid, course: Course, reference_name: str) -> None:
        self.trial, self.grid, self.course, self.reference_name = trial, grid, course, reference_name
        self.rate = trial.rate / grid.factor  # of the decimated samples [Hz]
        # Length of the padded records that are transformed, and the Laplace variable at their frequencies [rad/s].
        self.size = int(next_fast_len(grid.samples + round(PADDING * self.rate), real=True))
        self.s = 2j * np.pi * np.fft.rfftfreq(self.size, 1.0 / self.rate)
        # Splines of what repeats or changes slowly, and the matrix that fits them to the samples that count.
        self.splines = Splines(MEAN_SPLINES, course.periodic)(course.place)
        self._fit = linalg.pinv(self.splines[course.rows], rtol=1e-6)
        self.position = trial.motion(grid)[0]
        self.slow = self.slow_part(self.position)
        reference = trial.channel(reference_name, grid)
        self.reference = reference - self.slow_part(reference)  # less what repeats or changes slowly, shape (N,)

    def measure(self) -> Motion:
        """The motion that was measured."""
        signals = np.stack([self.position - self.slow, *self.trial.motion(self.grid)[1:]])
        return Motion(signals, lambda delay: decimate(np.maximum(0.0, self.trial.velocity(delay)), *self.grid))

    def predict(self, measured: Motion) -> Motion:
        """The motion that slow movement and reference explain; the measured one where the position is the reference."""
        if self.reference_name == "position":
            return measured
        factor, samples = self.grid.factor, self.grid.samples
        perturbation = predict_perturbation(measured.signals[0], self.reference, self.rate)
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
        return (x[..., self.course.rows] @ self._fit.T) @ self.splines.T

    def spectra(self, signals: np.ndarray) -> np.ndarray:
        """Transforms of signals less what repeats with the cycle, or changes slowly.

        What repeats is far larger than what does not. It goes before any filter, whose response to the ends of the
        record would reach into the samples that count.

        Shapes: signals (..., N); returns (..., frequencies).
        """
        rows, length = self.course.rows, self.course.equal_cycles
        if length:
            mean = signals[..., rows].reshape(*signals.shape[:-1], -1, length).mean(axis=-2)
            repeated = mean[..., (np.arange(signals.shape[-1]) - rows.start) % length]
        else:
            repeated = self.slow_part(signals)
        return rfft(signals - repeated, self.size)


def predict_perturbation(y: np.ndarray, x: np.ndarray, rate: float) -> np.ndarray:
    """What leads and lags of the reference explain of a signal; each quarter by the response of the other three.

    So no noise of a sample is part of its own instrument. The response is fitted twice, the second time to signals
    that are whitened, below the pass band, by the residual of the first.

    Shapes: y, x (N,); returns (N,).
    """
    padding = round(LAGS * rate), round(LEADS * rate)
    if y.size < 4 * (sum(padding) + 1):
        raise DataError(f"the record of {y.size / rate:.3g} s is too short for a response to the reference.")
    lagged = _shift(x, padding)
    residual = y - _predict_folds(lagged, y, lagged)
    size = int(next_fast_len(y.size + round(PADDING * rate), real=True))
    power = smooth(np.abs(rfft(residual - residual.mean(), size)) ** 2, RESOLUTION * size / rate)
    weight = np.where(np.fft.rfftfreq(size) <= PASSBAND, 1.0 / np.sqrt(np.maximum(power, 1e-10 * power.max())), 0.0)
    x, y = irfft(weight / weight.max() * rfft(np.stack([x, y]), size), size)[:, : y.size]
    return _predict_folds(_shift(x, padding), y, lagged)


def _shift(x: np.ndarray, padding: tuple[int, int]) -> np.ndarray:
    """Lags and leads of a signal, from the oldest lag to the furthest lead, shape (lags + leads + 1, N)."""
    return np.ascontiguousarray(np.lib.stride_tricks.sliding_window_view(np.pad(x, padding), x.size))


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
    responses = np.linalg.solve(gram + ridge[:, None, None] * np.eye(gram.shape[1]), side[..., None])[..., 0]
    return np.concatenate([response @ part for response, part in zip(responses, parts[2], strict=True)])


def check_perturbation(inputs: TimeVaryingInputs) -> None:
    """Refuse a perturbation most of whose power repeats with the cycle."""
    if not inputs.course.periodic:
        return
    since, rows, signal = inputs.course.since, inputs.course.rows, inputs.reference
    count, repeated = np.bincount(since), np.zeros(signal.size)
    # The movement is a function of the phase, and a locked perturbation one of the time since the onset: each is fitted
    # to what the other leaves.
    for _ in range(ROUNDS):
        rest = signal - inputs.slow_part(signal - repeated)
        repeated[rows] = (np.bincount(since, rest[rows]) / count)[since]
    left = np.sum((rest - repeated)[rows] ** 2)
    # The mean of n independent cycles takes 1/n of their power.
    share = float(left / max(np.sum(1.0 - 1.0 / count[since]), 1.0) / np.mean(signal[rows] ** 2))
    if share < LOCKED:
        raise DataError(
            f"{100 * max(1.0 - share, 0.0):.0f} % of the power of {inputs.reference_name} repeats with the cycle: the "
            "perturbation is locked to it, so its effect cannot be told from the torque of the movement. Draw a new "
            "pseudorandom sequence for every cycle, independent of its phase."
        )


def check_course(inputs: TimeVaryingInputs) -> list[str]:
    """Warnings about onsets or a schedule that the movement of the record contradicts."""
    if inputs.course.dimension == "phase":
        return _check_cycles(inputs, inputs.position - inputs.position.mean())
    return _check_schedule(inputs) if inputs.course.dimension == "schedule" else []


def _check_cycles(inputs: TimeVaryingInputs, position: np.ndarray) -> list[str]:
    """Whether the movement has the same phase at all onsets, where there is one."""
    starts = inputs.course.rows.start + np.flatnonzero(inputs.course.since == 0)
    frequency = np.fft.rfftfreq(position.size) * float(np.median(np.diff(starts)))  # per cycle
    power = np.abs(np.fft.rfft(position * np.hanning(position.size))) ** 2
    band, floor = ((frequency > low) & (frequency < high) for low, high in (MOVEMENT_BAND, FLOOR_BAND))
    if np.mean(power[band]) < MOVEMENT_POWER * np.median(power[floor]):
        return []
    movement = np.fft.ifft(np.where(band, np.fft.rfft(position), 0.0), position.size)
    at_onsets = movement[starts]
    common = float(np.abs(np.mean(at_onsets / np.abs(at_onsets))))
    if common > SAME_PHASE:
        return []
    return [
        f"the movement is not the same at all onsets of cycles (its phases agree by {common:.2f}, usually by "
        f"{SAME_PHASE:g} and more): are they those of another trial, or counted from another time? K, B and G over "
        "phase are wrong then."
    ]


def _check_schedule(inputs: TimeVaryingInputs) -> list[str]:
    """Whether the slow movement follows the schedule at once, where it follows it."""
    size = inputs.position.size
    spectra = np.fft.rfft([inputs.position, inputs.course.place])
    spectra[:, np.fft.rfftfreq(size, 1.0 / inputs.rate) >= SLOW] = 0.0
    movement, place = np.fft.irfft(spectra, size)
    reach = round(LATEST * inputs.rate)
    middle = slice(reach, -reach)
    lags = range(-reach, reach + 1)
    shares = np.array([np.corrcoef(movement[middle], np.roll(place, lag)[middle])[0, 1] ** 2 for lag in lags])
    best = int(np.argmax(shares))
    if shares[best] < FOLLOWED or shares[reach] > shares[best] - LATER:
        return []
    late = (reach - best) / inputs.rate
    return [
        f"the slow movement follows the schedule {abs(late):.2g} s {'earlier' if late > 0 else 'later'} than its "
        f"samples say (it explains {100 * shares[best]:.0f} % then, {100 * shares[reach]:.0f} % at once): is the "
        "schedule shifted in time, or that of another trial?"
    ]
