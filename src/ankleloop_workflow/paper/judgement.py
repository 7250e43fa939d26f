"""The rule for all claims: a difference with its interval, what is accepted of it, and the verdict that follows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy import special

LEVEL = 0.95  # of the intervals
REPRODUCED, NOT_REPRODUCED, OPEN = "reproduced", "not reproduced", "cannot be judged"
CONDITIONAL = "reproduced under stated conditions"
AT_TOLERANCE = "at the tolerance"
CONTRADICTION, BY_CONSTRUCTION = "contradiction in the paper", "by construction"
NEAR = 0.2  # share of the tolerance within which a value lies at it, if its interval is no wider than the tolerance

Range = tuple[float, float]


@dataclass(frozen=True)
class Mean:
    """Mean over independent trials, with the interval of Student's t distribution."""

    value: float  # the mean
    error: float  # its standard error; nan of a single value
    freedom: float  # degrees of freedom

    @classmethod
    def of(cls, values: ArrayLike) -> Mean:
        """Mean of a sample; nan if one of its values is."""
        sample = pd.Series(values, dtype=float)
        value = float(sample.mean(skipna=False))
        error = float(sample.sem(skipna=False))
        return cls(value, error, len(sample) - 1.0)

    def interval(self, level: float = LEVEL) -> Range:
        """Ends of its interval."""
        margin = self.error * float(special.stdtrit(self.freedom, 0.5 + level / 2))
        return self.value - margin, self.value + margin

    def __sub__(self, other: Mean) -> Mean:
        """Difference of independent means, with the degrees of freedom of Welch and Satterthwaite."""
        first, second = self.error**2, other.error**2
        total = first + second
        freedom = min(self.freedom, other.freedom)
        if total > 0.0:
            freedom = total**2 / (first**2 / self.freedom + second**2 / other.freedom)
        return Mean(self.value - other.value, math.sqrt(total), freedom)


@dataclass(frozen=True)
class Measurement:
    """A number whose 95 % interval was computed where it was made; it is compared alone."""

    value: float  # the number
    low: float = np.nan  # lower end of its interval
    high: float = np.nan  # upper end of its interval

    def interval(self, _level: float = LEVEL) -> Range:
        """Ends of its interval."""
        return self.low, self.high


Quantity = Mean | Measurement


@dataclass(frozen=True)
class Comparison:
    """A result, what it is compared with, and which differences are accepted."""

    label: str  # what is compared, for sentences
    ours: Quantity  # our result
    # Smallest and largest difference that is accepted, both of them included; nan where nothing says so.
    accepted: Range
    paper: float = 0.0  # what it is compared with, such as the published number
    size: bool = False  # compare the size of the difference, whatever its sign
    control: bool = False  # the others mean nothing if this fails; a claim that is reproduced is decided by the others

    @property
    def difference(self) -> float:
        """Our result less the published one."""
        difference = self.ours.value - self.paper
        return abs(difference) if self.size else difference

    def interval(self, level: float = LEVEL) -> Range:
        """Ends of the interval of the difference."""
        low, high = (end - self.paper for end in self.ours.interval(level))
        if self.size:
            return np.max([0.0, low, -high]), np.max([-low, high])
        return low, high

    def room(self, level: float) -> float:
        """How far the interval is within what is accepted; negative if part of it is outside, or there is none."""
        low, high = self.interval(level)
        smallest, largest = self.accepted
        room = float(np.min([low - smallest, largest - high]))
        return -math.inf if math.isnan(room) else room

    def verdict(self, level: float) -> str:
        """Verdict of the rule at a level of confidence."""
        if self.room(level) >= 0.0:
            return REPRODUCED
        low, high = self.interval(level)
        smallest, largest = self.accepted
        if high < smallest or low > largest:
            return NOT_REPRODUCED
        ends = [end for end in self.accepted if low <= end <= high]
        near = any(abs(self.difference - end) <= NEAR * abs(end) for end in ends)
        narrow = any(high - low <= 2.0 * abs(end) for end in ends)
        return AT_TOLERANCE if near and narrow else OPEN


@dataclass(frozen=True)
class Judgement:
    """Verdict on a claim, and the comparison that decides it."""

    verdict: str  # "reproduced", "not reproduced", "at the tolerance" or "cannot be judged"
    decisive: Comparison  # of the comparisons with this verdict the one with the least room
    level: float  # level of its interval that was compared with what is accepted

    @property
    def explanation(self) -> str:
        """What decides the claim, beside the numbers of the ledger, or why nothing does; empty if it is reproduced."""
        if self.verdict == REPRODUCED:
            return ""
        label = self.decisive.label
        if not math.isnan(sum(self.decisive.interval(self.level))):
            return f"{label} decides" if label else ""
        text = "there is no interval, which takes two trials or more"
        if math.isnan(self.decisive.difference):
            text = "there is no result"
        return f"{label}: {text}" if label else text


def judge(comparisons: Sequence[Comparison]) -> Judgement:
    """Judge a claim by one comparison, or by several that it needs all.

    A comparison is reproduced if its whole interval lies within what is accepted, not reproduced if the whole interval
    lies outside, and open otherwise. A claim is reproduced if all its comparisons are, each at 95 %. A wrong claim has
    at least one wrong comparison, which passes by mistake in 2.5 % of all cases at most, so this needs no wider
    intervals. A claim is not reproduced if any comparison is not. Each of them is an occasion for that mistake, so
    these intervals are wider, and hold together with 95 % (Bonferroni). Otherwise the claim cannot be judged.
    """
    simultaneous = 1.0 - (1.0 - LEVEL) / len(comparisons)
    unsure = [part for part in comparisons if part.verdict(LEVEL) != REPRODUCED]
    failures = [part for part in comparisons if part.verdict(simultaneous) == NOT_REPRODUCED]
    level = simultaneous if unsure else LEVEL
    if not unsure:
        verdict = REPRODUCED
        deciding = [part for part in comparisons if not part.control]
    elif failures:
        verdict = NOT_REPRODUCED
        deciding = failures
    else:
        at_tolerance = all(part.verdict(LEVEL) == AT_TOLERANCE for part in unsure)
        verdict = AT_TOLERANCE if at_tolerance else OPEN
        deciding = unsure
    decisive = min(deciding, key=lambda part: part.room(level))
    return Judgement(verdict, decisive, level)
