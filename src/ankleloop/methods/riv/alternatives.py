"""What the model of `riv` may lack: effects of an instrument or of the joint, each freed by itself."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from ankleloop.checks.movement import turned_signs
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.regressors import MOTION
from ankleloop.methods.riv.equations import INCOMPLETE, Equations, Parameters, Point
from ankleloop.methods.riv.search import Search, solve
from ankleloop.quantities import QUANTITIES, STIFFNESS
from ankleloop.signals.least_squares import invert_scaled

SIGNIFICANT = 4.5  # standard errors
SMALLEST_SHIFT = 0.01  # of a parameter: less is not told
LARGEST_SHIFT = 0.2  # of a parameter: more is no matter of its interval
EFFECT_ROUNDS = 3  # fits of an effect
# s, of a stretch reflex; somewhat longer ones are warned about
STRETCH_DELAY = (QUANTITIES["delay"].plausible[0], 0.1)
START_POLE = 100.0  # rad/s, where the search for a third one begins


@dataclass(frozen=True)
class Effect:
    """An effect of an instrument or of the joint, in words."""

    text: str  # what it is called with its size
    advice: str  # what to do
    factor: float = 1.0  # from its size to the unit of the text
    one_sided: bool = False  # the opposite is no effect of an instrument


EFFECTS = {
    "delay": Effect(
        "a reflex delay of {size:.3g} ms", "give no delay, so that it is estimated", factor=1e3
    ),
    "pole": Effect("a third pole of the reflex at {size:.3g} rad/s", "take order=3"),
    "torque_lag": Effect(
        "a torque recorded {length:.2g} ms {order} the position",
        "record both through equal filters",
        factor=1e3,
    ),
    "high-pass": Effect(
        "a high-pass of {size:.2g} Hz in the torque",
        "record without AC coupling or removal of drift",
        factor=0.5 / np.pi,
        one_sided=True,
    ),
    "friction": Effect(
        "a friction of {size:.2g} N·m",
        "measure the friction of the bearing, and subtract it",
        one_sided=True,
    ),
    "direction": Effect(
        "a reflex gain of {size:.3g} N·m·s/rad in the other direction",
        "if the axis is turned round, give position_sign={position_sign}, torque_sign={torque_sign} to read_trial",
    ),
    "compression": Effect(
        "a torque that is flat where it is large",
        "widen the range of the torque sensor",
        one_sided=True,
    ),
}


@dataclass(frozen=True)
class Alternative:
    """The solution with one more effect."""

    effect: str  # name of the effect
    value: float  # its size
    score: float  # size over its standard error
    shifts: dict[str, float]  # how far K, B, I and G move with it, over what they are without it

    @property
    def text(self) -> str:
        """The effect in words."""
        effect = EFFECTS[self.effect]
        size = effect.factor * self.value
        order = "after" if size > 0.0 else "before"
        return effect.text.format(size=size, length=abs(size), order=order)

    @property
    def significant(self) -> bool:
        """Whether the record shows an effect that an instrument or a joint can have."""
        one_sided = EFFECTS[self.effect].one_sided
        return (self.score if one_sided else abs(self.score)) > SIGNIFICANT

    @property
    def largest_shift(self) -> float:
        """Largest of the shifts."""
        return max(map(abs, self.shifts.values()))

    @property
    def doubtful(self) -> bool:
        """Whether it moves a parameter by a fifth, or is the delay of no stretch reflex, so that there is a warning."""
        shortest, longest = QUANTITIES["delay"].plausible
        other_delay = self.effect == "delay" and not shortest < self.value < longest
        return other_delay or self.largest_shift > LARGEST_SHIFT


def with_alternatives(
    estimate: Estimate, alternatives: Iterable[Alternative], trial: PreparedTrial
) -> Estimate:
    """An estimate with what its model lacks: the alternatives that the record shows and that move a parameter.

    They are in the diagnostics, the most significant one first, with a warning about the first one that is doubtful.
    Intervals hold the values with the most significant one, too.
    """
    shown = [
        alternative
        for alternative in alternatives
        if alternative.significant and alternative.largest_shift > SMALLEST_SHIFT
    ]
    if not shown:
        return estimate
    shown.sort(key=lambda alternative: -abs(alternative.score))
    values = estimate.stiffness | estimate.reflex
    intervals = dict(estimate.intervals)
    for name, shift in shown[0].shifts.items():
        if name in intervals:
            ends = (*intervals[name], values[name] * (1.0 + shift))
            intervals[name] = (min(ends), max(ends))
    diagnostics = dict(estimate.diagnostics)
    diagnostics["alternatives"] = [
        {"effect": alternative.text, "score": alternative.score, "shifts": alternative.shifts}
        for alternative in shown
    ]
    doubtful = [alternative for alternative in shown if alternative.doubtful]
    if doubtful:
        first = doubtful[0]
        signs = turned_signs(trial)
        text = first.text
        advice = EFFECTS[first.effect].advice.format(**signs)
        diagnostics["warnings"] = [
            *diagnostics["warnings"],
            f"the model lacks something that depends on the movement. {text[0].upper()}{text[1:]} explains much of it "
            f"and moves {format_shifts(first.shifts)}: {advice}.",
        ]
        if first.effect == "direction":
            diagnostics["remedy"] = signs
    return replace(estimate, intervals=intervals, diagnostics=diagnostics)


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
    """Effects that the record may show and the model does not have.

    The score of each effect costs one solution of linear equations; where it is significant, the equations are solved
    with the effect as a further unknown.
    """
    parameters = solution.point.parameters
    effects = ["torque_lag", "high-pass", "friction", "compression"]
    if parameters.linear.size == MOTION + 1:  # other bases answer both directions
        effects.append("direction")
    alternatives = [_free_effect(effect, solution) for effect in effects]
    if "delay" in parameters.delays or solution.point.movement_p >= INCOMPLETE:
        return alternatives
    starts = {"delay": replace(parameters, delays=("delay",))}
    if parameters.dynamics.pole is None:  # a third pole and a free delay are nearly the same
        dynamics = replace(parameters.dynamics, pole=START_POLE)
        starts["pole"] = replace(parameters, dynamics=dynamics)
    for unknown, start in starts.items():
        alternatives += _free_unknown(unknown, start, solution)
    return alternatives


def _free_effect(effect: str, solution: Search) -> Alternative:
    """The solution with an effect, by steps of its size; without shifts if it is not significant."""
    origin = solution.equations
    step, error = _step(solution, *_differentiate(effect, solution.point, origin))
    alternative = Alternative(effect, step, step / error, {})
    if not alternative.significant:
        return alternative
    size = 0.0
    freed = solution
    # A cube is but the direction of a saturation.
    for _ in range(1 if effect == "compression" else EFFECT_ROUNDS):
        derivatives = _differentiate(effect, freed.point, origin)
        size += _step(freed, *derivatives)[0]
        equations = copy(origin)
        equations.torque = origin.torque - size * derivatives[0]
        if effect == "torque_lag":
            equations.torque = origin.torque * np.exp(origin.band.s * size)
        freed = solve(equations, freed.point.parameters)
    shifts = compute_shifts(solution.point.values, freed.point.values)
    return replace(alternative, value=size, shifts=shifts)


def _differentiate(effect: str, point: Point, origin: Equations) -> np.ndarray:
    """Derivatives of the torque with respect to the size of an effect, by the measured and by the predicted inputs.

    Shapes: returns (2, F).
    """
    equations = point.equations
    band = origin.band
    linear = point.parameters.linear
    predicted_torque = linear @ point.instruments[: linear.size]
    if effect == "torque_lag":
        return -band.s * np.stack([equations.torque, predicted_torque])
    if effect == "high-pass":
        return -np.stack([origin.torque, predicted_torque]) / band.s
    if effect == "compression":
        torques = np.stack([origin.recorded_torque, band.signals(predicted_torque)])
        return -band.transform(torques**2 * torques)
    if effect == "friction":
        velocities = [origin.inputs[1], origin.predicted_inputs[1]]
        return band.transform(np.sign(velocities))
    velocities, drives = np.stack([origin.measured, origin.predicted], axis=1)[[1, MOTION]]
    late = np.exp(-band.s * origin.delay)
    return point.parameters.responses(band.s)[0] * (drives - late * velocities)


def _step(solution: Search, regressor: np.ndarray, instrument: np.ndarray) -> tuple[float, float]:
    """Step of the size of an effect that solves the equations with it, and the standard error of the size."""
    point = solution.point
    free = solution.free
    weighted = np.vstack([point.weighted[free], instrument.conj() / point.level])
    regressors = np.vstack([point.regressors[free], regressor])
    inverse = invert_scaled(np.real(weighted @ regressors.T))
    last = inverse[-1]
    step = last @ np.real(weighted @ point.residual)
    variance = last @ point.scatter_of(weighted) @ last
    return float(step), float(np.sqrt(variance))


def has_stretch_delay(point: Point) -> bool:
    """Whether the delay is one that a stretch reflex can have."""
    shortest, longest = STRETCH_DELAY
    return shortest < point.values["delay"] < longest


def _free_unknown(unknown: str, start: Parameters, solution: Search) -> list[Alternative]:
    """The solution with a delay or a third pole as a further unknown, the last one, where the record shows it."""
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
    score = size / float(np.sqrt(point.covariance(freed.free)[-1, -1]))
    shifts = compute_shifts(solution.point.values, point.values)
    return [Alternative(unknown, point.values[unknown], score, shifts)]
