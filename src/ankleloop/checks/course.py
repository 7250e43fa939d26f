"""Whether a record follows the cycles, or the schedule, that its parameters are said to change with."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ankleloop.checks.findings import Finding
from ankleloop.errors import DataError
from ankleloop.joint.time_varying_course import Course

LOCKED = 0.3  # share of the perturbation that has to differ from cycle to cycle
ROUNDS = 5
MOVEMENT_BAND, FLOOR_BAND = (
    (0.6, 1.5),
    (2.0, 6.0),
)  # frequencies of a cycle, and those of the perturbation beside it
MOVEMENT_POWER = 8.0  # of a movement over that of the perturbation; by chance up to 5
SAME_PHASE = 0.9  # length of the mean of unit vectors
SLOW, LATEST, LATER = 1.0, 1.0, 0.1  # Hz; s; what another time explains more of the movement
FOLLOWED = 0.3  # of the slow movement, at least, by a schedule that it follows


def check_slow_movement(
    position: np.ndarray, course: Course, rate: float, schedule: str | None
) -> list[Finding]:
    """Finding about cycles or about a scheduling variable; none of a course over time.

    Shapes: position (N,).
    """
    if course.dimension == "phase":
        return [_check_cycles(position, course, rate)]
    return [] if schedule is None else [_check_schedule(position, course, rate, schedule)]


def _check_cycles(position: np.ndarray, course: Course, rate: float) -> Finding:
    """Whether the movement has the same phase at all onsets, where there is one."""
    durations = np.bincount(course.segment) / rate
    ends = dict.fromkeys([f"{durations.min():.3g}", f"{durations.max():.3g}"])
    usable = Finding(
        "cycles",
        "ok",
        f"{course.segments} whole cycles of {' to '.join(ends)} s can be identified.",
    )
    position = position - position.mean()
    starts = course.rows.start + np.flatnonzero(course.since == 0)
    frequency = np.fft.rfftfreq(position.size) * float(np.median(np.diff(starts)))  # per cycle
    power = np.abs(np.fft.rfft(position * np.hanning(position.size))) ** 2
    band, floor = (
        (frequency > low) & (frequency < high) for low, high in (MOVEMENT_BAND, FLOOR_BAND)
    )
    if np.mean(power[band]) < MOVEMENT_POWER * np.median(power[floor]):
        return usable
    at_onsets = np.fft.ifft(np.where(band, np.fft.rfft(position), 0.0), position.size)[starts]
    common = float(np.abs(np.mean(at_onsets / np.abs(at_onsets))))
    if common > SAME_PHASE:
        return usable
    text = (
        f"the movement is not the same at all onsets of cycles (its phases agree by {common:.2f}): are they those of "
        "another trial, or counted from another time? K, B and G over phase are wrong then."
    )
    return Finding("cycles", "warning", text)


def _check_schedule(position: np.ndarray, course: Course, rate: float, schedule: str) -> Finding:
    """Whether the slow movement follows the schedule at once, where it follows it."""
    spectra = np.fft.rfft([position, course.place])
    spectra[:, np.fft.rfftfreq(position.size, 1.0 / rate) >= SLOW] = 0.0
    movement, place = np.fft.irfft(spectra, position.size)
    reach = round(LATEST * rate)
    middle, lags = slice(reach, -reach), range(-reach, reach + 1)
    shares = np.array(
        [np.corrcoef(movement[middle], np.roll(place, lag)[middle])[0, 1] ** 2 for lag in lags]
    )
    best = int(np.argmax(shares))
    if shares[best] < FOLLOWED or shares[reach] > shares[best] - LATER:
        low, high = course.limits
        return Finding(
            "schedule",
            "ok",
            f"{schedule} goes from {low:.4g} to {high:.4g} (2nd to 98th percentile).",
        )
    late = (reach - best) / rate
    text = (
        f"the slow movement follows the schedule {abs(late):.2g} s {'earlier' if late > 0 else 'later'} than its "
        "samples say: is the schedule shifted in time, or that of another trial?"
    )
    return Finding("schedule", "warning", text)


def refuse_locked_perturbation(
    reference: np.ndarray, course: Course, slow_part: Callable[[np.ndarray], np.ndarray], name: str
) -> None:
    """Refuse a perturbation most of whose power repeats with the cycle.

    Shapes: reference (N,), less what repeats or changes slowly.
    """
    since, rows = course.since, course.rows
    count, repeated = np.bincount(since), np.zeros(reference.size)
    # The movement is a function of the phase, and a locked perturbation one of the time since the onset: each is fitted
    # to what the other leaves.
    for _ in range(ROUNDS):
        rest = reference - slow_part(reference - repeated)
        repeated[rows] = (np.bincount(since, rest[rows]) / count)[since]
    left = np.sum((rest - repeated)[rows] ** 2)
    # The mean of n independent cycles takes 1/n of their power.
    share = float(left / max(np.sum(1.0 - 1.0 / count[since]), 1.0) / np.mean(reference[rows] ** 2))
    if share < LOCKED:
        raise DataError(
            f"{100 * max(1.0 - share, 0.0):.0f} % of the power of {name} repeats with the cycle: the perturbation is "
            "locked to it. Draw a new pseudorandom sequence for every cycle."
        )
