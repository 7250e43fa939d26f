"""Whether a record follows the cycles, or the schedule, that its parameters are said to change with."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ankleloop.checks.findings import Finding
from ankleloop.errors import DataError
from ankleloop.joint.time_varying_course import Course

LOCKED_SHARE = 0.3  # of the perturbation that has to differ from cycle to cycle
LOCKED_ROUNDS = 5
# Frequencies of a cycle, and those of the perturbation beside it, in cycles.
MOVEMENT_BAND, FLOOR_BAND = (0.6, 1.5), (2.0, 6.0)
# Of a movement over that of the perturbation: measured, by chance at most 3.0 (240 trials of 45 s); chosen above it.
MOVEMENT_POWER = 8.0
SAME_PHASE = 0.9  # length of the mean of unit vectors
SLOW_FREQUENCY = 1.0  # Hz
LARGEST_LATENESS = 1.0  # s, of a schedule
LATE_SHARE = 0.1  # of the movement: so much more another time has to explain
FOLLOWED_SHARE = 0.3  # of the slow movement, at least, by a schedule that it follows


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
    text = f"{course.segments} whole cycles of {' to '.join(ends)} s can be identified."
    usable = Finding("cycles", "ok", text)
    starts = course.row_numbers[course.since == 0]
    frequency = np.fft.rfftfreq(position.size) * np.median(np.diff(starts))  # per cycle
    movement = position - position.mean()
    power = np.abs(np.fft.rfft(movement * np.hanning(movement.size))) ** 2
    inside = _is_within(frequency, MOVEMENT_BAND)
    floor = np.median(power[_is_within(frequency, FLOOR_BAND)])
    if np.mean(power[inside]) < MOVEMENT_POWER * floor:
        return usable
    analytic = np.fft.ifft(np.where(inside, np.fft.rfft(movement), 0.0), movement.size)
    at_onsets = analytic[starts]
    agreement = np.abs(np.mean(at_onsets / np.abs(at_onsets)))
    if agreement > SAME_PHASE:
        return usable
    text = (
        f"the movement is not the same at all onsets of cycles (its phases agree by {agreement:.2f}): are they those "
        "of another trial, or counted from another time? K, B and G over phase are wrong then."
    )
    return Finding("cycles", "warning", text)


def _is_within(frequency: np.ndarray, band: tuple[float, float]) -> np.ndarray:
    """Which frequencies lie within a band."""
    low, high = band
    return (frequency > low) & (frequency < high)


def _check_schedule(position: np.ndarray, course: Course, rate: float, schedule: str) -> Finding:
    """Whether the slow movement follows the schedule at once, where it follows it."""
    spectra = np.fft.rfft([position, course.place])
    spectra[:, np.fft.rfftfreq(position.size, 1.0 / rate) >= SLOW_FREQUENCY] = 0.0
    movement, place = np.fft.irfft(spectra, position.size)
    reach = round(LARGEST_LATENESS * rate)
    middle = slice(reach, -reach)
    correlations = [
        np.corrcoef(movement[middle], np.roll(place, lag)[middle])[0, 1]
        for lag in range(-reach, reach + 1)
    ]
    shares = np.square(correlations)
    best = np.argmax(shares)
    if shares[best] < FOLLOWED_SHARE or shares[reach] > shares[best] - LATE_SHARE:
        low, high = course.limits
        return Finding(
            "schedule",
            "ok",
            f"{schedule} goes from {low:.4g} to {high:.4g} (2nd to 98th percentile).",
        )
    lateness = (reach - best) / rate
    order = "earlier" if lateness > 0.0 else "later"
    text = (
        f"the slow movement follows the schedule {abs(lateness):.2g} s {order} than its "
        "samples say: is the schedule shifted in time, or that of another trial?"
    )
    return Finding("schedule", "warning", text)


def refuse_locked_perturbation(
    reference: np.ndarray, course: Course, slow_part: Callable[[np.ndarray], np.ndarray], name: str
) -> None:
    """Refuse a perturbation most of whose power repeats with the cycle.

    Shapes: reference (N,), less what repeats or changes slowly.
    """
    rows = course.rows
    since = course.since
    cycles = np.bincount(since)
    repeated = np.zeros(reference.size)
    # The movement is a function of the phase, and a locked perturbation one of the time since the onset: each is fitted
    # to what the other leaves.
    for _ in range(LOCKED_ROUNDS):
        rest = reference - slow_part(reference - repeated)
        repeated[rows] = (np.bincount(since, rest[rows]) / cycles)[since]
    # The mean of n independent cycles takes 1/n of their power.
    freedom = np.sum(1.0 - 1.0 / cycles[since])
    power = np.sum((rest - repeated)[rows] ** 2) / freedom
    share = power / np.mean(reference[rows] ** 2)
    if share < LOCKED_SHARE:
        raise DataError(
            f"{100 * (1.0 - share):.0f} % of the power of {name} repeats with the cycle: the perturbation is "
            "locked to it. Draw a new pseudorandom sequence for every cycle."
        )
