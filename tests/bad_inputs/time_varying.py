"""Cycles and scheduling variables of joints that change in time, and what the records cannot show."""

from functools import partial

import numpy as np

from ankleloop import identify
from bad_inputs.bad_input import BadInput
from bad_inputs.inputs import simulated_trial

TITLE = "Joints that change in time"
ONSETS = 1.4 * np.arange(15)


def _cyclic_trial(**settings):
    return lambda folder: simulated_trial(variation="cycle", **settings)


def _scheduled_trial(change):
    def make(folder):
        trial = simulated_trial(variation="schedule")
        return trial.assign(schedule=change(trial))

    return make


def _spoil(trial):
    values = trial["schedule"].values.copy()
    values[700] = np.nan
    return trial["schedule"].copy(data=values)


def _row(wrong, make, *says, error=None, **options):
    arguments = "".join(f", {name}=…" for name in options)
    call = partial(identify, method="riv-tv", **options)
    shown = f"identify(method='riv-tv'{arguments})"
    return BadInput(wrong, make, call, says, shown=shown, **({"error": error} if error else {}))


def _rows() -> list[BadInput]:
    trial = _cyclic_trial()
    unsorted, doubled = ONSETS.copy(), np.sort(np.append(ONSETS, 5.6))
    unsorted[3:5] = ONSETS[[4, 3]]
    return [
        _row("onsets that are not sorted", trial, "onset 5 of 15", "sort them", cycle_onsets=unsorted),
        _row("an onset that is there twice", trial, "is not after onset", "twice", cycle_onsets=doubled),
        _row("an onset that is missing", trial, "at 7 s lasts 2.8 s", "missing", cycle_onsets=np.delete(ONSETS, 6)),
        _row("onsets in milliseconds", trial, "neither milliseconds nor samples", cycle_onsets=1000 * ONSETS),
        _row("three cycles", trial, "too few whole cycles", "Record more", cycle_onsets=ONSETS[:4]),
        _row("a phase that is not there", trial, "no variable 'gait'", "it has", cycle_onsets="gait"),
        _row(
            "a phase in per cent",
            lambda folder: trial(folder).assign(phase=100 * trial(folder)["phase"]),
            "the phase of a cycle goes from 0 to 1",
            cycle_onsets="phase",
        ),
        _row(
            "cycles and a schedule", trial, "exclude each other", error=ValueError, cycle_onsets="phase", schedule="a"
        ),
        _row("two knots of K", trial, "between 4 and 200 for K", error=ValueError, knots=(2, 8, 12)),
        _row(
            "a perturbation that is locked to the cycle",
            _cyclic_trial(perturbation_locked=True),
            "repeats with the cycle",
            "new pseudorandom sequence",
            cycle_onsets="phase",
        ),
        _row(
            "a schedule that is missing at a sample",
            _scheduled_trial(_spoil),
            "schedule",
            "sample 700",
            schedule="schedule",
        ),
        _row(
            "a schedule that does not vary",
            _scheduled_trial(lambda trial: 0 * trial["schedule"]),
            "does not vary",
            "Name another",
            schedule="schedule",
        ),
        _row(
            "the measured angle as schedule",
            _scheduled_trial(lambda trial: trial["position"]),
            "follows the perturbation",
            "slow part",
            schedule="schedule",
        ),
        _row(
            "a record of 9 s without cycles", lambda folder: simulated_trial(duration=9.0), "too short", "needs 9.5 s"
        ),
    ]


ROWS = _rows()
