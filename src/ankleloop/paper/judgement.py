"""The rule for all claims: a difference with its interval, what is accepted of it, and the verdict that follows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from ankleloop.signals.vaf import confidence_margin

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
    error: float  # its standard error
    freedom: float  # degrees of freedom; a mean with less than one has no interval

    @classmethod
    def of(cls, values: ArrayLike) -> Mean:
        """Mean of a sample; nan if one of its values is."""
        values = np.asarray(values, dtype=float)
        if values.size < 2:
            return cls(float(values.mean()) if values.size else np.nan, np.nan, 0.0)
        return cls(float(values.mean()), float(values.std(ddof=1) / np.sqrt(values.size)), values.size - 1.0)

    def margin(self, level: float = LEVEL) -> float:
        """Half of its interval."""
        if not self.freedom >= 1.0:
            return np.nan
        size = self.freedom + 1.0  # of a sample with this standard error
        return float(confidence_margin(self.error * np.sqrt(size), size, level))

    def interval(self, level: float = LEVEL) -> Range:
        """Ends of its interval."""
        margin = self.margin(level)
        return self.value - margin, self.value + margin

    @property
    def text(self) -> str:
        """The mean and half of its 95 % interval in words."""
        return format_interval(self.value, self.margin(), ".4g")

    def __sub__(self, other: Mean) -> Mean:
        """Difference of independent means, with the degrees of freedom of Welch and Satterthwaite."""
        first, second = self.error**2, other.error**2
        total = first + second
        freedom = min(self.freedom, other.freedom)
        if freedom >= 1.0 and total > 0.0:
            freedom = total**2 / (first**2 / self.freedom + second**2 / other.freedom)
        return Mean(self.value - other.value, math.sqrt(total), freedom)


@dataclass(frozen=True)
class Replicates:
    """A statistic with the percentile interval of its bootstrap replicates, extended to the statistic itself.

    Means of samples drawn from trials have the noise of the trials twice, and a rank correlation suffers from noise:
    its replicates may all be closer to zero than itself. They show then that it is uncertain, and not that it is wrong.
    """

    value: float  # the statistic
    # Shape (R,): the same statistic of samples drawn with replacement; empty where there is nothing to draw from.
    replicates: np.ndarray

    def interval(self, level: float = LEVEL) -> Range:
        """Ends of its interval."""
        if not self.replicates.size:
            return np.nan, np.nan
        low, high = np.quantile(self.replicates, [(1 - level) / 2, (1 + level) / 2])
        return float(min(low, self.value)), float(max(high, self.value))


@dataclass(frozen=True)
class Measurement:
    """A measurement whose 95 % interval was computed where it was made; it is compared alone."""

    value: float  # the measurement
    low: float = np.nan  # lower end of its interval
    high: float = np.nan  # upper end of its interval

    def interval(self, _level: float = LEVEL) -> Range:
        """Ends of its interval."""
        return self.low, self.high


Quantity = Mean | Replicates | Measurement


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
        if not self.size:
            return low, high
        if math.isnan(low + high):
            return np.nan, np.nan
        return max(0.0, low, -high), max(-low, high)

    def room(self, level: float) -> float:
        """How far the interval is within what is accepted; negative if part of it is outside."""
        low, high = self.interval(level)
        return float(np.min([low - self.accepted[0], self.accepted[1] - high]))

    def verdict(self, level: float) -> str:
        """Verdict of the rule at a level of confidence."""
        low, high = self.interval(level)
        smallest, largest = self.accepted
        if low >= smallest and high <= largest:
            return REPRODUCED
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
    level: float  # level of its interval

    @property
    def interval(self) -> Range:
        """Interval of the difference that was compared with what is accepted."""
        return self.decisive.interval(self.level)

    @property
    def explanation(self) -> str:
        """What keeps the claim from being reproduced, for a sentence; empty if nothing does."""
        low, high = self.interval
        label = f"{self.decisive.label}: " if self.decisive.label else ""
        if self.verdict == REPRODUCED or math.isnan(sum(self.decisive.accepted)):
            return ""
        if math.isnan(self.decisive.difference):
            return f"{label}there is no result"
        if math.isnan(low + high):
            return f"{label}there is no interval, which takes two trials or more"
        place = "lies outside" if self.verdict == NOT_REPRODUCED else "reaches beyond"
        return (
            f"{label}the difference, {low:.3g} … {high:.3g} at {100 * self.level:.4g} %, {place} what is accepted, "
            f"{_describe_range(*self.decisive.accepted)}"
        )


@dataclass(frozen=True)
class Fact:
    """What no run can change, such as a count in the paper, or what follows from a definition."""

    value: float  # the fact
    expected: float  # what the paper says, or what the definition gives
    of_paper: bool = False  # it is a fact of the paper alone, which then contradicts itself if the two differ

    @property
    def verdict(self) -> str:
        """Verdict on the claim."""
        if self.value == self.expected:
            return BY_CONSTRUCTION
        return CONTRADICTION if self.of_paper else NOT_REPRODUCED


def _describe_range(low: float, high: float) -> str:
    if math.isinf(low):
        return f"at most {high:g}"
    return f"at least {low:g}" if math.isinf(high) else f"{low:g} … {high:g}"


def format_interval(value: float, margin: float, spec: str) -> str:
    """A value and half of its interval; without an interval the value alone."""
    return f"{value:{spec}}" + ("" if pd.isna(margin) else f" ± {margin:.2g}")


def judge(comparisons: Sequence[Comparison]) -> Judgement:
    """Judge a claim by one comparison, or by several that it needs all.

    A comparison is reproduced if its whole interval lies within what is accepted, not reproduced if the whole interval
    lies outside, and open otherwise. A claim is reproduced if all its comparisons are, each at 95 %. A wrong claim has
    at least one wrong comparison, which passes by mistake in 2.5 % of all cases at most, so this needs no wider
    intervals. A claim is not reproduced if any comparison is not. Each of them is an occasion for that mistake, so
    these intervals are wider, and hold together with 95 % (Bonferroni). Otherwise the claim cannot be judged.
    """
    simultaneous = LEVEL if len(comparisons) == 1 else 1.0 - (1.0 - LEVEL) / len(comparisons)
    if all(comparison.verdict(LEVEL) == REPRODUCED for comparison in comparisons):
        claimed = [comparison for comparison in comparisons if not comparison.control]
        return _find_decisive(REPRODUCED, claimed or comparisons, LEVEL)
    failures = [comparison for comparison in comparisons if comparison.verdict(simultaneous) == NOT_REPRODUCED]
    if failures:
        return _find_decisive(NOT_REPRODUCED, failures, simultaneous)
    unsure = [part for part in comparisons if part.verdict(LEVEL) != REPRODUCED]
    at_tolerance = all(part.verdict(LEVEL) == AT_TOLERANCE for part in unsure)
    return _find_decisive(AT_TOLERANCE if at_tolerance else OPEN, unsure, simultaneous)


def _find_decisive(verdict: str, comparisons: Sequence[Comparison], level: float) -> Judgement:
    """The judgement by the comparison with the least room; one without an interval has none."""
    rooms = [-math.inf if math.isnan(room := part.room(level)) else room for part in comparisons]
    return Judgement(verdict, comparisons[int(np.argmin(rooms))], level)
