"""How long to record for intervals of a width, from a pilot or from settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ankleloop.checks.record import SHORTEST_RECORD
from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.options import check_number, show_value
from ankleloop.quantities import QUANTITIES
from ankleloop.signals.vaf import TWO_SIDED
from ankleloop_lab.experiments.experiment import (
    JOINT_SETTINGS,
    LONGEST_RECORD,
    LOST_TIME,
    Experiment,
    describe_joint,
    warn_of_pilot,
)
from ankleloop_lab.experiments.perturbation import PerturbationDesign

# Standard deviation of the logarithm of the planned time, times the root of the length of the pilot [s]: measured,
# 0.44 to 0.65 for K (400 pilots of 12 and 20 s, two loads); chosen somewhat wider.
PLAN_UNCERTAINTY = 0.7


@dataclass(frozen=True)
class DurationPlan:
    """How long to record.

    Parameters
    ----------
    seconds : float
        Length of the record after which every interval is expected to be as narrow as asked for: whole seconds, at
        least the 10 s without which checks refuse a recording [s].
    interval : tuple of float
        95 % interval of that length [s]: the standard errors of a pilot are uncertain themselves.
    parameter : str
        Name of the parameter that takes longest.
    needed : dict
        Time that each parameter takes [s], however short.
    widths : dict
        Half-widths that were asked for, over the values.
    """

    seconds: float
    interval: tuple[float, float]
    parameter: str
    needed: dict[str, float]
    widths: dict[str, float]

    def __str__(self) -> str:
        lines = []
        for name, seconds in self.needed.items():
            symbol = QUANTITIES[name].symbol
            lines.append(f"{symbol} within ±{100 * self.widths[name]:g} %: {seconds:.0f} s")
        reason = f"{QUANTITIES[self.parameter].symbol} decides"
        if self.needed[self.parameter] < SHORTEST_RECORD:
            reason = "a check of the recording refuses a shorter one"
        low, high = self.interval
        lines.append(f"Record {self.seconds:.0f} s ({low:.0f} … {high:.0f} s): {reason}.")
        return "\n".join(lines)


def plan_duration(
    joint: Estimate | PerturbationDesign | Mapping[str, Any], widths: Mapping[str, float]
) -> DurationPlan:
    r"""Length of a record that gives 95 % intervals of a width.

    Standard errors fall with the root of the time. A pilot of length T₁ with a standard error s of a parameter θ gives

    .. math:: T = (T_1 - T_0) \left(\frac{1.96\, s}{w\, \theta}\right)^2 + T_0

    for a half-width of w θ; T₀ = 0.66 s is lost at the ends of a record. The plan is T in whole seconds, and at least
    10 s: checks refuse a shorter recording.

    Parameters
    ----------
    joint : Estimate, PerturbationDesign or mapping
        A pilot of 10 to 20 s, identified by `riv`, of which the record will have perturbation, load and disturbance; a
        design; or settings of `simulate` by name.
    widths : mapping
        Half-width of the 95 % interval over the value, by parameter: ``{"K": 0.05}`` is K within 5 %.

    Returns
    -------
    DurationPlan

    Raises
    ------
    DataError
        If there is no such parameter or no standard error of it, or no record of an hour reaches the width.
    TypeError, ValueError
        For a width that is no number between 0.0001 and 10.

    See Also
    --------
    ankleloop.design_perturbation : The command of the servo, from the same pilot.
    ankleloop.cramer_rao : The smallest standard deviations that are possible.

    Examples
    --------
    >>> from ankleloop import identify, simulate
    >>> pilot = identify(simulate(seed=1, duration=15.0, voluntary=0.3), "riv")
    >>> plan = plan_duration(pilot, {"K": 0.05, "G": 0.2})
    >>> plan.parameter, plan.interval[0] < plan.seconds < plan.interval[1]
    ('K', True)
    """
    if not isinstance(widths, Mapping) or not widths:
        raise TypeError(
            f"plan_duration: widths must be a mapping such as {{'K': 0.05}}, got {show_value(widths)}."
        )
    values, errors, used = _expect(joint)
    shared: Mapping[str, float] = {}
    if isinstance(joint, Estimate):
        shared = joint.diagnostics.get("apparatus", {}).get("standard_errors", {})
    needed = {}
    for name, width in widths.items():
        if name not in values:
            raise DataError(
                f"there is no parameter {name!r} to plan for; there are {', '.join(values)}."
            )
        share = check_number("plan_duration", f"widths: {name}", width, ge=1e-4, le=10)
        error = errors.get(name, np.nan)
        if not (np.isfinite(error) and values[name] != 0):
            raise DataError(
                f"{name} has no standard error: identify a pilot by riv whose perturbation excites it, of 15 s or more."
            )
        half_width = share * abs(values[name])
        least = TWO_SIDED * shared.get(name, 0.0)
        if half_width <= least:
            raise DataError(
                f"{name} within {100 * share:.2g} % cannot be had however long the record is: the apparatus alone "
                f"leaves {100 * least / abs(values[name]):.2g} %. Record the empty device for longer."
            )
        # The share of the apparatus does not fall with the time.
        own = np.sqrt(error**2 - shared.get(name, 0.0) ** 2)
        narrowing = TWO_SIDED * own / np.sqrt(half_width**2 - least**2)
        needed[name] = used * narrowing**2 + LOST_TIME
        if needed[name] > LONGEST_RECORD:
            within = share * np.sqrt((needed[name] - LOST_TIME) / (LONGEST_RECORD - LOST_TIME))
            raise DataError(
                f"{name} within {100 * share:.2g} % would take {needed[name]:.0f} s, and records of more than "
                f"{LONGEST_RECORD:g} s are not planned: ask for {100 * within:.2g} % or more, or perturb more strongly "
                "(ankleloop.design_perturbation)."
            )
    parameter = max(needed, key=needed.__getitem__)
    seconds = _record_length(needed[parameter])
    # Length of the record that the standard error is of [s].
    reliable = used if isinstance(joint, Estimate) else seconds - LOST_TIME
    ratio = float(np.exp(TWO_SIDED * PLAN_UNCERTAINTY / np.sqrt(reliable)))
    effective = needed[parameter] - LOST_TIME
    low = _record_length(effective / ratio + LOST_TIME)
    high = _record_length(effective * ratio + LOST_TIME)
    return DurationPlan(seconds, (low, high), parameter, needed, dict(widths))


def _record_length(needed: float) -> float:
    """Length of a record in whole seconds, for a time that is needed [s]."""
    return max(SHORTEST_RECORD, float(np.ceil(needed)))


def _expect(
    joint: Estimate | PerturbationDesign | Mapping[str, Any],
) -> tuple[dict[str, float], Mapping[str, float], float]:
    """Values and standard errors of parameters, and the time of the record that these count [s]."""
    if isinstance(joint, Estimate):
        warn_of_pilot("plan_duration", joint)
        used = joint.torque.sizes["time"] / joint.torque.attrs["identification_rate"]
        errors = joint.standard_errors
        return {**joint.stiffness, **joint.reflex}, errors, used
    if isinstance(joint, PerturbationDesign):
        settings = joint.experiment.settings
        seconds = joint.seconds
        errors = joint.standard_errors
    else:
        settings = describe_joint("plan_duration", joint, {})
        seconds = settings.duration
        experiment = Experiment.of(joint, settings, {}, 0)
        variances = experiment.variances(experiment.draw({}, 0))
        errors = {name: float(np.sqrt(variance)) for name, variance in variances.items()}
    values = {name: getattr(settings, JOINT_SETTINGS[name]) for name in errors}
    return values, errors, seconds - LOST_TIME
