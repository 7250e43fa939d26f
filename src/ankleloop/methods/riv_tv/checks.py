"""Checks of what a joint that changes in time needs: a perturbation of its own, and the right onsets or schedule."""

from __future__ import annotations

import numpy as np

from ankleloop.errors import DataError
from ankleloop.methods.riv_tv.inputs import TimeVaryingInputs

LOCKED = 0.3  # share of the perturbation that has to differ from cycle to cycle
ROUNDS = 5
MOVEMENT_BAND, FLOOR_BAND = (0.6, 1.5), (2.0, 6.0)  # frequencies of a cycle, and those of the perturbation beside it
MOVEMENT_POWER = 8.0  # of a movement over that of the perturbation; by chance up to 5
SAME_PHASE = 0.9  # length of the mean of unit vectors
SLOW, LATEST, LATER = 1.0, 1.0, 0.1  # Hz; s; what another time explains more of the movement
FOLLOWED = 0.3  # of the slow movement, at least, by a schedule that it follows


def check_perturbation(inputs: TimeVaryingInputs) -> float:
    """Share of the power of the perturbation that does not repeat with the cycle; one that does is refused."""
    if not inputs.course.periodic:
        return 1.0
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
    return share


def check_course(inputs: TimeVaryingInputs) -> list[str]:
    """Warnings about onsets or a schedule that the movement of the record contradicts."""
    position = inputs.trial.motion(inputs.grid)[0]
    if inputs.course.dimension == "phase":
        return _check_cycles(inputs, position - position.mean())
    return _check_schedule(inputs, position) if inputs.course.dimension == "schedule" else []


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


def _check_schedule(inputs: TimeVaryingInputs, position: np.ndarray) -> list[str]:
    """Whether the slow movement follows the schedule at once, where it follows it."""
    spectra = np.fft.rfft([position, inputs.course.place])
    spectra[:, np.fft.rfftfreq(position.size, 1.0 / inputs.rate) >= SLOW] = 0.0
    movement, place = np.fft.irfft(spectra, position.size)
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
