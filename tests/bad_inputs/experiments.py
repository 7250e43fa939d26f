"""Experiments that cannot be planned: joints, limits, pilots and widths."""

import warnings
from functools import partial

from ankleloop import (
    DataError,
    UnstableLoopError,
    design_perturbation,
    identify,
    plan_duration,
    simulate,
)
from bad_inputs.bad_input import rows_of
from bad_inputs.inputs import fitted_estimate, simulated_trial

UNSTABLE = {"load": (0.1, 5.0, 100.0), "reflex_gain": 30.0}
NO_DISTURBANCE = {"snr_db": None, "voluntary": 0.0}


def pilot_by_pr_moesp(folder):
    """A pilot by a method that states no standard errors."""
    return fitted_estimate()


def design(joint, **limits):
    """Design a perturbation, without its search."""
    return design_perturbation(joint, progress=lambda generations: [], **limits)


def plan_with_warnings(nothing) -> list:
    """Plan by a pilot whose torque has the wrong sign; the warnings."""
    trial = simulated_trial()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        plan_duration(identify(trial.assign(torque=-trial["torque"]), "riv"), {"K": 0.5})
    return [warning.message for warning in caught]


designed = rows_of(design, ValueError)
planned = rows_of(partial(plan_duration, widths={"K": 0.1}), ValueError)
widths = rows_of(lambda widths: plan_duration(fitted_estimate("riv"), widths), DataError)
simulated = rows_of(
    lambda settings: simulate(**{"seed": 1, "duration": 2.0, **settings}), ValueError
)
little_torque = partial(design, torque=0.01)
no_velocity = partial(design, servo_velocity=0.0)

ROWS = [
    designed(
        "an unstable joint",
        UNSTABLE,
        "the closed loop is unstable",
        "damped load",
        error=UnstableLoopError,
    ),
    designed(
        "limits that leave no amplitude",
        {"settling": 1.0},
        "the limits leave ±",
        "raise",
        call=little_torque,
    ),
    designed(
        "a limit of zero", {}, "servo_velocity must be above 0 rad/s, got 0.0", call=no_velocity
    ),
    designed("an unknown setting", {"stifness": 1.0}, "stiffness", error=TypeError),
    designed(
        "a pilot without a spectrum",
        pilot_by_pr_moesp,
        "identify the pilot by riv",
        error=DataError,
    ),
    planned("a joint without a disturbance", NO_DISTURBANCE, "set snr_db or voluntary"),
    planned("a joint that changes", {"variation": "cycle"}, "variation must be null"),
    planned(
        "a pilot without errors",
        pilot_by_pr_moesp,
        "K has no standard error",
        "pilot by riv",
        error=DataError,
    ),
    planned(
        "a pilot with warnings",
        None,
        "the pilot has warnings",
        "repeat it",
        call=plan_with_warnings,
        error=None,
    ),
    widths(
        "a width that no record reaches",
        {"K": 0.0005},
        "K within 0.05 % would take",
        "or perturb more strongly",
    ),
    widths(
        "a width in percent",
        {"K": 50.0},
        "widths: K must be between 0.0001 and 10, got 50",
        error=ValueError,
    ),
    widths("an unknown parameter", {"k": 0.1}, "no parameter 'k' to plan for; there are K, B"),
    widths("no widths", {}, "such as {'K': 0.05}", error=TypeError),
    simulated(
        "a short command",
        {"command": [0.0, 0.01]},
        "command must be 2000 finite numbers",
        error=DataError,
    ),
    simulated(
        "a command of another duration",
        {"command": [0.01] * 3000},
        "2000 finite numbers [rad] for a duration of 2 s, got shape (3000,)",
        "leave out the duration",
        error=DataError,
    ),
    simulated(
        "a command of another rate",
        lambda folder: {"command": simulated_trial()["reference"], "recording_rate": 500.0},
        "command has 1000 samples a second",
        "set recording_rate=1000",
        error=DataError,
    ),
    simulated("too few weights", {"dwell_weights": [1.0, 2.0]}, "dwell_weights must be 11 numbers"),
]
