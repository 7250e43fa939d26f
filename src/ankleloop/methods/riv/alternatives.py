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
from ankleloop.quantities import QUANTITIES
from ankleloop.signals.least_squares import solve_scaled

SIGNIFICANT = 4.5  # standard errors
ONE_SIDED = ("high-pass", "friction", "compression")  # the opposite is no effect of an instrument
SMALLEST_SHIFT, LARGEST_SHIFT = (
    0.01,
    0.2,
)  # of a parameter: less is not told, more is no matter of its interval
ROUNDS = 3  # fits of an effect
STRETCH_DELAY = (
    QUANTITIES["delay"].plausible[0],
    0.1,
)  # s, of a stretch reflex; somewhat longer ones are warned about
POLE = 100.0  # rad/s, where the search for a third one begins

# What an effect is called with its size, and what to do.
EFFECTS = {
    "delay": ("a reflex delay of {:.3g} ms", "give no delay, so that it is estimated"),
    "order": ("a third pole of the reflex at {:.3g} rad/s", "take order=3"),
    "lag": ("a torque recorded {:.2g} ms {} the position", "record both through equal filters"),
    "high-pass": (
        "a high-pass of {:.2g} Hz in the torque",
        "record without AC coupling or removal of drift",
    ),
    "friction": (
        "a friction of {:.2g} N·m",
        "measure the friction of the bearing, and subtract it",
    ),
    "direction": (
        "a reflex gain of {:.3g} N·m·s/rad in the other direction",
        "if the axis is turned round, give position_sign={position_sign}, torque_sign={torque_sign} to read_trial",
    ),
    "compression": (
        "a torque that is flat where it is large",
        "widen the range of the torque sensor",
    ),
}
FACTORS = {"delay": 1e3, "lag": 1e3, "high-pass": 0.5 / np.pi}  # to the unit of this text


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
        size = FACTORS.get(self.effect, 1.0) * (
            abs(self.value) if self.effect == "lag" else self.value
        )
        return EFFECTS[self.effect][0].format(size, "after" if self.value > 0.0 else "before")

    @property
    def significant(self) -> bool:
        """Whether the record shows an effect that an instrument or a joint can have."""
        return (self.score if self.effect in ONE_SIDED else abs(self.score)) > SIGNIFICANT

    @property
    def largest_shift(self) -> float:
        """Largest of the shifts."""
        return max(map(abs, self.shifts.values()))


def add_alternatives(
    estimate: Estimate, alternatives: Iterable[Alternative], trial: PreparedTrial
) -> Estimate:
    """The estimate with the effects that its model lacks, the most significant one first.

    Intervals take in how far this one moves a parameter. Where any of them moves one by a fifth there is a warning.
    """
    shown = [a for a in alternatives if a.significant and a.largest_shift > SMALLEST_SHIFT]
    shown.sort(key=lambda alternative: -abs(alternative.score))
    if not shown:
        return estimate
    values = {**estimate.stiffness, **estimate.reflex}
    for name in shown[0].shifts.keys() & estimate.intervals.keys():
        (low, high), moved = estimate.intervals[name], values[name] * (1.0 + shown[0].shifts[name])
        estimate.intervals[name] = min(low, moved), max(high, moved)
    estimate.diagnostics["alternatives"] = [
        {"effect": a.text, "score": a.score, "shifts": a.shifts} for a in shown
    ]
    least, most = QUANTITIES["delay"].plausible
    for a in shown:
        if a.largest_shift > LARGEST_SHIFT or (a.effect == "delay" and not least < a.value < most):
            remedy = EFFECTS[a.effect][1].format(**turned_signs(trial.trial))
            estimate.diagnostics["warnings"].append(
                f"the model lacks something that depends on the movement. {a.text[0].upper()}{a.text[1:]} explains "
                f"much of it and moves {format_shifts(a.shifts)}: {remedy}."
            )
            break
    return estimate


def compute_shifts(first: Mapping[str, float], second: Mapping[str, float]) -> dict[str, float]:
    """How far K, B, I and G move from some values to others, over what they were; those that both have."""
    return {
        name: second[name] / first[name] - 1.0
        for name in "KBIG"
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
    p, effects = solution.point.parameters, ["lag", "high-pass", "friction", "compression"]
    if p.linear.size == MOTION + 1:  # other bases answer both directions
        effects.append("direction")
    alternatives = [_free_effect(effect, solution) for effect in effects]
    if "delay" not in p.delays and solution.point.movement_p < INCOMPLETE:
        alternatives += _free_unknown("delay", solution, replace(p, delays=("delay",)))
        if p.dynamics.pole is None:  # a third pole and a free delay are nearly the same
            alternatives += _free_unknown(
                "order", solution, replace(p, dynamics=replace(p.dynamics, pole=POLE))
            )
    return alternatives


def _free_effect(effect: str, solution: Search) -> Alternative:
    """The solution with an effect, by steps of its size; without shifts if it is not significant."""
    origin, freed, value = solution.equations, solution, 0.0
    step, error = _step(solution, *_rows(effect, solution.point, origin))
    found = Alternative(effect, step, step / error, {})
    if not found.significant:
        return found
    for number in range(
        1 if effect == "compression" else ROUNDS
    ):  # a cube is but the direction of a saturation
        rows = _rows(effect, freed.point, origin)
        value += _step(freed, *rows)[0] if number else step
        equations, lead = copy(origin), np.exp(origin.band.s * value)
        equations.torque = (
            origin.torque * lead if effect == "lag" else origin.torque - value * rows[0]
        )
        freed = solve(equations, freed.point.parameters)
    return replace(
        found, value=value, shifts=compute_shifts(solution.point.values, freed.point.values)
    )


def _rows(effect: str, point: Point, origin: Equations) -> np.ndarray:
    """Derivatives of the torque with respect to the size of an effect, by the measured and by the predicted inputs.

    Shapes: returns (2, F).
    """
    e, band, s = point.equations, origin.band, origin.band.s
    predicted = point.parameters.linear @ point.instruments[: point.parameters.linear.size]
    if effect == "lag":
        return -s * np.stack([e.torque, predicted])
    if effect == "high-pass":
        return -np.stack([origin.torque, predicted]) / s
    if effect == "compression":
        torques = np.stack(
            [e.regressors.torque - e.regressors.torque.mean(), band.signals(predicted)]
        )
        return -band.transform(torques**2 * torques)
    if effect == "friction":
        return band.transform(np.sign([e.regressors.inputs[:, 1], e.predicted_inputs[:, 1]]))
    velocities, drives = np.stack([e.measured, e.predicted], axis=1)[[1, MOTION]]
    return point.parameters.responses(s)[0] * (drives - np.exp(-s * e.delay) * velocities)


def _step(solution: Search, regressor: np.ndarray, instrument: np.ndarray) -> tuple[float, float]:
    """Step of the size of an effect that solves the equations with it, and the standard error of the size."""
    point, free = solution.point, solution.free
    weighted = np.vstack([point.weighted[free], instrument.conj() / point.level])
    inverse = solve_scaled(
        np.real(weighted @ np.vstack([point.regressors[free], regressor]).T), np.eye(len(weighted))
    )
    scatter = (
        0.5
        * point.equations.band.correlation
        * np.real((weighted * point.noise) @ weighted.conj().T)
    )
    return float(inverse[-1] @ np.real(weighted @ point.residual)), float(
        np.sqrt(inverse[-1] @ scatter @ inverse[-1])
    )


def _free_unknown(effect: str, solution: Search, start: Parameters) -> list[Alternative]:
    """The solution from a start that has the delay or a third pole as an unknown, where there is one."""
    freed = solve(solution.equations, start)
    point, (shortest, longest) = freed.point, STRETCH_DELAY
    values, shift, name = (
        point.values,
        point.parameters.shift,
        "delay" if effect == "delay" else "pole",
    )
    if (
        not freed.converged
        or name in freed.held
        or not (name == "pole" or shortest < values["delay"] < longest)
    ):
        return []
    error = float(
        np.sqrt(point.covariance(freed.free)[-1, -1])
    )  # that of the time constant of a pole
    score = (shift if name == "delay" else 1.0) / error
    return [Alternative(effect, values[name], score, compute_shifts(solution.point.values, values))]
