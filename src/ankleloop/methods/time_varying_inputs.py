"""Inputs of a joint that changes in time: measured ones, those that the reference predicts, and checks of both."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

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


@dataclass(frozen=True, eq=False)
class TimeVaryingInputs:
    """Decimated signals of a trial, and the same of the position that the reference predicts."""

    trial: PreparedTrial  # the trial
    grid: Grid  # its decimated samples
    course: Course  # what its parameters vary with
    reference_name: str  # variable that serves as reference; the position itself for least squares

    @property
    def rate(self) -> float:
        """Rate of the decimated samples [Hz]."""
        return self.trial.rate / self.grid.factor

    @property
    def own_instruments(self) -> bool:
        """Whether the measured inputs are their own instruments."""
        return self.reference_name == "position"

    @cached_property
    def size(self) -> int:
        """Length of the padded records that are transformed."""
        return int(next_fast_len(self.grid.samples + round(PADDING * self.rate), real=True))

    @cached_property
    def s(self) -> np.ndarray:
        """Laplace variable on the imaginary axis [rad/s], shape (frequencies,)."""
        return 2j * np.pi * np.fft.rfftfreq(self.size, 1.0 / self.rate)

    @cached_property
    def torque(self) -> np.ndarray:
        """Torque less its mean [N·m], shape (N,)."""
        torque = self.trial.channel("torque", self.grid)
        return torque - torque.mean()

    @cached_property
    def motion(self) -> np.ndarray:
        """Position less what repeats or changes slowly, velocity and acceleration, shape (3, N)."""
        position, velocity, acceleration = self.trial.motion(self.grid)
        return np.stack([position - self.slow_part(position), velocity, acceleration])

    @cached_property
    def reference(self) -> np.ndarray:
        """Reference less what repeats with the cycle or changes slowly, shape (N,)."""
        reference = self.trial.channel(self.reference_name, self.grid)
        return reference - self.slow_part(reference)

    @cached_property
    def perturbation(self) -> np.ndarray:
        """Part of the position that the perturbation explains, shape (N,)."""
        return predict_perturbation(self.motion[0], self.reference, self.rate)

    @cached_property
    def _predicted_spectrum(self) -> np.ndarray:
        """Transform of the position that movement and perturbation explain."""
        position = self.trial.motion(self.grid)[0]
        slow = self.slow_part(position)
        return rfft(slow - slow.mean() + self.perturbation, self.size)

    @cached_property
    def predicted_motion(self) -> np.ndarray:
        """The motion that the reference predicts, shape (3, N)."""
        if self.own_instruments:
            return self.motion
        spectra = self._predicted_spectrum * np.stack([self.s, self.s**2])
        spectra[:, self._beyond] = 0.0
        derivatives = irfft(spectra, self.size, axis=1)[:, : self.grid.samples]
        return np.vstack([self.perturbation, derivatives])

    def drive(self, delay: float) -> np.ndarray:
        """Rectified velocity, delayed, shape (N,)."""
        return decimate(np.maximum(0.0, self.trial.velocity(delay)), *self.grid)

    def predicted_drive(self, delay: float) -> np.ndarray:
        """The same of the position that the reference predicts, shape (N,)."""
        if self.own_instruments:
            return self.drive(delay)
        factor, samples = self.grid.factor, self.grid.samples
        spectrum = self._predicted_spectrum * self.s * np.exp(-self.s * delay)
        spectrum[self._beyond] = 0.0
        velocity = np.maximum(0.0, irfft(spectrum, factor * self.size) * factor)
        margin = decimation_margin(factor)
        extended = np.concatenate([velocity[-margin:], velocity[: factor * samples + margin]])
        return decimate(extended, factor, margin, samples)

    @cached_property
    def _beyond(self) -> np.ndarray:
        """Frequencies beyond the pass band of the decimation, where a derivative would only amplify."""
        return np.abs(self.s) > 2 * np.pi * 0.5 * (PASSBAND + 0.5) * self.rate

    @cached_property
    def _slow_projection(self) -> tuple[np.ndarray, np.ndarray]:
        """Splines of what repeats or changes slowly, and the matrix that fits them to the samples that count."""
        splines = Splines(MEAN_SPLINES, self.course.periodic)(self.course.place)
        return splines, linalg.pinv(splines[self.course.rows], rtol=1e-6)

    def slow_part(self, x: np.ndarray) -> np.ndarray:
        """Part of a signal that is a smooth function of the place, shape (N,)."""
        splines, fit = self._slow_projection
        return splines @ (fit @ x[self.course.rows])

    def spectra(self, signals: np.ndarray) -> np.ndarray:
        """Transforms of signals less what repeats with the cycle, or changes slowly.

        What repeats is far larger than what does not. It goes before any filter, whose response to the ends of the
        record would reach into the samples that count.

        Shapes: signals (signals, N); returns (signals, frequencies).
        """
        rows, length = self.course.rows, self.course.equal_cycles
        if length:
            mean = signals[:, rows].reshape(len(signals), -1, length).mean(axis=1)
            signals = signals - mean[:, (np.arange(signals.shape[1]) - rows.start) % length]
        else:
            splines, fit = self._slow_projection
            signals = signals - (signals[:, rows] @ fit.T) @ splines.T
        return rfft(signals, self.size, axis=1)


def predict_perturbation(y: np.ndarray, x: np.ndarray, rate: float) -> np.ndarray:
    """What leads and lags of the reference explain of a signal; each quarter by the response of the other three.

    So no noise of a sample is part of its own instrument. The response is fitted twice, the second time to signals
    that are whitened by the residual of the first.

    Shapes: y, x (N,); returns (N,).
    """
    leads, taps = round(LEADS * rate), round(LEADS * rate) + round(LAGS * rate) + 1
    if y.size < 4 * taps:
        raise DataError(f"the record of {y.size / rate:.3g} s is too short for a response to the reference.")
    lagged = _lag(x, leads, taps)
    folds = np.minimum(FOLDS * np.arange(y.size) // y.size, FOLDS - 1)
    bounds = np.searchsorted(folds, np.arange(FOLDS + 1))
    responses = _fit_folds(lagged, y, bounds)
    whiten = _whitening(y - _predict_folds(lagged, responses, bounds), rate)
    white = whiten(np.stack([x, y]))
    return _predict_folds(lagged, _fit_folds(_lag(white[0], leads, taps), white[1], bounds), bounds)


def _lag(x: np.ndarray, leads: int, taps: int) -> np.ndarray:
    """Leads and lags of a signal, from the furthest lead to the oldest lag, shape (taps, N)."""
    padded = np.concatenate([np.zeros(taps - 1 - leads), x, np.zeros(leads)])
    return np.stack([padded[taps - 1 - k : taps - 1 - k + x.size] for k in range(taps)])


def _fit_folds(lagged: np.ndarray, y: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """Responses fitted to all but one part each, shape (folds, taps)."""
    parts = [slice(*pair) for pair in pairwise(bounds.tolist())]
    grams = np.array([lagged[:, part] @ lagged[:, part].T for part in parts])
    sides = np.array([lagged[:, part] @ y[part] for part in parts])
    gram, side = grams.sum(axis=0) - grams, sides.sum(axis=0) - sides
    ridge = RIDGE * np.einsum("fii->f", gram) / gram.shape[1]
    gram += ridge[:, None, None] * np.eye(gram.shape[1])
    return np.linalg.solve(gram, side[..., None])[..., 0]


def _predict_folds(lagged: np.ndarray, responses: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    parts = zip(responses, pairwise(bounds.tolist()), strict=True)
    return np.concatenate([response @ lagged[:, start:stop] for response, (start, stop) in parts])


def _whitening(residual: np.ndarray, rate: float) -> Callable[[np.ndarray], np.ndarray]:
    """Filter that whitens a residual below the pass band."""
    size = int(next_fast_len(residual.size + round(PADDING * rate), real=True))
    power = smooth(np.abs(rfft(residual - residual.mean(), size)) ** 2, RESOLUTION * size / rate)
    frequency = np.fft.rfftfreq(size)
    weight = np.where(frequency <= PASSBAND, 1.0 / np.sqrt(np.maximum(power, 1e-10 * power.max())), 0.0)
    weight /= weight.max()

    def whiten(x: np.ndarray) -> np.ndarray:
        return irfft(weight * rfft(x, size, axis=-1), size, axis=-1)[..., : residual.size]

    return whiten


def free_share(inputs: TimeVaryingInputs) -> float:
    """Share of the power of the perturbation that does not repeat with the cycle."""
    since, rows = inputs.course.since, inputs.course.rows
    signal = inputs.reference
    count = np.bincount(since)
    repeated = np.zeros(signal.size)
    # The movement is a function of the phase, and a locked perturbation one of the time since the onset: each is fitted
    # to what the other leaves.
    for _ in range(ROUNDS):
        rest = signal - inputs.slow_part(signal - repeated)
        repeated[rows] = (np.bincount(since, rest[rows]) / count)[since]
    left = np.sum((rest - repeated)[rows] ** 2)
    # The mean of n independent cycles takes 1/n of their power.
    return float(left / max(np.sum(1.0 - 1.0 / count[since]), 1.0) / np.mean(signal[rows] ** 2))


def check_perturbation(inputs: TimeVaryingInputs) -> float:
    """Refuse a perturbation that repeats with the cycle."""
    if not inputs.course.periodic:
        return 1.0
    share = free_share(inputs)
    if share < LOCKED:
        raise DataError(
            f"{100 * max(1.0 - share, 0.0):.0f} % of the power of {inputs.reference_name} repeats with the cycle: the "
            "perturbation is locked to it, so its effect cannot be told from the torque of the movement. Draw a new "
            "pseudorandom sequence for every cycle, independent of its phase."
        )
    return share


def check_course(inputs: TimeVaryingInputs) -> list[str]:
    """Warnings about onsets or a schedule that the movement of the record contradicts."""
    checks = {"phase": _check_cycles, "schedule": _check_schedule}
    return checks.get(inputs.course.dimension, lambda inputs: [])(inputs)


def _position(inputs: TimeVaryingInputs) -> np.ndarray:
    return inputs.trial.motion(inputs.grid)[0]


def _check_cycles(inputs: TimeVaryingInputs) -> list[str]:
    """Whether the movement has the same phase at all onsets, where there is one."""
    position, starts = _position(inputs), inputs.course.rows.start + np.flatnonzero(inputs.course.since == 0)
    frequency = np.fft.rfftfreq(position.size) * float(np.median(np.diff(starts)))  # per cycle
    spectrum = np.fft.fft(position - position.mean())[: frequency.size]
    power = np.abs(np.fft.rfft((position - position.mean()) * np.hanning(position.size))) ** 2
    band, floor = ((frequency > low) & (frequency < high) for low, high in (MOVEMENT_BAND, FLOOR_BAND))
    if np.mean(power[band]) < MOVEMENT_POWER * np.median(power[floor]):
        return []
    movement = np.zeros(position.size, dtype=complex)
    movement[: frequency.size] = np.where(band, spectrum, 0.0)
    at_onsets = np.fft.ifft(movement)[starts]
    common = float(np.abs(np.mean(at_onsets / np.abs(at_onsets))))
    if common > SAME_PHASE:
        return []
    return [
        f"the movement is not the same at all onsets of cycles (its phases agree by {common:.2f}, usually by "
        f"{SAME_PHASE:g} and more): are they those of another trial, or counted from another time? K, B and G over "
        "phase are wrong then."
    ]


def _slow_part(x: np.ndarray, rate: float) -> np.ndarray:
    spectrum = np.fft.rfft(x - x.mean())
    return np.fft.irfft(np.where(np.fft.rfftfreq(x.size, 1.0 / rate) < SLOW, spectrum, 0.0), x.size)


def _check_schedule(inputs: TimeVaryingInputs) -> list[str]:
    """Whether the slow movement follows the schedule at once, where it follows it."""
    position, place = (_slow_part(x, inputs.rate) for x in (_position(inputs), inputs.course.place))
    reach = round(LATEST * inputs.rate)
    middle = slice(reach, -reach)
    lags = range(-reach, reach + 1)
    shares = np.array([np.corrcoef(position[middle], np.roll(place, lag)[middle])[0, 1] ** 2 for lag in lags])
    best = int(np.argmax(shares))
    if shares[best] < FOLLOWED or shares[reach] > shares[best] - LATER:
        return []
    late = (reach - best) / inputs.rate
    return [
        f"the slow movement follows the schedule {abs(late):.2g} s {'earlier' if late > 0 else 'later'} than its "
        f"samples say (it explains {100 * shares[best]:.0f} % then, {100 * shares[reach]:.0f} % at once): is the "
        "schedule shifted in time, or that of another trial?"
    ]
