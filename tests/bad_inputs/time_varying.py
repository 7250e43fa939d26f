"""Cycles and scheduling variables of joints that change in time, and what the records cannot show."""

from functools import partial

import numpy as np

from ankleloop import identify
from bad_inputs.bad_input import BadInput
from bad_inputs.inputs import simulated_trial

ONSETS = 1.4 * np.arange(15)


def _cyclic_trial(**settings):
    return lambda folder: simulated_trial(variation="cycle", **settings)


def _scheduled_trial(change):
    def make(folder):
        trial = simulated_trial(variation="schedule")
        return trial.assign(schedule=change(trial))

    return make


def _row(wrong, make, *says, error=None, **options):
    call = partial(identify, method="riv-tv", **options)
    return BadInput(wrong, make, call, says, **({"error": error} if error else {}))


def _rows() -> list[BadInput]:
    trial = _cyclic_trial()
    unsorted = ONSETS.copy()
    unsorted[3:5] = ONSETS[[4, 3]]
    return [
        _row("onsets that are not sorted", trial, "onset 5 of 15", "sort them", cycle_onsets=unsorted),
        _row("onsets in milliseconds", trial, "neither milliseconds nor samples", cycle_onsets=1000 * ONSETS),
        _row("three cycles", trial, "too few whole cycles", "Record more", cycle_onsets=ONSETS[:4]),
        _row("a phase that is not there", trial, "no variable 'gait'", "it has", cycle_onsets="gait"),
        _row(
            "a perturbation that is locked to the cycle",
            _cyclic_trial(perturbation_locked=True),
            "repeats with the cycle",
            "new pseudorandom sequence",
            cycle_onsets="phase",
        ),
        _row(
            "the measured angle as schedule",
            _scheduled_trial(lambda trial: trial["position"]),
            "follows the perturbation",
            "slow part",
            schedule="schedule",
        ),
    ]


ROWS = _rows()
