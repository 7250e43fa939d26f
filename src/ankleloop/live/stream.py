"""The last samples of a stream, and what is wrong with them."""

from __future__ import annotations

import numpy as np

from ankleloop.signals.sampling import RATE_TOLERANCE, format_samples

LARGEST_STEP = 1.5  # sampling intervals: more is a gap
REST = 2.0  # s: no perturbation stands still for so long
REST_SHARE = 0.01  # of the range of a reference, within which it stands still


class Stream:
    """Keeps the last samples of a stream; the time of the first one is zero.

    Shapes: samples (rows, N): channels, and in the last row stamps [s].
    """

    def __init__(self, rate: float, memory: float) -> None:
        self._rate = rate
        self._memory = memory
        self._pieces: list[np.ndarray] = []  # the last samples, and those that have come since
        self._time = -2.0 / rate  # of the last sample [s]
        self._offset = np.nan  # of times from stamps [s]
        self._repeated = 0  # samples that came twice or late

    def add(self, samples: np.ndarray) -> int:
        """Add samples, and return how many of them are new."""
        samples = samples[:, np.isfinite(samples[-1])]
        if not samples.size:
            return 0
        stamps = samples[-1]
        is_continued = stamps[0] + self._offset > self._time - self._memory
        if not is_continued:  # the first stamps, or a clock that was set back
            self._offset = self._time + 2.0 / self._rate - stamps[0]
        times = stamps + self._offset
        latest = np.maximum.accumulate(np.append(self._time, times))
        is_new = times > latest[:-1]
        is_complete = np.isfinite(samples).all(axis=0)
        shifted = np.vstack([samples[:-1], times])
        self._pieces.append(shifted[:, is_new & is_complete])
        self._time = float(latest[-1])
        self._repeated += int(np.sum(~is_new))
        return int(np.sum(is_new))

    def take_window(self) -> tuple[float, np.ndarray, list[str]]:
        """Time at the end, the last samples that follow one another, and what is wrong with the stream.

        Shapes: returns samples (rows, N): channels, and in the last row times [s].
        """
        capacity = round(self._memory * self._rate)
        samples = np.hstack(self._pieces)[:, -capacity:]
        self._pieces = [samples]
        end = self._time + 1.0 / self._rate
        times = np.append(samples[-1], end)
        steps = np.diff(times) * self._rate
        gaps = np.flatnonzero(steps > LARGEST_STEP)
        first = 0
        warnings = []
        if gaps.size:
            first = gaps[-1] + 1
            lost = format_samples(round(np.sum(steps[gaps] - 1.0)))
            warnings.append(f"{lost} missing, the last before {times[first]:.6g} s.")
        if self._repeated:
            repeated = format_samples(self._repeated)
            warnings.append(f"{repeated} left out, which came twice or late.")
            self._repeated = 0
        return end, samples[:, first:], warnings


def check_stream(samples: np.ndarray, rate: float) -> list[str]:
    """Warnings about a clock that does not keep the sampling rate, and about a reference that stands still."""
    times = samples[-1]
    warnings = []
    measured = (times.size - 1) / (times[-1] - times[0])
    if abs(measured - rate) > RATE_TOLERANCE * rate:
        warnings.append(f"samples come at {measured:.6g} Hz, and not at {rate:g} Hz.")
    for reference in samples[2:-1]:
        is_other = np.abs(reference - reference[-1]) > REST_SHARE * np.ptp(reference)
        stopped = times[is_other].max(initial=times[0])
        if times[-1] - stopped > REST:
            warnings.append(f"the reference stands still since {stopped:.6g} s.")
    return warnings
