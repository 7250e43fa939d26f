"""Whether a parameter has changed: the last seconds compared with the window before them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy import special

from ankleloop.signals.vaf import TWO_SIDED

COMPARED = 10.0  # s, the last ones
THRESHOLD = 4.0  # standard errors: K of a constant joint exceeds them once in an hour
STEP = 0.3  # of a parameter: the change that the power is for


class Change(NamedTuple):
    """A parameter before and after a time."""

    since: float = np.nan  # s
    before: float = np.nan
    after: float = np.nan
    score: float = 0.0  # difference over its standard error
    power: float = np.nan  # probability that a step by 30 % is found

    def update(self, present: Change, memory: float) -> Change:
        """The last change, with the present power: this one, or the present one if it is another or shows it better."""
        is_other = present.since > self.since + memory or present.score * self.score < 0.0
        is_better = abs(present.score) > abs(self.score)
        if abs(present.score) > THRESHOLD and (is_other or is_better):
            return present
        return self._replace(power=present.power)


def compare(name: str, earlier: Mapping[str, float], later: Mapping[str, float]) -> Change:
    """Compare a parameter of two windows, by its values and the ends of its intervals."""
    low, high = f"{name}_low", f"{name}_high"
    width = np.hypot(earlier[high] - earlier[low], later[high] - later[low])
    error = width / (2.0 * TWO_SIDED)
    score = (later[name] - earlier[name]) / error
    power = special.ndtr(STEP * abs(earlier[name]) / error - THRESHOLD)
    return Change(earlier["time"], earlier[name], later[name], float(score), float(power))
