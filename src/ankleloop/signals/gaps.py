"""Gaps of a channel that were filled by the last value or by a line: no sensor records an exactly straight line."""

from __future__ import annotations

import numpy as np

SHORTEST_GAP = 0.05  # s on an exactly straight line
LONGEST_GAP = 1.0  # s at one value: a longer one is a channel at rest
GAP_SHARE = 0.01  # of the record: less is not told
GAP_SLOPE = 1e-3  # of the usual slope: less is none
ROUNDING = 8.0 * np.finfo(float).eps  # of the largest value


def find_runs(samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First sample and length of each run of consecutive samples, shapes (runs,)."""
    starts = np.flatnonzero(np.diff(samples, prepend=-2) != 1)
    return samples[starts], np.diff(starts, append=samples.size)


def find_straight(x: np.ndarray) -> np.ndarray:
    """Whether each sample lies on a straight line with the two behind it, shape (N - 2,)."""
    return np.abs(np.diff(x, 2)) <= ROUNDING * np.abs(x).max()


def find_filled_gaps(x: np.ndarray, rate: float) -> np.ndarray:
    """First sample of each gap that was filled, and the sample after it; none where they are but few.

    What comes to rest by itself does so smoothly; a held value begins and ends with a break. Where such gaps are, every
    straight stretch counts.

    Shapes: x (N,); returns (gaps, 2).
    """
    none = np.zeros((0, 2), dtype=int)
    straight = np.flatnonzero(find_straight(x))
    if straight.size < GAP_SHARE * x.size:
        return none
    starts, lengths = find_runs(straight)
    slopes = np.diff(x)
    bends = np.abs(np.diff(slopes))
    heights = np.abs(slopes)
    usual = np.sqrt(np.mean(slopes**2))
    converter_step = heights[heights > ROUNDING * np.abs(x).max()].min(initial=np.inf)
    bends_before = np.append(np.inf, bends)[starts]
    bends_after = np.append(bends, 0.0)[starts + lengths]
    begins = bends_before > GAP_SLOPE * usual
    ends = bends_after > max(usual, 2.5 * converter_step)
    is_line = heights[starts] > GAP_SLOPE * usual
    is_held = ends & (lengths + 2 < LONGEST_GAP * rate)
    clipped = np.isin(x[starts], (x.min(), x.max()))
    long = (lengths >= SHORTEST_GAP * rate) & ~clipped
    certain = long & begins & (is_line | is_held)
    if np.sum(lengths[certain] + 2) < GAP_SHARE * x.size:
        return none
    # A gap that was filled by what came after it anyway has no break at its end.
    return np.stack([starts, starts + lengths + 2], axis=1)[long]
