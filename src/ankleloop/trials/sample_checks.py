"""The checks of a trial for a record that is read in blocks: rules and words are those of `records.validation`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from ankleloop.trials.validation import CHANNELS, check_spread, peak_speed, refuse_missing, refuse_speed, speed_margin


def check_blocks(blocks: Iterable[Mapping[str, np.ndarray]], rate: float, *, source: str) -> None:
    """Check the samples of a record."""
    channels: dict[str, _Channel] = {}
    speed = _Speed(rate)
    for block in blocks:
        for name, values in block.items():
            channels.setdefault(name, _Channel()).add(values)
        if not channels["position"].missing:
            speed.add(block["position"])
    for name, channel in channels.items():
        if channel.missing:
            refuse_missing(name, channel.sample, channel.sample / rate, channel.missing, source=source)
    for name in CHANNELS:
        if name in channels:
            channel = channels[name]
            check_spread(name, channel.low, channel.high, channel.first, channel.samples, source=source)
    refuse_speed(speed.largest, speed.sample, speed.sample / rate, source=source)


class _Channel:
    """Statistics of a channel."""

    def __init__(self) -> None:
        self.samples, self.missing, self.sample = 0, 0, -1  # `sample` is the first one that is missing
        self.first, self.low, self.high = np.nan, np.inf, -np.inf

    def add(self, values: np.ndarray) -> None:
        """Take in the next samples."""
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size and not self.missing:
            self.sample = self.samples + int(bad[0])
        self.missing += bad.size
        self.first = values[0] if not self.samples else self.first
        self.low, self.high = min(self.low, values.min()), max(self.high, values.max())
        self.samples += values.size


class _Speed:
    """Largest speed of the position, and its sample."""

    def __init__(self, rate: float) -> None:
        self.rate, self.samples, self.sample, self.largest = rate, 0, 0, 0.0
        self._last = np.empty(0)

    def add(self, position: np.ndarray) -> None:
        """Take in the next samples."""
        joined = np.concatenate([self._last, position]) if self._last.size else position
        sample, speed = peak_speed(joined, self.rate)
        if not speed <= self.largest:
            self.sample, self.largest = self.samples - self._last.size + sample, speed
        self.samples += position.size
        self._last = joined[-2 * speed_margin(self.rate) :].copy()
