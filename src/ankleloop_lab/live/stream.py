"""The last samples of a stream, and what is wrong with them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from ankleloop.signals.sampling import RATE_TOLERANCE, fit_clock
from ankleloop_lab.live.record import Record

LONG = 10.0  # s of stamps that jitter in pieces, by which a shift is told from it: those of an estimate
REST = 2.0  # s: no perturbation stands still for so long
REST_SHARE = 0.01  # of the range of a reference, within which it stands still


class Stream:
    """Keeps the last samples that follow one another, at times from the first sample of all."""

    def __init__(self, rate: float, memory: float, jitter: float, record: Record | None) -> None:
        self.end = 0.0  # of the last sample [s]
        self._rate = rate
        self._record = record
        self._tolerance = 0.5 / rate + jitter  # of stamps [s]
        # Times follow their stamps by this share, so that none is less than half an interval after the one before.
        self._following = 0.5 / rate / self._tolerance
        self._offset: float | None = None  # of times from stamps [s]; None before the first one
        self._ring = np.empty((round(memory * rate), 5))  # the stamps last
        self._count = 0  # samples that follow one another
        self._fault = ""  # why the last samples begin where they do
        self._is_repeated = False  # whether samples came twice or late

    @property
    def samples(self) -> np.ndarray:
        """The last samples that follow one another, shape (N, 4): time [s], position, torque and reference."""
        return self._follow()[:, :4]

    def _follow(self) -> np.ndarray:
        """The last samples that follow one another, with their stamps, as a copy."""
        if self._count < len(self._ring):
            return self._ring[: self._count].copy()
        return np.roll(self._ring, -self._count, axis=0)

    def add(self, stamp: float, channels: Sequence[float]) -> None:
        """Add a sample by its stamp [s], unless it has come already or comes late."""
        if self._offset is None and math.isfinite(stamp):
            self._offset = self.end - stamp
        late = 0.0 if self._offset is None else stamp + self._offset - self.end
        if math.isnan(stamp):
            self._begin_anew("a sample without a time was left out")
        elif late > self._tolerance:
            self.end += late
            self._begin_anew("samples are missing, the last ones")
        elif late >= -self._tolerance:
            self.end += self._following * late
        elif late >= -self._tolerance - 1.0 / self._rate or self._has(late, channels):
            self._is_repeated = True
            return
        else:
            self._offset = self.end - stamp
            self._begin_anew("the times of samples went back")
        if not all(map(math.isfinite, channels)):
            self._begin_anew("samples are missing, the last ones")
        elif not math.isnan(stamp):
            if self._record:
                self._record.add(channels, is_first=self._count == 0)
            stamp += self._offset or 0.0
            self._ring[self._count % len(self._ring)] = (self.end, *channels, stamp)
            self._count += 1
        self.end += 1.0 / self._rate

    def _begin_anew(self, fault: str) -> None:
        """Forget the samples, which what comes does not follow."""
        self._count = 0
        self._fault = fault

    def _has(self, late: float, channels: Sequence[float]) -> bool:
        """Whether this sample has come already, at this time."""
        kept = self._ring[: self._count]
        is_near = np.abs(kept[:, 0] - (self.end + late)) <= self._tolerance
        return bool(np.any(np.all(kept[is_near, 1:4] == channels, axis=1)))

    def list_faults(self) -> Iterator[str]:
        """What is wrong with the samples that have come."""
        start = self._ring[0, 0]
        if 0 < self._count < len(self._ring) and start > 0.0:
            yield f"{self._fault} before {start:.6g} s."
        times = self._follow()[:, 4]
        is_long = len(times) >= LONG * self._rate
        clock = fit_clock(times) if is_long else None  # by the rule of files
        if clock is not None and clock.shift is not None:
            yield f"samples are missing: stamps shift near {times[clock.shift]:.6g} s, and do not return."
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
