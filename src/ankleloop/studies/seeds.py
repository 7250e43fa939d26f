"""Seeds of the simulated trials, each keyed by study, point and number."""

from __future__ import annotations

import zlib


def trial_entropy(seed: int, study: str, point: str, number: int) -> list[int]:
    """Entropy of a trial for `numpy.random.SeedSequence`, so that any part of a study gives the same bits alone."""
    return [seed, zlib.crc32(study.encode()), zlib.crc32(point.encode()), number]
