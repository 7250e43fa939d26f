"""Whether K, B, I and G are the same in all parts of a record, and in all trials that are merged."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy import special

from ankleloop.errors import DataError
from ankleloop.methods.riv.alternatives import (
    CERTAIN,
    SIGNIFICANT,
    SMALLEST_SHIFT,
    find_steps,
    normal_score,
)
from ankleloop.methods.riv.search import Search
from ankleloop.quantities import QUANTITIES, STIFFNESS
from ankleloop.signals.least_squares import solve_scaled

NAMES = (*STIFFNESS, "G")
NAMED = 3.0  # standard errors: a smaller deviation is not named
UNLIKELY = 0.05  # probability of deviations that one factor leaves, if it were all
# Of a joint of which a mean is given: it doubles from one half to the other.
LARGEST_CHANGE = 1.0 / 3.0
LEAST_SHARE = 1e-3  # of a part of which nothing was recorded
LARGEST_RATIO = 10.0  # of two values: one over another that is nearly zero says nothing
# Probability of deviations as large, if all trials had the same parameters: chosen. Measured: where K varies by 3 %
# between four trials, intervals hold the mean over all such trials in 72 of 100.
DIFFERENT = 0.01
LAG_ADVICE = (
    "samples were lost, or the clocks of position and torque differ: record both with one clock"
)
PART_ADVICE = (
    "if the joint did not change, look for a gain that did, or for samples that were lost; a joint that changes is for "
    "riv-tv over time"
)
GAIN_ADVICE = (
    "a gain of position or torque that changes or drifts does that. Calibrate both sensors before "
    "and after a record"
)
JOINT_ADVICE = (
    "the values are means over the record; riv-tv estimates a joint that changes, over time"
)
TRIAL_ADVICE = "look at its channels, and leave it out if it is of another condition"


class Place(NamedTuple):
    """The second of two parts of a record, and what the first one is called."""

    part: str
    other: str


AFTER = Place("from the middle on", "before")
MIDDLE = Place("in the middle half", "before and after")


@dataclass(frozen=True, eq=False)
class Constancy:
    """Deviations of parts of a record, or of trials, from the whole."""

    merged: bool  # whether the parts are trials, and not two of a single one
    shares: np.ndarray  # shape (parts,): of the samples
    influence: np.ndarray  # shape (unknowns, parts): deviations of all unknowns
    deviations: dict[str, np.ndarray]  # of K, B, I and G, shapes (parts,)
    errors: dict[str, np.ndarray]  # their standard errors, shapes (parts,)
    scores: np.ndarray  # shape (parts,): normal scores of the deviations
    probability: float  # of deviations as large, if there were none
    scatter: np.ndarray  # shape (4, 4): covariance of K, B, I and G of the whole

    @property
    def differs(self) -> bool:
        """Whether trials scatter by more than chance, so that intervals are those between trials."""
        return self.merged and self.probability < DIFFERENT

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the unknowns of the whole by the scatter between the parts, shape (unknowns, unknowns)."""
        count = self.shares.size
        weighted = self.influence * self.shares
        return count / (count - 1.0) * weighted @ weighted.T

    def compare_second(self, names: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
        """Deviations of some parameters of the second of two parts, and their covariance.

        Shapes: returns (names,), (names, names).
        """
        places = [NAMES.index(name) for name in names]
        covariance = self.scatter[np.ix_(places, places)] * (1.0 / self.shares[1] - 1.0)
        return np.array([self.deviations[name][1] for name in names]), covariance


class Factors(NamedTuple):
    """Factors by which all parameters of two parts of a record differ from the whole."""

    before: float
    after: float
    score: float  # of their difference over its standard error
    probability: float  # of what it leaves of the deviations, if it were all

    @property
    def is_gain(self) -> bool:
        """Whether they are there, and nothing else."""
        return abs(self.score) > SIGNIFICANT and self.probability > UNLIKELY

    @property
    def shift(self) -> float:
        """How far the ends of a drift lie from the whole: twice as far as the means of its halves."""
        return 2.0 * max(abs(self.before - 1.0), abs(self.after - 1.0))


class Lags(NamedTuple):
    """How late the torque is in parts of a record."""

    values: np.ndarray  # shape (parts,): [s], less the mean
    scores: np.ndarray  # shape (parts,): over their standard errors


def check_intervals(kind: str | None, trials: Sequence[Any]) -> None:
    """Refuse intervals between trials of a single one."""
    if kind == "between trials" and len(trials) == 1:
        raise DataError(
            "intervals between trials need several trials of one condition: pass a list, or leave intervals out."
        )


def _sum_parts(
    contributions: np.ndarray, sizes: Sequence[int], recorded: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Sums of what samples contribute over parts: trials of so many samples, or the halves of a single one; and shares.

    Shapes: contributions (rows, samples), recorded (samples,); returns (rows, parts), (parts,).
    """
    parts = list(sizes)
    if len(parts) == 1:
        half = parts[0] // 2
        parts = [half, parts[0] - half]
    starts = np.cumsum([0, *parts[:-1]])
    counts = np.add.reduceat(recorded.astype(float), starts)
    shares = np.maximum(counts / counts.sum(), LEAST_SHARE)
    return np.add.reduceat(contributions, starts, axis=1), shares / shares.sum()


def compare_parts(
    contributions: np.ndarray,
    sizes: Sequence[int],
    recorded: np.ndarray,
    normal: np.ndarray,
    covariance: np.ndarray,
    rows: Mapping[str, np.ndarray],
) -> Constancy:
    r"""Deviations of parts from the whole, by what they contribute to the left side of the equations.

    The contributions of all parts sum up to zero. Those s of a part that has a share w of the samples say that its
    parameters lie

    .. math:: \delta = H^{-1} s / w

    from those of the whole, H being the slope of the equations. With the covariance C of the whole, that of δ is
    C (1/w - 1).

    `sizes` are the samples of each trial, and `recorded` says which of them count.

    Shapes: contributions (unknowns, samples), recorded (samples,), normal, covariance (unknowns, unknowns), rows
    (unknowns,), of K, B, I and G.
    """
    sums, shares = _sum_parts(contributions, sizes, recorded)
    influence = solve_scaled(normal, sums - np.outer(sums.sum(axis=1), shares)) / shares
    matrix = np.array([rows[name] for name in NAMES])
    deviations = matrix @ influence
    scatter = matrix @ covariance @ matrix.T
    factors = 1.0 / shares - 1.0
    errors = np.sqrt(np.outer(np.diag(scatter), factors))
    scores = [
        normal_score(part, factor * scatter)
        for part, factor in zip(deviations.T, factors, strict=True)
    ]
    squares = np.sum(deviations * solve_scaled(scatter, deviations), axis=0)
    freedom = len(NAMES) * (shares.size - 1)
    return Constancy(
        merged=len(sizes) > 1,
        shares=shares,
        influence=influence,
        deviations=dict(zip(NAMES, deviations, strict=True)),
        errors=dict(zip(NAMES, errors, strict=True)),
        scores=np.array(scores),
        probability=float(special.chdtrc(freedom, shares @ squares)),
        scatter=scatter,
    )


def measure_constancy(solution: Search, place: Place = AFTER) -> Constancy:
    """Deviations of the trials, or of two parts of a single one: its halves, or its ends and its middle."""
    point = solution.point
    free = solution.free
    band = point.equations.band
    contributions = band.contributions(point.instruments[free] / point.level, point.residual)
    recorded = point.equations.recorded
    if place == MIDDLE:
        quarter = recorded.size // 4
        contributions = np.roll(contributions, quarter, axis=1)
        recorded = np.roll(recorded, quarter)
    return compare_parts(
        contributions=contributions,
        sizes=[part.samples for part in band.parts],
        recorded=recorded,
        normal=point.normal[np.ix_(free, free)],
        covariance=solution.covariance,
        rows=solution.rows,
    )


def measure_lags(solution: Search) -> Lags:
    """How late the torque is in the trials, or in the halves of a single one, if that is a further unknown."""
    point = solution.point
    band = point.equations.band
    groups = {"torque_lag": ["torque_lag"]}
    step = find_steps(groups, solution, point.equations)["torque_lag"]
    instruments = np.vstack([point.instruments[solution.free], step.instruments])
    contributions = band.contributions(instruments / point.level, point.residual)
    sizes = [part.samples for part in band.parts]
    sums, shares = _sum_parts(contributions, sizes, point.equations.recorded)
    lags = step.rows[0] @ sums / shares
    deviations = lags - shares @ lags
    errors = np.sqrt(step.covariance.item() * (1.0 / shares - 1.0))
    return Lags(deviations, deviations / errors)


def describe_changes(
    constancy: Constancy,
    values: Mapping[str, float],
    tolerance: float,
    find_lags: Callable[[], Lags] | None = None,
    place: Place = AFTER,
) -> dict[str, list[str]]:
    """Warnings about parts that are so different that the whole says little about them; else a remark of two parts."""
    if not values:
        return {}
    relative = [
        np.abs(constancy.deviations[name] / values[name]) for name in NAMES if name in values
    ]
    shifts = np.max(relative, axis=0)
    shown = constancy.scores > SIGNIFICANT
    # Of parts that differ beyond doubt, and of others.
    tolerances = np.where(constancy.scores > CERTAIN, tolerance, 2.0 * tolerance)
    changes = np.flatnonzero(shown & (shifts > tolerances))
    if constancy.merged:
        lags = find_lags() if find_lags and changes.size else None
        texts = [_describe_trial(constancy, values, lags, number) for number in changes.tolist()]
        return {"warnings": texts} if texts else {}
    factors = measure_factors(constancy, values)
    if factors.is_gain:
        kind = "warnings" if factors.shift > tolerance else "remarks"
        return {kind: [_describe_gain(factors, values, place)]}
    if not np.any(shown & (shifts > SMALLEST_SHIFT)):
        return {}
    kind = "warnings" if changes.size else "remarks"
    lags = find_lags() if find_lags else None
    if lags is not None and np.abs(lags.scores).max() > SIGNIFICANT:
        before, after = lags.values
        return {kind: [f"{place.part} {_describe_lag(after - before)}: {LAG_ADVICE}."]}
    part = _describe_part(constancy, values, place)
    is_small = shifts[1] < LARGEST_CHANGE and factors.probability < UNLIKELY
    if is_small and _has_constant_body(constancy, values):
        return {"remarks": [f"{part}: {JOINT_ADVICE}."]}
    return {kind: [f"{part}: {PART_ADVICE}."]}


def measure_factors(constancy: Constancy, values: Mapping[str, float]) -> Factors:
    """The factors that explain most of how two parts of a record deviate."""
    names = [name for name in NAMES if name in values]
    deviations, covariance = constancy.compare_second(names)
    direction = np.array([values[name] for name in names])
    weighted = solve_scaled(covariance, direction)
    information = weighted @ direction
    excess = weighted @ deviations / information
    rest = deviations - excess * direction
    square = rest @ solve_scaled(covariance, rest)
    first, second = constancy.shares
    return Factors(
        before=float(1.0 - excess * second / first),
        after=float(1.0 + excess),
        score=float(excess * np.sqrt(information)),
        probability=float(special.chdtrc(len(names) - 1, square)) if len(names) > 1 else 0.0,
    )


def _has_constant_body(constancy: Constancy, values: Mapping[str, float]) -> bool:
    """Whether B and I are the same in both parts, as they are where a joint changes."""
    if not {"B", "I"} <= values.keys():
        return False
    return abs(normal_score(*constancy.compare_second(("B", "I")))) < NAMED


def _describe_gain(factors: Factors, values: Mapping[str, float], place: Place) -> str:
    """What a gain that changes makes of all parameters."""
    *first, last = [name for name in NAMES if name in values]
    names = f"{', '.join(first)} and {last}"
    ratio = factors.after / factors.before
    return (
        f"{place.part} {names} are {ratio:.3g} times what they were {place.other}: {GAIN_ADVICE}."
    )


def _describe_part(constancy: Constancy, values: Mapping[str, float], place: Place) -> str:
    """How the second part of a record differs from the first."""
    ratios = []
    differences = []
    for name in _select_named(constancy, values, 1):
        first, second = values[name] + constancy.deviations[name]
        if 1.0 / LARGEST_RATIO < second / first < LARGEST_RATIO:
            ratios.append(f"{name} is {second / first:.2g} times")
        else:
            differences.append(_describe_difference(name, second - first))
    changes = [f"{', '.join(ratios)} what it was {place.other}"] if ratios else []
    return f"{place.part} {', '.join(changes + differences)}"


def _describe_trial(
    constancy: Constancy, values: Mapping[str, float], lags: Lags | None, number: int
) -> str:
    """Warning about a trial that differs from the others."""
    trial = f"trial {number + 1} of {constancy.shares.size} differs"
    if lags is not None and abs(lags.scores[number]) > SIGNIFICANT:
        return f"{trial}: {_describe_lag(lags.values[number])} than in the others: {LAG_ADVICE}."
    share = constancy.shares[number]
    changes = []
    for name in _select_named(constancy, values, number):
        difference = constancy.deviations[name][number] / (1.0 - share)
        others = values[name] - share * difference
        if abs(difference) < LARGEST_RATIO * abs(others):
            changes.append(f"{name} {100 * difference / others:+.0f} %")
        else:
            changes.append(_describe_difference(name, difference))
    return f"{trial}: {', '.join(changes)}: {TRIAL_ADVICE}."


def _select_named(constancy: Constancy, values: Mapping[str, float], number: int) -> list[str]:
    """Parameters of a part that deviate by more than chance; that which deviates most if none does."""
    scores = {
        name: abs(constancy.deviations[name][number]) / constancy.errors[name][number]
        for name in NAMES
        if name in values
    }
    most = max(scores, key=scores.__getitem__)
    return [name for name in scores if scores[name] > NAMED] or [most]


def _describe_difference(name: str, difference: float) -> str:
    """How much larger a parameter is than one that is nearly zero."""
    return f"{name} {difference:+.3g} {QUANTITIES[name].unit}"


def _describe_lag(lag: float) -> str:
    """How late a torque is."""
    order = "later" if lag > 0.0 else "earlier"
    return f"the torque is recorded {1e3 * abs(lag):.2g} ms {order}"
