"""What the model of `riv` may lack: effects of an instrument or of the joint, each freed by itself."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy import special

from ankleloop.checks.movement import turned_signs
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.intervals import extend_intervals
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.regressors import MOTION
from ankleloop.joint.verdicts import exceeds, largest_shift
from ankleloop.methods.riv.effects import EFFECTS, Channels, list_effects
from ankleloop.methods.riv.equations import INCOMPLETE, Equations, Parameters, Point
from ankleloop.methods.riv.search import Search, solve
from ankleloop.quantities import QUANTITIES, STIFFNESS
from ankleloop.signals.least_squares import invert_scaled, solve_scaled

SIGNIFICANT = 3.5  # standard errors
CERTAIN = 6.0  # standard errors: beyond doubt
MOST_EFFECTS = 3  # that are looked for one beside the other
SMALLEST_SHIFT = 0.01  # of a parameter: less is not told
SMALLEST_PROBABILITY = 1e-300
# Of the power of the torque: measured, 0.8e-5 to 2.1e-5 is left without noise, 7.8e-5 to 9.5e-5 at 40 dB, 6.8e-4 or
# more at 30 dB (10 trials each, two loads).
LEAST_UNEXPLAINED = 1e-4
EQUAL_SCORE = 0.9  # of the largest score: chosen, so that no effect is named that the record hardly tells from another
# s, of a stretch reflex; somewhat longer ones are warned about
STRETCH_DELAY = (QUANTITIES["delay"].plausible[0], 0.1)
TOGETHER = "together"  # name of all effects
TWO_SIDED = 1.96  # standard errors, of an interval of 95 %
START_POLE = 100.0  # rad/s, where the search for a third one begins


@dataclass(frozen=True)
class Alternative:
    """The solution with one more effect."""

    effect: str  # name of the effect
    size: Any  # of the effect: a number, or an array with one for each part of it
    score: float  # size over its standard error
    shifts: dict[str, float]  # how far K, B, I and G move with it, over what they are without it
    freed: Search | None = None  # the solution with it, where there is one
    rivals: tuple[Alternative, ...] = ()  # effects that the record hardly tells from it

    @property
    def text(self) -> str:
        """The effect in words."""
        return EFFECTS[self.effect].describe(self.size)

    @property
    def significant(self) -> bool:
        """Whether the record shows an effect that an instrument or a joint can have."""
        one_sided = EFFECTS[self.effect].one_sided
        return (self.score if one_sided else abs(self.score)) > SIGNIFICANT

    @property
    def is_noticeable(self) -> bool:
        """Whether it moves a parameter by so much that it is told."""
        return largest_shift(self.shifts) > SMALLEST_SHIFT

    def of(self, names: Iterable[str]) -> Alternative:
        """The alternative with the shifts of some parameters alone."""
        return replace(
            self,
            shifts={name: self.shifts[name] for name in self.shifts if name in names},
            rivals=tuple(rival.of(names) for rival in self.rivals),
        )

    @property
    def is_other_delay(self) -> bool:
        """Whether it is the delay of no stretch reflex."""
        shortest, longest = QUANTITIES["delay"].plausible
        return self.effect == "delay" and not shortest < self.size < longest


def _rank(alternative: Alternative) -> float:
    """Size of a score, by which alternatives are ordered."""
    return abs(alternative.score)


def choose_likeliest(candidates: Iterable[Alternative]) -> list[Alternative]:
    """The most significant alternative, with those that explain as much; none where none is significant."""
    shown = sorted([each for each in candidates if each.significant], key=_rank, reverse=True)
    if not shown:
        return []
    first, *others = shown
    rivals = [
        each for each in others if _rank(each) > EQUAL_SCORE * _rank(first) and each.is_noticeable
    ]
    return [replace(first, rivals=tuple(rivals))]


def with_alternatives(
    estimate: Estimate,
    alternatives: Iterable[Alternative],
    trial: PreparedTrial,
    tolerance: float,
) -> Estimate:
    """An estimate with what its model lacks: effects that the record shows one beside the other.

    They are in the diagnostics. Where all together move a parameter by more than the tolerance, they are a warning,
    else a remark, and intervals hold the values with them, too.
    """
    values = estimate.values
    given = [alternative.of(values) for alternative in alternatives]
    shown = [alternative for alternative in given if alternative.is_noticeable]
    if not shown:
        return estimate
    shifts = add_shifts([alternative.shifts for alternative in shown])
    intervals = extend_intervals(estimate.intervals, values, shifts)
    diagnostics = dict(estimate.diagnostics)
    diagnostics["alternatives"] = [
        {"effect": each.text, "score": each.score, "shifts": each.shifts}
        for alternative in shown
        for each in (alternative, *alternative.rivals)
    ]
    diagnostics["shifts"] = shifts
    is_large = any(exceeds(total, tolerance) for total in _list_totals(shown))
    if is_large or shown[0].is_other_delay:
        signs = turned_signs(trial)
        kind = "warnings"
        text = _describe_warning(shown, signs)
        if shown[0].effect == "direction":
            diagnostics["remedy"] = signs
    else:
        kind = "remarks"
        text = _describe_remark(shown, shifts)
    diagnostics[kind] = [*diagnostics.get(kind, ()), text]
    return replace(estimate, intervals=intervals, diagnostics=diagnostics)


def _list_totals(alternatives: Sequence[Alternative]) -> list[dict[str, float]]:
    """Sums of what all effects make wrong: with the likeliest ones, and with each rival of the first in its place."""
    first, *others = alternatives
    beside = [each.shifts for each in others]
    return [add_shifts([each.shifts, *beside]) for each in (first, *first.rivals)]


def _describe_warning(alternatives: Sequence[Alternative], signs: Mapping[str, int]) -> str:
    """What the model lacks, how far it moves parameters, and what to do."""
    first, *others = alternatives
    text = "the model lacks something that depends on the movement."
    lookalikes = EFFECTS[first.effect].lookalikes
    if first.rivals or lookalikes:
        causes = [f"{each.text} ({_describe_move(each, signs)})" for each in (first, *first.rivals)]
        text = f"{text} One of: {'; '.join([*causes, *lookalikes])}. The record does not tell which: check each."
    else:
        name = first.text
        text = f"{text} {name[0].upper()}{name[1:]} explains much of it and {_describe_move(first, signs)}."
    for other in others:
        text = f"{text} Beside it, {other.text} {_describe_move(other, signs)}."
    return text


def _describe_remark(alternatives: Sequence[Alternative], shifts: Mapping[str, float]) -> str:
    """What the model lacks, with a size that the intervals hold."""
    first, *others = alternatives
    causes = [first.text, *[each.text for each in first.rivals], *EFFECTS[first.effect].lookalikes]
    names = [f"one of: {'; '.join(causes)}" if len(causes) > 1 else first.text]
    names += [each.text for each in others]
    return (
        f"the record shows {', and beside it '.join(names)}. The model lacks that, which would move "
        f"{format_shifts(shifts)}: the intervals hold both values."
    )


def _describe_move(alternative: Alternative, signs: Mapping[str, int]) -> str:
    """What an effect moves, and what to do."""
    advice = EFFECTS[alternative.effect].advice.format(**signs)
    return f"moves {format_shifts(alternative.shifts)}: {advice}"


def add_shifts(shifts: Iterable[Mapping[str, float]]) -> dict[str, float]:
    """Relative shifts of parameters by all of some effects.

    >>> add_shifts([{"K": 0.1, "B": 0.5}, {"K": -0.1}])
    {'K': 0.0, 'B': 0.5}
    """
    total: dict[str, float] = {}
    for shift in shifts:
        for name, value in shift.items():
            total[name] = total.get(name, 0.0) + value
    return total


def compute_shifts(first: Mapping[str, float], second: Mapping[str, float]) -> dict[str, float]:
    """How far K, B, I and G move from some values to others, over what they were; those that both have."""
    return {
        name: second[name] / first[name] - 1.0
        for name in (*STIFFNESS, "G")
        if first.get(name) and name in second
    }


def format_shifts(shifts: Mapping[str, float]) -> str:
    """Shifts in words."""
    return ", ".join(f"{name} by {100 * shift:+.2g} %" for name, shift in shifts.items())


def find_alternatives(solution: Search) -> list[Alternative]:
    """Effects that the record shows and the model does not have: the likeliest one, the likeliest one beside it, ….

    The score of each effect costs one solution of linear equations; where it is significant, the equations are solved
    with the effect as a further unknown. What they leave may be a mixture of effects.
    """
    point = solution.point
    unexplained = np.sum(np.abs(point.residual) ** 2)
    if unexplained < LEAST_UNEXPLAINED * np.sum(np.abs(solution.equations.torque) ** 2):
        return []
    effects = list_effects(open_loop=solution.equations.open_loop, passive=point.parameters.passive)
    # Other bases than the rectifier answer both directions.
    answers_both = point.parameters.linear.size > MOTION + 1
    if answers_both:
        effects = [name for name in effects if name not in ("direction", "threshold")]
    candidates = _free_effects(effects, solution)
    if answers_both:
        candidates.append(_separate_directions(solution))
    candidates += _free_unknowns(solution)
    alternatives: list[Alternative] = []
    last = solution
    while len(alternatives) < MOST_EFFECTS:
        likeliest = choose_likeliest(candidates)
        alternatives += likeliest
        if not likeliest or likeliest[0].freed is None:
            break
        last = likeliest[0].freed
        effects = [name for name in effects if name != likeliest[0].effect]
        candidates = _free_effects(effects, last)
    if answers_both:  # what a curve of other bases leaves of a ramp would be a mixture
        return alternatives
    return [*alternatives, *_combine_effects(effects, last)]


def _free_effects(names: Sequence[str], solution: Search) -> list[Alternative]:
    """The solutions with each of some effects."""
    steps = find_steps({name: [name] for name in names}, solution, solution.equations)
    return [_free_effect(name, solution, step) for name, step in steps.items()]


def _free_unknowns(solution: Search) -> list[Alternative]:
    """The solutions with a delay or a third pole, where the residual depends on the movement."""
    parameters = solution.point.parameters
    is_known = "delay" in parameters.delays or parameters.passive
    if is_known or solution.point.movement_p >= INCOMPLETE:
        return []
    starts = {"delay": replace(parameters, delays=("delay",))}
    if parameters.dynamics.pole is None:  # a third pole and a free delay are nearly the same
        dynamics = replace(parameters.dynamics, pole=START_POLE)
        starts["pole"] = replace(parameters, dynamics=dynamics)
    return [
        alternative
        for unknown, start in starts.items()
        for alternative in _free_unknown(unknown, start, solution)
    ]


def _separate_directions(solution: Search) -> Alternative:
    """Gains of a reflex in both directions, by the curve of a basis that answers both.

    The ramp of the usual direction begins at its threshold, else what the curve lacks below it would be the other gain.
    """
    point = solution.point
    path = point.reflex_path
    velocity = path.basis.quantiles
    above = velocity - max(path.rectifier.threshold, 0.0)
    ramps = np.stack([np.ones(velocity.size), above.clip(0.0), (-velocity).clip(0.0)])
    functions = path.basis(velocity)
    weights = np.linalg.lstsq(ramps.T, functions.T, rcond=None)[0]
    _, gain, other_gain = weights @ path.coefficients
    block = slice(MOTION, MOTION + path.coefficients.size)
    covariance = solution.covariance[block, block]
    score = other_gain / np.sqrt(weights[2] @ covariance @ weights[2])
    # Also of a curve that is no ramp, which has no G.
    shifts = {"G": float(gain) / path.rectifier.gain - 1.0}
    return Alternative("direction", float(other_gain), float(score), shifts)


def _combine_effects(names: Sequence[str], solution: Search) -> list[Alternative]:
    """What all effects that are left move together, by one step: each may be too small to be seen by itself.

    A mixture can move parameters far where it explains little, so only shifts count that are larger than the interval
    and certain.
    """
    step = find_steps({TOGETHER: names}, solution, solution.equations)[TOGETHER]
    move = step.move[:MOTION]
    errors = np.sqrt(np.diag(step.move_covariance)[:MOTION])
    margins = TWO_SIDED * np.sqrt(np.diag(solution.covariance)[:MOTION])
    certain = np.abs(move) > np.maximum(SIGNIFICANT * errors, margins)
    moved = solution.point.parameters.linear[:MOTION] + move
    stiffness = dict(zip(STIFFNESS, moved.tolist(), strict=True))
    shifts = compute_shifts(solution.shown_values, stiffness)
    shown = {name: shifts[name] for name in np.array(STIFFNESS)[certain].tolist() if name in shifts}
    mixture = Alternative(TOGETHER, step.sizes, normal_score(step.sizes, step.covariance), shown)
    return [mixture] if mixture.score > CERTAIN and shown else []


def _free_effect(name: str, solution: Search, step: Step) -> Alternative:
    """The solution with an effect, by steps of its size; without shifts if it is not significant."""
    origin = solution.equations
    alternative = Alternative(name, 0.0, normal_score(step.sizes, step.covariance), {})
    if not alternative.significant:
        return alternative
    sizes = np.zeros(step.sizes.size)
    freed = solution
    for number in range(EFFECTS[name].rounds):
        if number:
            step = find_steps({name: [name]}, freed, origin)[name]
        sizes += step.sizes
        equations = copy(origin)
        equations.torque = origin.torque - sizes @ step.regressors
        if name == "torque_lag":
            equations.torque = origin.torque * np.exp(origin.band.s * sizes)
        freed = solve(equations, freed.point.parameters)
    return replace(
        alternative,
        size=np.squeeze(sizes),
        shifts=compute_shifts(solution.shown_values, freed.point.values),
        freed=freed,
    )


def normal_score(sizes: np.ndarray, covariance: np.ndarray) -> float:
    """A size over its standard error; of several sizes the normal score of the probability of their χ².

    Shapes: sizes (q,), covariance (q, q), which is zero where the record cannot show them.
    """
    if not covariance.any():
        return 0.0
    if sizes.size == 1:
        return float(sizes.item() / np.sqrt(covariance.item()))
    square = float(sizes @ solve_scaled(covariance, sizes))
    probability = special.chdtrc(sizes.size, square)
    if probability < SMALLEST_PROBABILITY:
        return float(np.sqrt(square))
    return float(-special.ndtri(0.5 * probability))


class Step(NamedTuple):
    """Step of the sizes of an effect that solves the equations with it."""

    sizes: np.ndarray  # shape (q,)
    covariance: np.ndarray  # shape (q, q)
    move: np.ndarray  # shape (free,): step of the other unknowns
    move_covariance: np.ndarray  # shape (free, free): of that step, by that of the sizes
    # Derivatives of the torque with respect to the sizes, measured and predicted, shape (q, F).
    regressors: np.ndarray
    instruments: np.ndarray
    rows: np.ndarray  # shape (q, free + q): what left sides move the sizes by


def _make_channels(point: Point, inputs: np.ndarray, spectra: np.ndarray) -> Channels:
    """Signals that effects are made of, with the torque that the instruments give.

    Shapes: inputs (3 + k, samples), spectra (3 + k, frequencies).
    """
    equations = point.equations
    band = equations.band
    torque = point.parameters.torque(spectra[:MOTION], spectra[MOTION:], band.s)
    return Channels(
        position=band.centre(inputs[0]),
        velocity=inputs[1],
        motion=spectra[:2],
        torque=torque,
        recorded=torque,
        rectified=spectra[MOTION],
        reference=equations.reference,
        response=point.parameters.responses(band.s)[0],
        gain=point.reflex_path.rectifier.gain,
        delay=equations.delay,
        s=band.s,
        transform=band.transform,
        signals=band.signals,
    )


def find_steps(
    groups: Mapping[str, Sequence[str]], solution: Search, origin: Equations
) -> dict[str, Step]:
    """Steps of the sizes of groups of effects, each by itself; the torque of the solution may be less some of them."""
    point = solution.point
    free = solution.free
    names = list(dict.fromkeys(name for group in groups.values() for name in group))
    predicted = _make_channels(point, origin.predicted_inputs, origin.predicted)
    measured = replace(
        _make_channels(point, origin.inputs, origin.measured),
        torque=point.equations.torque,
        recorded=origin.torque,
    )
    regressors, instruments = (
        {name: origin.select_recorded(EFFECTS[name].rows(channels)) for name in names}
        for channels in (measured, predicted)
    )
    weighted = np.vstack(
        [point.weighted[free], np.vstack([*instruments.values()]).conj() / point.level]
    )
    products = np.real(weighted @ np.vstack([point.regressors[free], *regressors.values()]).T)
    scatter = point.scatter_of(weighted)
    side = np.real(weighted @ point.residual)
    owners = np.repeat(names, [len(rows) for rows in regressors.values()])
    known = slice(free.size)
    inverse = invert_scaled(products[known, known])
    steps = {}
    for label, group in groups.items():
        places = free.size + np.flatnonzero(np.isin(owners, group))
        # What the other unknowns leave of the effects.
        common = products[places, known] @ inverse
        own = products[np.ix_(places, places)] - common @ products[known, places]
        rows = invert_scaled(own) @ np.hstack([-common, np.eye(places.size)])
        unknowns = np.concatenate([np.arange(free.size), places])
        sizes = rows @ side[unknowns]
        covariance = rows @ scatter[np.ix_(unknowns, unknowns)] @ rows.T
        effect_moves = inverse @ products[known, places]
        steps[label] = Step(
            sizes=sizes,
            covariance=covariance,
            move=inverse @ side[known] - effect_moves @ sizes,
            move_covariance=effect_moves @ covariance @ effect_moves.T,
            regressors=np.vstack([regressors[name] for name in group]),
            instruments=np.vstack([instruments[name] for name in group]),
            rows=rows,
        )
    return steps


def has_stretch_delay(point: Point) -> bool:
    """Whether the delay is one that a stretch reflex can have."""
    shortest, longest = STRETCH_DELAY
    return shortest < point.values["delay"] < longest


def _free_unknown(unknown: str, start: Parameters, solution: Search) -> list[Alternative]:
    """The solution with a delay or a third pole as a further unknown, where the record shows it."""
    freed = solve(solution.equations, start)
    point = freed.point
    # The error of the logarithm of a pole is the relative one of its time constant.
    size = 1.0
    shown = "pole" not in freed.held
    if unknown == "delay":
        size = point.parameters.shift
        shown = has_stretch_delay(point)
    if not (freed.converged and shown):
        return []
    score = size / freed.error(unknown)
    shifts = compute_shifts(solution.shown_values, point.values)
    return [Alternative(unknown, point.values[unknown], score, shifts)]
