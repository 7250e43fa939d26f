"""Checks of an identification on the data of every simulated study: no false alarm, and which faults are seen."""

import itertools
from pathlib import Path

import numpy as np
import pytest
import yaml
from bad_inputs.data import lowpass

from ankleloop import DataError, identify, new_trial, simulate
from ankleloop.checks.channels import check_spikes
from ankleloop.checks.data import check_data
from ankleloop.joint.prepared import prepare
from ankleloop_workflow.config.study import SimulatedStudy, read_studies

CONFIGS = [Path(__file__).parents[2] / "config" / f"{name}.yaml" for name in ("config", "beyond")]
SEEDS = (101, 202)
SETTINGS = {
    name: settings
    for path in CONFIGS
    for name, settings in yaml.safe_load(path.read_text(encoding="utf-8"))["studies"].items()
}
STUDIES = {
    name: list(study.conditions.values())
    for name, study in read_studies({"studies": SETTINGS})[1].items()
    if isinstance(study, SimulatedStudy)
}


def check(trial, *, judged=False):
    """Warnings of an identification with the reference, or its refusal of the trial."""
    try:
        return check_data([prepare(trial)], "reference", judged=judged)
    except DataError as error:
        return [error]


@pytest.mark.parametrize("study", STUDIES)
def test_simulated_studies_have_no_data_warnings(study):
    methods = {method["method"] for method in SETTINGS[study]["methods"].values()}
    judged = methods == {"riv"}  # which judges the strength of a reference by itself
    for settings, seed in itertools.product(STUDIES[study], SEEDS):
        assert check(simulate(seed=seed, **settings), judged=judged) == [], (settings, seed)


@pytest.mark.parametrize("study", STUDIES)
def test_position_and_reference_exchanged(study):
    """All are seen, but behind an actuator that is faster than the samples show, where there is nothing to see."""
    for settings in STUDIES[study]:
        trial = simulate(seed=SEEDS[0], **settings)
        assert check(new_trial(trial["reference"], trial["torque"], 1000.0, trial["position"])), (
            settings
        )


@pytest.mark.parametrize("factor", [5, 20, 50])  # of the decimation whose low-pass is taken
def test_a_filter_of_the_torque_as_reference(factor):
    """A low-pass of the torque is seen down to about 8 Hz."""
    for study, points in STUDIES.items():
        trial = simulate(seed=SEEDS[0], **points[0])
        samples = 0.01 * lowpass(trial["torque"].values, factor)
        assert check(trial.assign(reference=trial["reference"].copy(data=samples))), study


def test_a_spike_that_is_not_seen_changes_nothing():
    """A spike of one sample in the torque, against the standard deviation of each parameter over trials."""
    parameters, changes, seen_high = [], [], 0
    for seed in range(20):
        trial = simulate(seed=seed, duration=20.0)
        parameters.append(parameters_of(trial))
        sample = np.random.default_rng(seed).integers(2000, 18_000)
        for height in (3.0, 5.0, 8.0, 15.0):
            torque = trial["torque"].copy(deep=True)
            torque[sample] += height * float(torque.std())
            spoilt = trial.assign(torque=torque)
            if check_spikes(prepare(spoilt), "torque").verdict == "ok":
                changes.append(np.abs(parameters_of(spoilt) - parameters[-1]))
            else:
                seen_high += height == 15.0
    assert seen_high == 20
    assert np.max(changes / np.std(parameters, axis=0)) < 0.25


def parameters_of(trial):
    estimate = identify(trial, "riv")
    return np.array([*estimate.stiffness.values(), estimate.reflex["G"]])
