"""Checks of an identification on the data of every simulated study: no false alarm, and which faults are seen."""

import itertools
from pathlib import Path

import numpy as np
import pytest
import yaml

from ankleloop import DataError, identify, new_trial, simulate
from ankleloop.checks.channels import check_spikes
from ankleloop.checks.data import DataUse, check_data
from ankleloop.joint.prepared import prepare
from ankleloop.signals.decimation import lowpass
from ankleloop.simulation.settings import SimulationSettings

CONFIG = Path(__file__).parents[2] / "config" / "config.yaml"
SEEDS = (101, 202)


def points(study):
    values = study.get("points") or [{}]
    if isinstance(values, dict):
        values = [dict(zip(values, parts, strict=True)) for parts in itertools.product(*values.values())]
    settings = [study.get("simulation", {}) | point for point in values]
    known = SimulationSettings.model_fields  # a point may hold options of methods as well
    return [{name: value for name, value in point.items() if name in known} for point in settings]


STUDIES = {
    name: points(study)
    for name, study in yaml.safe_load(CONFIG.read_text(encoding="utf-8"))["studies"].items()
    if study["kind"] == "simulation"
}


@pytest.mark.parametrize("study", STUDIES)
def test_simulated_studies_have_no_data_warnings(study):
    for settings, seed in itertools.product(STUDIES[study], SEEDS):
        trial = prepare(simulate(seed=seed, **settings))
        assert check_data([trial], DataUse(reference="reference")) == [], (settings, seed)


def is_seen(trial):
    """Whether an identification with the reference would warn, or refuse the trial."""
    try:
        return bool(check_data([prepare(trial)], DataUse(reference="reference")))
    except DataError:
        return True


def test_position_and_reference_exchanged():
    """All are seen, but behind an actuator that is faster than the samples show, where there is nothing to see."""
    for study, settings in ((name, point) for name, parts in STUDIES.items() for point in parts):
        assert is_seen(exchange(simulate(seed=SEEDS[0], **settings))), (study, settings)


def exchange(trial):
    return new_trial(trial["reference"], trial["torque"], 1000.0, reference=trial["position"])


@pytest.mark.parametrize("factor", [5, 20, 50])  # of the decimation whose low-pass is taken
def test_a_filter_of_the_torque_as_reference(factor):
    """A low-pass of the torque is seen down to about 8 Hz."""
    for study, points in STUDIES.items():
        trial = simulate(seed=SEEDS[0], **points[0])
        samples = 0.01 * lowpass(trial["torque"].values, factor)
        assert is_seen(trial.assign(reference=trial["reference"].copy(data=samples))), study


def test_a_spike_that_is_not_seen_changes_nothing():
    """A spike of one sample in the torque, against the standard deviation of each parameter over trials."""
    parameters, changes, seen_high = [], [], 0
    for seed in range(20):
        trial = simulate(seed=seed, duration=20.0)
        parameters.append(parameters_of(trial))
        sample = np.random.default_rng(seed).integers(2000, 18_000)
        for height in (3.0, 5.0, 8.0, 15.0):
            torque = trial["torque"].values.copy()
            torque[sample] += height * torque.std()
            spoilt = trial.assign(torque=trial["torque"].copy(data=torque))
            if check_spikes(prepare(spoilt), "torque").verdict == "ok":
                changes.append(np.abs(parameters_of(spoilt) - parameters[-1]))
            else:
                seen_high += height == 15.0
    assert seen_high == 20
    assert np.max(changes / np.std(parameters, axis=0)) < 0.25


def parameters_of(trial):
    estimate = identify(trial, "riv")
    return np.array([*estimate.stiffness.values(), estimate.reflex["G"]])
