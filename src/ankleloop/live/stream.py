"""The last samples of a stream with their times, and what is wrong with them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ankleloop.signals.sampling import RATE_TOLERANCE, format_samples

LARGEST_STEP = 1.5  # sampling intervals: more is a gap
REST = 2.0  # s: no perturbation stands still for so long
REST_SHARE = 0.01  # of the range of a reference, within which it stands still


class Window(NamedTuple):
    """The last samples of a stream that follow one another."""

    time: float  # at its end [s]
    samples: np.ndarray  # channels, and in the last row times
    warnings: list[str]  # about the stream


class Stream:
    """Keeps the last samples of a stream, and gives them times [s], of which the first is zero."""

    def __init__(self, rate: float, memory: float, channels: int) -> None:
        self._rate = rate
        self._memory = memory
        self._capacity = round(memory * rate)
        # Channels, and in the last row times. The last samples move to its beginning when it is full.
        self._store = np.empty((channels + 1, 2 * self._capacity))
        self._stop = 0  # column behind the last sample
        self._time = -2.0 / rate  # of the last sample [s]
        self._offset = np.nan  # of times from stamps [s]
        self._counted = 0  # samples without stamps
        self._repeated = 0  # samples that were left out since the last window

    def add(self, channels: np.ndarray, stamps: np.ndarray | None) -> int:
        """Add samples, not more than the memory holds, and return how many of them are new.

        Shapes: channels (rows, N), stamps (N,).
        """
        if stamps is None:
            times = np.arange(self._counted, self._counted + channels.shape[1]) / self._rate
            self._counted += times.size
        else:
            times = self._read_stamps(stamps)
        samples = np.vstack([channels, times])[:, np.isfinite(times)]
        count = samples.shape[1]
        if self._stop + count > self._store.shape[1]:
            last = self._store[:, self._stop - self._capacity : self._stop]
            self._store[:, : self._capacity] = last
            self._stop = self._capacity
        self._store[:, self._stop : self._stop + count] = samples
        self._stop += count
        return count

    def _read_stamps(self, stamps: np.ndarray) -> np.ndarray:
        """Times of samples by their stamps; nan for those that came before, or that have none."""
        is_continued = stamps[0] + self._offset > self._time - self._memory
        if not is_continued:  # the first stamps, or those of a clock that was set back
            self._offset = self._time + 2.0 / self._rate - stamps[0]
        times = stamps + self._offset
        latest = np.fmax.accumulate(np.append(self._time, times))
        is_new = times > latest[:-1]
        self._time = float(latest[-1])
        self._repeated += int(np.sum(~is_new))
        return np.where(is_new, times, np.nan)

    def take_window(self) -> Window:
        """The last samples that follow one another, and what was wrong before and among them."""
        samples = self._store[:, max(0, self._stop - self._capacity) : self._stop]
        times = samples[-1]
        first = 0
        warnings = []
        steps = np.diff(times) * self._rate
        gaps = np.flatnonzero(steps > LARGEST_STEP)
        if gaps.size:
            first = int(gaps[-1]) + 1
            lost = round(np.sum(steps[gaps] - 1.0))
            warnings.append(f"{format_samples(lost)} lost, the last before {times[first]:.6g} s.")
        missing = np.flatnonzero(~np.isfinite(samples).all(axis=0))
        if missing.size:
            last = int(missing[-1])
            first = max(first, last + 1)
            count = format_samples(missing.size)
            warnings.append(f"{count} without a number, the last at {times[last]:.6g} s.")
        if self._repeated:
            warnings.append(f"{format_samples(self._repeated)} left out: twice there, or late.")
            self._repeated = 0
        usable = samples[:, first:].copy()
        if usable.shape[1] > REST * self._rate:
            warnings += _check_clock(usable[-1], self._rate)
        if samples.shape[0] > 3:
            warnings += _check_reference(usable[2], usable[-1])
        return Window(float(times[-1]) + 1.0 / self._rate, usable, warnings)


def _check_clock(times: np.ndarray, rate: float) -> list[str]:
    """Warning about a clock that does not keep the sampling rate.

    Shapes: times (N,).
    """
    measured = (times.size - 1) / (times[-1] - times[0])
    if abs(measured - rate) <= RATE_TOLERANCE * rate:
        return []
    return [f"samples come at {measured:.6g} Hz: the clock drifts, or {rate:g} Hz is not its rate."]


def _check_reference(reference: np.ndarray, times: np.ndarray) -> list[str]:
    """Warning about a reference that stands still.

    Shapes: reference, times (N,).
    """
    distance = np.abs(reference - reference[-1])
    moved = np.flatnonzero(distance > REST_SHARE * np.ptp(reference))
    stopped = times[moved[-1]] if moved.size else times[0]
    if times[-1] - stopped < REST:
        return []
    return [f"the reference stands still since {stopped:.6g} s."]
