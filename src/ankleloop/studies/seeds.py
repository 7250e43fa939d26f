"""Seeds of the simulated trials, each keyed by study, point and number."""

from __future__ import annotations

import zlib

__all__ = ["trial_entropy"]


def trial_entropy(seed: int, study: str, point: str, number: int) -> list[int]:
    """Entropy of a trial for `numpy.random.SeedSequence`, so that any part of a study gives the same bits alone.

    Parameters
    ----------
    seed : int
        Seed of the study.
    study, point : str
        Names of the study and of the point.
    number : int
        Number of the trial at this point, from 0.

    Returns
    -------
    list of int

    Examples
    --------
    >>> trial_entropy(2008, "table1", "reflex_gain=2.0", 3)
    [2008, 479535773, 1839828330, 3]
    """
    return [seed, zlib.crc32(study.encode()), zlib.crc32(point.encode()), number]
