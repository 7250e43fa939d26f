"""How long to record for intervals of a width, from a pilot or from settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ankleloop.errors import DataError
from ankleloop.experiments.experiment import (
    LOST,
    SETTINGS,
    Experiment,
    describe_joint,
    warn_of_pilot,
)
from ankleloop.experiments.perturbation import PerturbationDesign
from ankleloop.joint.estimate import Estimate
from ankleloop.options import check_number, show_value
from ankleloop.quantities import QUANTITIES
from ankleloop.signals.vaf import TWO_SIDED

LONGEST = 3600.0  # s
# Standard deviation of the logarithm of the planned time, times the root of the length of the pilot [s].
UNCERTAINTY = 0.7


@dataclass(frozen=True)
class DurationPlan:
    """How long to record.

    Parameters
    ----------
    seconds : float
        Length of the record after which every interval is expected to be as narrow as asked for [s].
    interval : tuple of float
        95 % interval of that time [s]: the standard errors of a pilot are uncertain themselves.
    parameter : str
        Name of the parameter that decides: it takes longest.
    needed : dict
        Time for each parameter [s].
    widths : dict
        Half-widths that were asked for, over the values.
    """

    seconds: float
    interval: tuple[float, float]
    parameter: str
    needed: dict[str, float]
    widths: dict[str, float]

    def __str__(self) -> str:
        lines = [
            f"{QUANTITIES[name].symbol} within ±{100 * self.widths[name]:g} %: {seconds:.0f} s"
            for name, seconds in self.needed.items()
        ]
        low, high = self.interval
        decides = QUANTITIES[self.parameter].symbol
        return "\n".join(
            [*lines, f"Record {self.seconds:.0f} s ({low:.0f} … {high:.0f} s): {decides} decides."]
        )


def plan_duration(
    joint: Estimate | PerturbationDesign | Mapping[str, Any], widths: Mapping[str, float]
) -> DurationPlan:
    r"""Length of a record that gives 95 % intervals of a width.

    Standard errors fall with the root of the time. A pilot of length T₁ with a standard error s of a parameter θ gives

    .. math:: T = (T_1 - T_0) \left(\frac{1.96\, s}{w\, \theta}\right)^2 + T_0

    for a half-width of w θ; T₀ = 0.66 s is lost at the ends of a record.

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
    needed = {}
    for name, width in widths.items():
        if name not in values:
            raise DataError(
                f"there is no parameter {name!r} to plan for; there are {', '.join(values)}."
            )
        width = check_number("plan_duration", f"widths: {name}", width, ge=1e-4, le=10)
        error = errors.get(name, np.nan)
        if not (np.isfinite(error) and values[name] != 0):
            raise DataError(
                f"{name} has no standard error: identify a pilot by riv whose perturbation excites it, of 15 s or more."
            )
        needed[name] = used * (TWO_SIDED * error / (width * values[name])) ** 2 + LOST
        if needed[name] > LONGEST:
            within = width * np.sqrt((needed[name] - LOST) / (LONGEST - LOST))
            raise DataError(
                f"{name} within {100 * width:.2g} % would take {needed[name]:.0f} s, and records of more than "
                f"{LONGEST:g} s are not planned: ask for {100 * within:.2g} % or more, or perturb more strongly "
                "(ankleloop.design_perturbation)."
            )
    parameter = max(needed, key=needed.__getitem__)
    seconds = needed[parameter]
    reliable = (
        used if isinstance(joint, Estimate) else seconds - LOST
    )  # s of record that the standard error is of
    ratio = float(np.exp(TWO_SIDED * UNCERTAINTY / np.sqrt(reliable)))
    interval = (seconds - LOST) / ratio + LOST, (seconds - LOST) * ratio + LOST
    return DurationPlan(seconds, interval, parameter, needed, dict(widths))


def _expect(
    joint: Estimate | PerturbationDesign | Mapping[str, Any],
) -> tuple[dict[str, float], Mapping[str, float], float]:
    """Values and standard errors of parameters, and the time of the record that these count [s]."""
    if isinstance(joint, Estimate):
        warn_of_pilot("plan_duration", joint)
        used = joint.torque.sizes["time"] / joint.torque.attrs["identification_rate"]
        return (
            {**joint.stiffness, **joint.reflex},
            joint.diagnostics.get("standard_errors", {}),
            used,
        )
    if isinstance(joint, PerturbationDesign):
        settings, errors, seconds = joint.experiment.settings, joint.standard_errors, joint.seconds
    else:
        settings = describe_joint("plan_duration", joint, {})
        experiment, seconds = Experiment.of(joint, settings, {}, 0), settings.duration
        variances = experiment.variances(experiment.draw({}, 0))
        errors = {name: float(np.sqrt(variance)) for name, variance in variances.items()}
    values = {name: getattr(settings, SETTINGS[name]) for name in errors}
    return values, errors, seconds - LOST
