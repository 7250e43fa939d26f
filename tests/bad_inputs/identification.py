"""Options of methods, of scores and of the simulation, cycles and schedules, and functions that the pages name."""

from functools import partial

import numpy as np

from ankleloop import (
    UnstableLoopError,
    block_bootstrap,
    check_trial,
    evaluate,
    identify,
    segment,
    simulate,
    subspace,
)
from ankleloop.methods.selection import select_options
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import fitted_estimate, good_trial, simulated_trial

ONSETS = 1.4 * np.arange(15)
UNSORTED = ONSETS[[0, 1, 2, 4, 3, *range(5, 15)]]
UNSTABLE = {"load": (0.1, 5.0, 100.0), "reflex_gain": 30.0, "duration": 10.0}
NOISE = np.random.default_rng(0).standard_normal((400, 1))


def trial_of(**settings):
    """A simulated trial of other settings."""
    return lambda folder: simulated_trial(**settings)


def short_segment(folder):
    """A part of the trial that was identified."""
    return segment(simulated_trial(), 0.0, 9.0)


def wrong_angle(folder):
    """A trial whose schedule is the position, with the perturbation in it."""
    trial = simulated_trial(variation="schedule")
    return trial.assign(schedule=trial["position"])


def option(wrong: str, *says: str, **options) -> BadInput:
    """A row of one wrong option of a method."""
    return rows_of(partial(identify, **options), ValueError)(wrong, good_trial, *says)


def of_cycles(wrong: str, onsets, *says: str, remedy=None, **settings) -> BadInput:
    """A row of a joint that changes with the phase of cycles."""
    return rows_of(partial(identify, method="riv-tv", cycle_onsets=onsets))(
        wrong, trial_of(variation="cycle", **settings), *says, remedy=remedy
    )


def moesp(signals) -> None:
    """Identify one input and one output."""
    subspace.moesp(
        **{"u": NOISE, "y": np.cumsum(NOISE, axis=0), "block_rows": 8, "order": 1, **signals}
    )


row = rows_of(identify)
scored = rows_of(lambda trial: evaluate(trial, fitted_estimate()))
simulated = rows_of(lambda settings: simulate(**{"seed": 1, **settings}), ValueError)
identified = rows_of(moesp)
scheduled = partial(identify, method="riv-tv", schedule="schedule")
misspelt = partial(identify, method="riv", blok_rows=3)
at_70_hz = partial(identify, identification_rate=70.0)
to_command = partial(identify, reference="command")
in_blocks_of_50_s = partial(block_bootstrap, block=50.0)


def select_order(trial) -> None:
    """Select the order of PR-MOESP."""
    select_options(trial, partial(identify, method="pr-moesp"), {"order": [1, 2]})


def predict(trial) -> None:
    """Predict by a method that has no model."""
    fitted_estimate("real-time").predict(trial)


ROWS = [
    option(
        "unknown method",
        "unknown method 'pr-moes' (did you mean 'pr-moesp'?); known: riv, pr-moesp",
        method="pr-moes",
    ),
    option(
        "order of the block rows",
        "must be larger than the order",
        method="pr-moesp",
        order=10,
        block_rows=10,
    ),
    row(
        "unknown option",
        good_trial,
        "'riv' has no option 'blok_rows'; it has",
        call=misspelt,
        error=TypeError,
    ),
    row(
        "a rate that does not divide",
        good_trial,
        "not a whole multiple",
        "(70 Hz)",
        "choose",
        call=at_70_hz,
    ),
    row(
        "no such reference",
        good_trial,
        "no variable 'command'",
        "Give the command of the servo",
        call=to_command,
    ),
    simulated(
        "no seed",
        {"seed": None},
        "seed must be a whole number of at least 0 or a numpy.random.SeedSequence",
    ),
    simulated(
        "an unstable loop",
        UNSTABLE,
        "unstable",
        "Take a heavier or more damped",
        error=UnstableLoopError,
    ),
    scored(
        "the estimate of another trial",
        short_segment,
        "the estimate covers 0.38 to 19.69 s",
        "score it",
    ),
    row(
        "blocks too long",
        good_trial,
        "less than ten blocks of 50 s",
        "Take shorter",
        call=in_blocks_of_50_s,
    ),
    row("no trials", [], "there are no trials to check", call=check_trial),
    row(
        "a selection on 6 s",
        trial_of(duration=6.0),
        "a selection needs 8 s",
        "Record longer",
        call=select_order,
    ),
    row(
        "a prediction without a model",
        good_trial,
        "real-time has no fixed model to predict with",
        call=predict,
    ),
    identified(
        "two lengths",
        {"y": NOISE[1:]},
        "400 samples of inputs, 399 of the output",
        "cut them to one length",
    ),
    identified("no reference", {"instruments": "past-reference"}, "instruments need a reference"),
    of_cycles("onsets that are not sorted", UNSORTED, "onset 5 of 15", "sort them"),
    of_cycles("onsets in milliseconds", 1000 * ONSETS, "not milliseconds or samples"),
    of_cycles("three cycles", ONSETS[:4], "too few whole cycles", "Record more"),
    of_cycles(
        "a phase that is not there",
        "gait",
        "no variable 'gait'",
        "it has",
        remedy={"variables": None},
    ),
    of_cycles(
        "a perturbation that is locked to the cycle",
        "phase",
        "repeats with the cycle",
        "new pseudorandom sequence",
        perturbation_locked=True,
    ),
    row(
        "the measured angle as schedule",
        wrong_angle,
        "follows the perturbation",
        "slow part",
        call=scheduled,
    ),
]
