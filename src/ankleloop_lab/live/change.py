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

Row = Mapping[str, float]  # values of a window, with the ends of their intervals


class Change(NamedTuple):
    """A parameter before and after a time."""

    since: float = np.nan  # s
    before: float = np.nan
    after: float = np.nan
    score: float = 0.0  # difference over its standard error
    power: float = np.nan  # probability that a step by 30 % is found

    def update(self, name: str, earlier: Row, later: Row, memory: float) -> Change:
        """The last change of a parameter, after a comparison of two windows by values and ends of intervals.

        It is this one, or that of the two windows if it is another, or shows this one better; the power is theirs.
        """
        low, high = f"{name}_low", f"{name}_high"
        width = np.hypot(earlier[high] - earlier[low], later[high] - later[low])
        error = width / (2.0 * TWO_SIDED)
        before, after = earlier[name], later[name]
        score = (after - before) / error
        power = special.ndtr(STEP * abs(before) / error - THRESHOLD)
        is_other = earlier["time"] > self.since + memory or score * self.score < 0.0
        if abs(score) > THRESHOLD and (is_other or abs(score) > abs(self.score)):
            return Change(earlier["time"], before, after, score, power)
        return self._replace(power=power)
