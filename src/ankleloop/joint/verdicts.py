"""What is said of an estimate, in three words.

- *Refused*: no estimate can be relied on, and none is given: a `DataError` says why.
- *Warned*: a parameter may be off by more than a tolerance, by default 10 %: `Estimate.warnings`. It is not trusted.
- *Remarked*: a parameter may be off by less, and by how much is said; the interval holds both values:
  `Estimate.remarks`. It is trusted.
"""

from __future__ import annotations

from collections.abc import Mapping

TOLERANCE = 0.1  # of a parameter, by default


def largest_shift(shifts: Mapping[str, float]) -> float:
    """Largest of relative shifts of parameters, by its size.

    >>> largest_shift({"K": 0.02, "B": -0.3})
    0.3
    """
    return max(map(abs, shifts.values()), default=0.0)


def exceeds(shifts: Mapping[str, float], tolerance: float) -> bool:
    """Whether shifts of parameters, together of all that the record shows, are to be warned of.

    >>> exceeds({"K": 0.02, "B": -0.3}, 0.1), exceeds({"K": 0.02, "B": -0.3}, 0.5)
    (True, False)
    """
    return largest_shift(shifts) > tolerance
