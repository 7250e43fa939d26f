"""Checks of an identification on the data of every simulated study: no false alarm, and which faults are seen."""

import itertools
from pathlib import Path

import numpy as np
import pytest
import yaml

from ankleloop import DataError, identify, new_trial, simulate
from ankleloop.joint.channel_checks import check_spikes
from ankleloop.joint.data_checks import DataUse, check_data
from ankleloop.joint.prepared import prepare
from ankleloop.signals.decimation import lowpass

CONFIG = Path(__file__).parents[2] / "config" / "config.yaml"
SEEDS = (101, 202)


def points(study):
    values = study.get("points") or [{}]
    if isinstance(values, dict):
        values = [dict(zip(values, parts, strict=True)) for parts in itertools.product(*values.values())]
    return [study.get("simulation", {}) | point for point in values]


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


def test_position_and_reference_exchanged(record):
    """In each study all are seen; behind an actuator that is faster than the samples show there is nothing to see."""
    seen = {}
    for study in STUDIES:
        seen[study] = [is_seen(exchange(simulate(seed=SEEDS[0], **settings))) for settings in STUDIES[study]]
    fast = [
        is_seen(exchange(simulate(seed=seed, duration=20.0, actuator_frequency=1000.0)))
        for seed in range(len(SEEDS) * 5)
    ]
    trials = list(itertools.chain(*seen.values()))
    record(trials=len(trials), seen=sum(trials), trials_with_an_actuator_of_1_kHz=len(fast), seen_of_these=sum(fast))
    assert all(trials)


def exchange(trial):
    return new_trial(trial["reference"], trial["torque"], 1000.0, reference=trial["position"])


def test_a_filter_of_the_torque_as_reference(record):
    """A low-pass of the torque is seen down to about 5 Hz."""
    counts = {}
    for factor in (5, 20, 50, 200):  # of the decimation whose low-pass is taken
        seen = []
        for study in STUDIES:
            trial = simulate(seed=SEEDS[0], **STUDIES[study][0])
            samples = 0.01 * lowpass(trial["torque"].values, factor)
            seen.append(is_seen(trial.assign(reference=trial["reference"].copy(data=samples))))
        counts[f"seen_of_{len(seen)}_to_{380 / factor:g}_Hz"] = sum(seen)
        assert factor > 50 or all(seen)
    record(**counts)


def test_a_spike_that_is_not_seen_changes_nothing(record):
    """A spike of one sample in the torque, against the standard deviation of each parameter over trials."""
    parameters, counts = [], {}
    heights = (3.0, 5.0, 8.0, 15.0)
    changes = {height: [] for height in heights}
    for seed in range(20):
        trial = simulate(seed=seed, duration=20.0)
        parameters.append(parameters_of(trial))
        sample = np.random.default_rng(seed).integers(2000, 18_000)
        for height in heights:
            torque = trial["torque"].values.copy()
            torque[sample] += height * torque.std()
            spoilt = trial.assign(torque=trial["torque"].copy(data=torque))
            seen = check_spikes(prepare(spoilt), "torque").verdict != "ok"
            counts[height] = counts.get(height, 0) + seen
            if not seen:
                changes[height].append(np.abs(parameters_of(spoilt) - parameters[-1]))
    deviations = np.std(parameters, axis=0)
    largest = {height: float(np.max(rows / deviations)) for height, rows in changes.items() if rows}
    record(
        **{f"seen_of_20_at_{height:g}_sd": count for height, count in counts.items()},
        largest_change_by_an_unseen_spike_sd=max(largest.values()),
    )
    assert counts[15.0] == 20
    assert max(largest.values()) < 0.25


def parameters_of(trial):
    estimate = identify(trial, "riv")
    return np.array([*estimate.stiffness.values(), estimate.reflex["G"]])
