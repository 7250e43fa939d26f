"""Whether a parameter has changed: the last seconds compared with the window before them."""

from __future__ import annotations

from collections import deque

import numpy as np
import pandas as pd
from scipy import special

from ankleloop.joint.estimate import Estimate

COMPARED = 10.0  # s, the last ones
WATCHED = ("K", "G")
THRESHOLD = 4.3  # standard errors: a constant joint exceeds them once in an hour
OVER = 2.0  # standard errors: below them a change is over, and the next one is another
STEP = 0.3  # of a parameter: the change that the power is for
NOTHING = {"since": np.nan, "before": np.nan, "after": np.nan, "score": 0.0}


class ChangeDetector:
    """Compares the last seconds with the window before them, and keeps the last change of each parameter."""

    def __init__(self, every: float) -> None:
        # Estimates of windows, and when they ended [s], until one of them is the window before.
        self._windows: deque[tuple[float, Estimate]] = deque(maxlen=round(COMPARED / every) + 1)
        self._changes = {name: dict(NOTHING) for name in WATCHED}
        self._powers = dict.fromkeys(WATCHED, np.nan)
        self._changing: set[str] = set()

    @property
    def table(self) -> pd.DataFrame:
        """The last change of each parameter, and the probability that a step by 30 % is found."""
        table = pd.DataFrame.from_dict(self._changes, orient="index")
        return table.assign(power=self._powers).rename_axis("parameter")

    def add(self, time: float, window: Estimate, last: Estimate) -> None:
        """Compare the last seconds up to a time with the window before them."""
        self._windows.append((time, window))
        since = time - COMPARED
        ended = [estimate for end, estimate in self._windows if end < since + 1e-6]
        for name in WATCHED:
            if ended:
                self._compare(name, since, ended[-1], last)

    def _compare(self, name: str, since: float, earlier: Estimate, later: Estimate) -> None:
        """Compare a parameter; a change is kept as it was seen best."""
        before, first_error = _find(name, earlier)
        after, second_error = _find(name, later)
        error = np.hypot(first_error, second_error)
        score = (after - before) / error
        self._powers[name] = special.ndtr(STEP * abs(before) / error - THRESHOLD)
        if abs(score) < OVER:
            self._changing.discard(name)
        largest = abs(self._changes[name]["score"]) if name in self._changing else THRESHOLD
        if abs(score) > largest:
            self._changing.add(name)
            self._changes[name] = {"since": since, "before": before, "after": after, "score": score}


def _find(name: str, estimate: Estimate) -> tuple[float, float]:
    """A parameter and its standard error."""
    values = {**estimate.stiffness, **estimate.reflex}
    errors = estimate.diagnostics["standard_errors"]
    return values.get(name, np.nan), errors.get(name, np.nan)
