"""Experiments that cannot be planned: joints, limits, pilots and widths."""

import warnings
from functools import cache

from ankleloop import DataError, UnstableLoopError, design_perturbation, identify, plan_duration, simulate
from bad_inputs.bad_input import BadInput
from bad_inputs.inputs import fitted_estimate, simulated_trial


def row(wrong, call, *says, error=ValueError) -> BadInput:
    return BadInput(wrong, lambda folder: None, lambda nothing: call(), says, error=error)


@cache
def _pilot():
    return identify(simulated_trial(), "riv")


def _plan_with_warnings():
    trial = simulate(seed=1, duration=12.0)
    turned = trial.assign(torque=-trial["torque"])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        plan_duration(identify(turned, "riv"), {"K": 0.5})
    return [warning.message for warning in caught]


def _simulate(**settings):
    return simulate(**{"seed": 1, "duration": 2.0, **settings})


ROWS = [
    row(
        "a joint that is unstable with its load",
        lambda: design_perturbation({"load": (0.1, 5.0, 100.0), "reflex_gain": 30.0}),
        "the closed loop is unstable",
        "heavier or more damped load",
        error=UnstableLoopError,
    ),
    row(
        "limits that leave no amplitude",
        lambda: design_perturbation({"settling": 1.0}, torque=0.01, progress=lambda generations: []),
        "the limits leave ±",
        "raise torque or servo_velocity",
    ),
    row(
        "a limit of zero",
        lambda: design_perturbation({}, servo_velocity=0.0),
        "design_perturbation: servo_velocity must be above 0 rad/s, got 0.0",
    ),
    row(
        "a joint that is a number",
        lambda: design_perturbation(150.0),
        "must be an estimate or settings",
        error=TypeError,
    ),
    row(
        "a joint with an unknown setting", lambda: design_perturbation({"stifness": 1.0}), "stiffness", error=TypeError
    ),
    row(
        "a joint without a disturbance",
        lambda: plan_duration({"snr_db": None, "voluntary": 0.0}, {"K": 0.1}),
        "set snr_db or voluntary",
    ),
    row("a joint that changes", lambda: plan_duration({"variation": "cycle"}, {"K": 0.1}), "variation must be null"),
    row(
        "a pilot by a method without a spectrum of the noise",
        lambda: design_perturbation(fitted_estimate()),
        "identify the pilot by riv",
        error=DataError,
    ),
    row(
        "a pilot by a method without standard errors",
        lambda: plan_duration(fitted_estimate(), {"K": 0.1}),
        "K has no standard error",
        "identify a pilot by riv",
        error=DataError,
    ),
    row(
        "a pilot with warnings", _plan_with_warnings, "the pilot has warnings", "correct or repeat it first", error=None
    ),
    row(
        "a width that no record reaches",
        lambda: plan_duration(_pilot(), {"K": 0.0005}),
        "K within 0.05 % would take",
        "or perturb more strongly",
        error=DataError,
    ),
    row(
        "a width in percent",
        lambda: plan_duration(_pilot(), {"K": 50.0}),
        "widths: K must be between 0.0001 and 10, got 50",
    ),
    row(
        "a width of an unknown parameter",
        lambda: plan_duration(_pilot(), {"k": 0.1}),
        "no parameter 'k' to plan for; there are K, B",
        error=DataError,
    ),
    row("no widths", lambda: plan_duration(_pilot(), {}), "such as {'K': 0.05}", error=TypeError),
    row(
        "a command of another length than the record",
        lambda: _simulate(command=[0.0, 0.01]),
        "command must be 2000 finite numbers [rad]",
        "give its duration",
        error=DataError,
    ),
    row(
        "a command of text",
        lambda: _simulate(command="prbs"),
        "the command must be an array of real numbers",
        error=DataError,
    ),
    row(
        "too few weights of dwell times",
        lambda: _simulate(dwell_weights=[1.0, 2.0]),
        "dwell_weights must be 11 numbers",
    ),
    row("weights of zero", lambda: _simulate(dwell_weights=[0.0] * 11), "not all 0"),
    row("a level of the torque of zero", lambda: _simulate(torque_level=0.0), "torque_level must be above 0"),
]
