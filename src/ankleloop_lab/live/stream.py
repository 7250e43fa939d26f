"""The last samples of a stream, and what is wrong with them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from ankleloop.signals.sampling import RATE_TOLERANCE
from ankleloop_lab.live.record import Record

REST = 2.0  # s: no perturbation stands still for so long
REST_SHARE = 0.01  # of the range of a reference, within which it stands still


class Stream:
    """Keeps the last samples that follow one another, at times from the first sample of all."""

    def __init__(self, rate: float, memory: float, jitter: float, record: Record | None) -> None:
        self.end = 0.0  # of the last sample [s]
        self._rate = rate
        self._memory = memory
        self._record = record
        self._tolerance = 0.5 / rate + jitter  # of stamps [s]
        # Times follow their stamps by this share, so that none is less than half an interval after the one before.
        self._following = 0.5 / rate / self._tolerance
        self._offset = -np.inf  # of times from stamps [s]
        self._ring = np.empty((round(memory * rate), 4))
        self._count = 0  # samples that follow one another
        self._is_repeated = False  # whether samples came twice or late

    @property
    def samples(self) -> np.ndarray:
        """The last samples that follow one another, shape (N, 4): time [s], position, torque and reference."""
        if self._count < len(self._ring):
            return self._ring[: self._count].copy()
        return np.roll(self._ring, -self._count, axis=0)

    def add(self, stamp: float, channels: Sequence[float]) -> bool:
        """Add a sample by its stamp [s], unless it has come already, and return whether it is new."""
        late = stamp + self._offset - self.end
        if late < -self._memory:  # the first sample, or a clock that was set back
            self._offset = self.end - stamp
            self._count = 0
        elif late > self._tolerance:
            self.end += late
            self._count = 0
        elif late >= -self._tolerance:
            self.end += self._following * late
        else:
            self._is_repeated = True
            return False
        if all(map(math.isfinite, channels)):
            if self._record:
                self._record.add(channels, is_first=self._count == 0)
            self._ring[self._count % len(self._ring)] = (self.end, *channels)
            self._count += 1
        else:
            self._count = 0
        self.end += 1.0 / self._rate
        return True

    def list_faults(self) -> Iterator[str]:
        """What is wrong with the samples that have come."""
        start = self._ring[0, 0]
        if 0 < self._count < len(self._ring) and start > 0.0:
            yield f"samples are missing, the last ones before {start:.6g} s."
        if self._is_repeated:
            yield "samples that came twice or late were left out."
        self._is_repeated = False


def check_window(samples: np.ndarray, rate: float) -> Iterator[str]:
    """Warnings about a clock that does not keep the sampling rate, and about a reference that stands still."""
    measured = (len(samples) - 1) / np.ptp(samples[:, 0])
    if abs(measured - rate) > RATE_TOLERANCE * rate:
        yield f"samples come at {measured:.6g} Hz, and not at {rate:g} Hz."
    reference = samples[:, 3]
    if np.ptp(reference[-round(REST * rate) :]) < REST_SHARE * np.ptp(reference):
        yield f"the reference has stood still for {REST:g} s or longer."
