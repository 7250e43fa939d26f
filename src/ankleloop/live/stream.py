"""The last samples of a stream, and what is wrong with them."""

from __future__ import annotations

import numpy as np

from ankleloop.signals.sampling import RATE_TOLERANCE

LARGEST_STEP = 1.5  # sampling intervals: more is a gap
REST = 2.0  # s: no perturbation stands still for so long
REST_SHARE = 0.01  # of the range of a reference, within which it stands still


class Stream:
    """Keeps the last samples of a stream; the time of the first one is zero.

    Shapes: samples (rows, N): stamps [s], and below them the channels.
    """

    def __init__(self, rate: float, memory: float) -> None:
        self._rate = rate
        self._memory = memory
        self._pieces: list[np.ndarray] = []  # the last samples, and those that have come since
        self._time = -2.0 / rate  # of the last sample [s]
        self._offset = np.nan  # of times from stamps [s]
        self._is_repeated = False  # whether samples came twice or late

    def add(self, samples: np.ndarray) -> int:
        """Add samples, and return how many of them are new."""
        samples = samples[:, np.isfinite(samples[0])]
        if not samples.size:
            return 0
        first = samples[0, 0]
        is_continued = first + self._offset > self._time - self._memory
        if not is_continued:  # the first stamps, or a clock that was set back
            self._offset = self._time + 2.0 / self._rate - first
        times = samples[0]
        times += self._offset
        latest = np.maximum.accumulate(np.append(self._time, times))
        is_new = times > latest[:-1]
        is_complete = np.isfinite(samples).all(axis=0)
        self._pieces.append(samples[:, is_new & is_complete])
        self._time = latest[-1]
        self._is_repeated |= not is_new.all()
        return np.sum(is_new)

    def take_window(self) -> tuple[float, np.ndarray, list[str]]:
        """Time at the end, the last samples that follow one another, and what is wrong with the stream."""
        samples = np.hstack(self._pieces)[:, -round(self._memory * self._rate) :]
        self._pieces = [samples]
        warnings = []
        times = np.append(samples[0], self._time + 1.0 / self._rate)
        gaps = np.flatnonzero(np.diff(times) * self._rate > LARGEST_STEP)
        if gaps.size:
            first = gaps[-1] + 1
            samples = samples[:, first:]
            warnings.append(f"samples are missing, the last ones before {times[first]:.6g} s.")
        if self._is_repeated:
            warnings.append("samples that came twice or late were left out.")
            self._is_repeated = False
        return times[-1], samples, warnings


def check_stream(samples: np.ndarray, rate: float) -> list[str]:
    """Warnings about a clock that does not keep the sampling rate, and about a reference that stands still."""
    times, _, _, *references = samples
    warnings = []
    measured = (times.size - 1) / np.ptp(times)
    if abs(measured - rate) > RATE_TOLERANCE * rate:
        warnings.append(f"samples come at {measured:.6g} Hz, and not at {rate:g} Hz.")
    for reference in references:
        last = reference[-round(REST * rate) :]
        if np.ptp(last) < REST_SHARE * np.ptp(reference):
            warnings.append(f"the reference has stood still for {REST:g} s or longer.")
    return warnings
