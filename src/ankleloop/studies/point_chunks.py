"""Chunks: the trials of a study that share a job, or a trial file.

A chunk has a power of two of trials of one condition, or of conditions, so that its size changes seldom: another point
at the end changes the last chunk alone, and chunks of identification are parts of trial files.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable
from typing import NamedTuple

LEAST_POINTS = 16  # that share what a trial needs for its identification at any point

Chunk = list["PointTrials"]


class PointTrials(NamedTuple):
    """Trials of one condition: those numbered from `first` to `stop`, without `stop`.

    `points` are the first and the last (without the last) of its points at which they are identified; None for all.
    """

    condition: str
    first: int
    stop: int
    points: tuple[int, int] | None = None


class ChunkSize(NamedTuple):
    """Most trials of one condition, and most conditions, in a chunk; several conditions have all of their trials."""

    trials: int
    conditions: int = 1


def fit_size(cost: float, budget: float, trials: int, most: int | None = None) -> ChunkSize:
    """Size of a chunk that takes about as much as a budget."""
    count = 2 ** max(0, round(math.log2(max(budget / cost, 1.0))))
    if most is not None:
        count = min(count, _power_of_two(most))
    if count < trials:
        return ChunkSize(count)
    return ChunkSize(trials, _power_of_two(count // trials))


def divide_points(count: int, cost: float, budget: float) -> list[tuple[int, int] | None]:
    """Divide the points of a condition that are too many for a job."""
    size = max(2 ** max(0, round(math.log2(max(budget / cost, 1.0)))), LEAST_POINTS)
    if count <= size:
        return [None]
    return [(first, min(first + size, count)) for first in range(0, count, size)]


def divide_trials(
    parts: Iterable[tuple[Hashable, PointTrials]], size: Callable[[str], ChunkSize]
) -> list[tuple[Hashable, Chunk]]:
    """Divide trials into chunks, in one pass."""
    chunks: list[tuple[Hashable, Chunk]] = []
    current: dict[Hashable, Chunk] = {}
    for label, part in parts:
        condition, first, stop, points = part
        most = size(condition)
        if most.trials < stop - first:
            chunks += [
                (label, [PointTrials(condition, start, min(start + most.trials, stop), points)])
                for start in range(first, stop, most.trials)
            ]
            continue
        chunk = current.get((label, most))
        if chunk is None or len(chunk) >= most.conditions:
            chunk = current[label, most] = []
            chunks.append((label, chunk))
        chunk.append(part)
    return chunks


def _power_of_two(number: int) -> int:
    """Largest power of two that is at most a number."""
    return 1 << max(number, 1).bit_length() - 1
