"""Chunks: the trials of a study that share a job, or a trial file.

A chunk has a power of two of trials of one condition, or of conditions, so that its size changes seldom: another point
at the end changes the last chunk alone, and chunks of identification are parts of trial files.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable
from typing import NamedTuple

__all__ = ["ChunkSize", "PointTrials", "divide_points", "divide_trials", "fit_size"]

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
    """Size of a chunk that takes about as much as a budget.

    Parameters
    ----------
    cost : float
        Cost of a trial, such as its time [s].
    budget : float
        What a chunk may cost, of the same unit.
    trials : int
        Trials of each condition.
    most : int, optional
        Most trials in a chunk.

    Returns
    -------
    ChunkSize
        Powers of two, but for a chunk with all trials of its conditions.

    Examples
    --------
    >>> fit_size(0.05, 60.0, 100), fit_size(0.05, 1.0, 100)
    (ChunkSize(trials=100, conditions=8), ChunkSize(trials=16, conditions=1))
    """
    count = 2 ** max(0, round(math.log2(max(budget / cost, 1.0))))
    if most is not None:
        count = min(count, _power_of_two(most))
    if count < trials:
        return ChunkSize(count)
    return ChunkSize(trials, _power_of_two(count // trials))


def divide_points(count: int, cost: float, budget: float) -> list[tuple[int, int] | None]:
    """Divide the points of a condition that are too many for a job.

    Parameters
    ----------
    count : int
        Points of the condition.
    cost : float
        Cost of all trials of the condition, at one of its points.
    budget : float
        What a chunk may cost, of the same unit.

    Returns
    -------
    list of (int, int), or None
        First and last point (without the last) of each part; None for all of them. Parts have a power of two of
        points, and not so few that most of a job would be what the points share.

    Examples
    --------
    >>> divide_points(100, 0.5, 20.0), divide_points(16, 10.0, 20.0)
    ([(0, 32), (32, 64), (64, 96), (96, 100)], [None])
    """
    size = max(2 ** max(0, round(math.log2(max(budget / cost, 1.0)))), LEAST_POINTS)
    if count <= size:
        return [None]
    return [(first, min(first + size, count)) for first in range(0, count, size)]


def divide_trials(
    parts: Iterable[tuple[Hashable, PointTrials]], size: Callable[[str], ChunkSize]
) -> list[tuple[Hashable, Chunk]]:
    """Divide trials into chunks, in one pass.

    Parameters
    ----------
    parts : iterable of (hashable, PointTrials)
        Trials of each condition, with a label that all of a chunk have in common.
    size : callable
        From the name of a condition to the size of its chunks.

    Returns
    -------
    list of (hashable, list of PointTrials)
        Labels and chunks, in the order of their first trials.

    Examples
    --------
    >>> parts = [(0, PointTrials("a", 0, 3)), (0, PointTrials("b", 0, 3))]
    >>> [(part.condition, part.first, part.stop) for _, (part,) in divide_trials(parts, lambda condition: ChunkSize(2))]
    [('a', 0, 2), ('a', 2, 3), ('b', 0, 2), ('b', 2, 3)]
    >>> len(divide_trials(parts, lambda condition: ChunkSize(3, 2)))
    1
    """
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
