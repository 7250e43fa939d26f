"""Whether a record can show how a joint changes: perturbation against cycle, and strength of the instruments."""

from __future__ import annotations

import numpy as np

from ankleloop.errors import DataError
from ankleloop.methods.time_varying_equations import WhitenedSystem
from ankleloop.methods.time_varying_inputs import TimeVaryingInputs

LOCKED = 0.3  # share of the perturbation that has to differ from cycle to cycle
ROUNDS = 5
MOVEMENT_BAND, FLOOR_BAND = (0.6, 1.5), (2.0, 6.0)  # frequencies of a cycle, and those of the perturbation beside it
MOVEMENT_POWER = 8.0  # of a movement over that of the perturbation; by chance up to 5
SAME_PHASE = 0.9  # length of the mean of unit vectors
SLOW, LATEST, LATER = 1.0, 1.0, 0.1  # Hz; s; what another time explains more of the movement
FOLLOWED = 0.3  # of the slow movement, at least, by a schedule that it follows


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


def instrument_strength(system: WhitenedSystem, size: int) -> float:
    """Smallest canonical correlation of instruments and regressors of the linear parameters."""
    if system.instruments is system.regressors:
        return 1.0
    x = system.regressors[:size]
    measured, predicted, cross = x @ x.T, system.information[:size, :size], system.normal[:size, :size]
    try:
        left, right = np.linalg.cholesky(predicted), np.linalg.cholesky(measured)
    except np.linalg.LinAlgError:
        return 0.0
    matrix = np.linalg.solve(right, np.linalg.solve(left, cross).T)
    return float(np.linalg.svd(matrix, compute_uv=False)[-1])
