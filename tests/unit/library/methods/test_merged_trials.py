"""Trials that `riv` and `riv-tv` merge: one estimate, that of a record that consists of all of them."""

import itertools
import re

import matplotlib.pyplot as plt
import numpy as np
import pytest

from ankleloop import (
    DataError,
    block_bootstrap,
    evaluate,
    identify,
    load_estimate,
    save_estimate,
    segment,
    simulate,
)
from ankleloop.assessment.scores import parameter_row, true_trajectories
from ankleloop.joint.prepared import predict_inputs, prepare, prepare_trials
from ankleloop.joint.regressors import split_torques

QUIET = {"voluntary": 0.0, "snr_db": None}
LIGHT = {"load": (0.1, 10.0, 100.0)}
CHANGE = {"stiffness_variation": 0.4, "gain_variation": 0.4, **LIGHT}
TRUTH = {"K": 150.0, "B": 0.8, "I": 0.015, "G": 13.0, "omega_n": 40.0, "zeta": 1.0, "delay": 0.04}
UNEVEN = (0.0, 8.0, 15.0, 25.0, 33.0, 50.0)  # s, where a record is cut


def cut(trial, times=UNEVEN):
    return [segment(trial, start, stop) for start, stop in itertools.pairwise(times)]


def values_of(estimate):
    return estimate.stiffness | estimate.reflex


@pytest.fixture(scope="module")
def trials():
    """Unequal in length."""
    durations = (10.0, 14.0, 8.0, 12.0)
    return [
        simulate(seed=seed, duration=duration, voluntary=0.2)
        for seed, duration in enumerate(durations, 40)
    ]


@pytest.fixture(scope="module")
def merged(trials):
    return identify(trials, "riv")


# --- riv


def test_pieces_of_a_record_without_noise_give_the_truth():
    pieces = cut(simulate(seed=1, **QUIET))
    estimate = identify(pieces, "riv")
    for name, value in values_of(estimate).items():
        assert value == pytest.approx(TRUTH[name], rel=5e-3), name


def test_the_order_of_trials_does_not_matter(trials, merged):
    again = identify(trials[::-1], "riv")
    assert values_of(again) == pytest.approx(values_of(merged), rel=1e-9)
    assert merged.diagnostics["intervals"] == "asymptotic"
    for name, interval in merged.intervals.items():
        assert again.intervals[name] == pytest.approx(interval, rel=1e-9), name


def test_one_trial_in_a_list_is_that_trial(trials):
    assert identify(trials[:1], "riv") == identify(trials[0], "riv")


def test_the_reference_goes_through_one_response_for_all_trials():
    """So the predicted position follows the noise of each trial less."""
    settings = {"duration": 8.0, **LIGHT}
    noisy = prepare_trials([simulate(seed=seed, voluntary=1.0, **settings) for seed in range(6)])
    options = {"basis": "rectifier", "delay": 0.04, "identification_rate": 100.0}
    records = [each.regressors(reference="reference", **options) for each in noisy]
    errors = np.zeros(2)
    for seed, predicted in enumerate(predict_inputs(noisy, records)):
        clean = prepare(simulate(seed=seed, **QUIET, **settings)).regressors(**options)
        alone = noisy[seed].predict_inputs(records[seed])
        for number, inputs in enumerate((predicted, alone)):
            errors[number] += np.std((inputs - clean.inputs)[100:, 0])
    assert errors[0] < 0.95 * errors[1]


# --- what takes the estimate


def test_torques_stand_one_after_the_other_over_the_time_of_each_trial(trials, merged):
    torque = merged.torque
    assert merged.predict(trials) == merged
    for number, trial in enumerate(trials, 1):
        own = torque.sel(time=torque["trial"] == number)
        alone = merged.predict(trial).torque
        np.testing.assert_array_equal(own["time"], alone["time"])
        for name in ("net", "reflex", "measured"):
            np.testing.assert_allclose(own[name], alone[name], atol=1e-9)


def test_the_vaf_counts_the_samples_of_all_trials(trials, merged):
    """Each trial without its first and last second, and less its mean."""
    inner = [part.isel(time=slice(100, -100)) for part in split_torques(merged.torque)]
    residuals = [part["measured"] - part["net"] for part in inner]
    left, measured = (
        sum(float(np.sum((each - each.mean()) ** 2)) for each in signals)
        for signals in (residuals, [part["measured"] for part in inner])
    )
    vaf = 100.0 * (1.0 - left / measured)
    assert evaluate(trials, merged)["vaf"][0] == pytest.approx(vaf, abs=1e-6)
    assert merged.vaf_net == pytest.approx(vaf, abs=1e-6)
    assert parameter_row(trials, merged)["K"] == merged.stiffness["K"]
    with pytest.raises(DataError, match="the torques of 4 trials, and 3 are given"):
        evaluate(trials[:3], merged)


@pytest.mark.parametrize("suffix", ["nc", "mat"])
def test_a_file_keeps_the_trials(trials, merged, tmp_path, suffix):
    save_estimate(merged, tmp_path / f"merged.{suffix}")
    loaded = load_estimate(tmp_path / f"merged.{suffix}")
    assert loaded == merged
    np.testing.assert_array_equal(loaded.torque["trial"], merged.torque["trial"])


def test_the_figure_shows_the_first_trial(trials, merged):
    data = merged.plot(trials).data
    alone = merged.predict(trials[0]).torque
    rows = data[(data["series"] == "riv (estimated)") & (data["quantity"] == "net torque")]
    assert len(rows) > 100
    shown = alone["net"].sel(time=rows["x"].to_numpy())  # KeyError for times of another trial
    np.testing.assert_allclose(rows["value"], shown, atol=1e-9)
    plt.close("all")


def test_the_bootstrap_resamples_each_trial():
    trials = [simulate(seed=seed, duration=12.0) for seed in (5, 6)]
    bootstrap = block_bootstrap(trials, "riv", repetitions=25, seed=2)
    asymptotic = bootstrap.estimate.diagnostics["standard_errors"]
    for name in ("K", "G"):
        assert 0.5 < bootstrap.standard_errors()[name] / asymptotic[name] < 1.8, name


# --- riv-tv


def onsets_of(trial):
    """Onsets of cycles [s] of a simulated trial."""
    phase = trial["phase"].values
    return trial["time"].values[1:][np.diff(phase) < -0.5]


def relative_errors(trial, estimate):
    """Root mean square errors of K, B and G over the means of the truth."""
    truths = true_trajectories(trial, estimate.trajectories)
    return {
        name: float(np.sqrt(np.mean((estimate.trajectories[name] - truth) ** 2)) / truth.mean())
        for name, truth in truths.items()
    }


@pytest.fixture(scope="module")
def walks():
    """Cycles of uneven duration."""
    settings = {"variation": "cycle", "cycle_jitter": 0.05, **CHANGE, **QUIET}
    return [simulate(seed=seed, duration=12.0 + 2.0 * seed, **settings) for seed in range(4)]


def test_cycles_of_all_trials_count_each_by_its_onsets(walks):
    onsets = [onsets_of(walk) for walk in walks]
    estimate = identify(walks, "riv-tv", cycle_onsets=onsets, rest_position=0.0)
    errors = relative_errors(walks[0], estimate)
    assert errors["K"] < 0.006, errors
    assert max(errors.values()) < 0.015, errors
    assert evaluate(walks, estimate).set_index(["torque", "against"])["vaf"].min() > 99.9
    assert estimate.predict(walks, cycle_onsets=onsets) == estimate


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda onsets: onsets[:3], "onsets of cycles for 3 trials, and 4 trials"),
        (lambda onsets: [*onsets[:3], onsets[3][:1]], "fewer than two onsets"),
        (lambda onsets: [times[:3] for times in onsets], "too few whole cycles"),
    ],
)
def test_onsets_that_are_not_those_of_the_trials_are_refused(walks, change, message):
    with pytest.raises(DataError, match=message):
        identify(walks, "riv-tv", cycle_onsets=change([onsets_of(walk) for walk in walks]))


def test_movements_of_three_seconds_are_one_course_over_their_time():
    settings = {"duration": 3.0, "variation": "time", **CHANGE, **QUIET}
    movements = [simulate(seed=seed, **settings) for seed in range(40)]
    estimate = identify(movements, "riv-tv")
    assert estimate.trajectories["time"][-1] == pytest.approx(2.44)
    errors = relative_errors(movements[0], estimate)
    assert errors["K"] < 0.02, errors
    assert max(errors.values()) < 0.06, errors
    assert estimate.diagnostics["warnings"] == []
    assert estimate.predict(movements) == estimate
    with pytest.raises(DataError, match="riv-tv needs 2 s: record longer"):
        identify([*movements[:8], segment(movements[8], 0.0, 2.5)], "riv-tv")
    with pytest.raises(DataError, match=r"7 whole seconds of the 7 trials .* take more trials"):
        identify(movements[:7], "riv-tv")


@pytest.mark.parametrize("duration", [0.5, 0.7, 0.9, 1.2])
@pytest.mark.parametrize(
    "rates", [(500.0, 50.0), (1000.0, 100.0), (2000.0, 100.0), (1000.0, 200.0)]
)
def test_trials_that_are_too_short_are_refused_in_words(duration, rates):
    """And those that last as long as the refusal says are merged."""
    recording_rate, identification_rate = rates
    quiet = {"snr_db": None, "voluntary": 0.0}
    long = simulate(seed=1, duration=60.0, recording_rate=recording_rate, **quiet)
    pieces = [segment(long, start, start + duration) for start in (0.0, 3.0, 6.0, 9.0)]
    with pytest.raises(DataError, match=r"trial 1 of 4 .* each has to last .* s or more") as error:
        identify(pieces, "riv", identification_rate=identification_rate)
    least = float(re.search(r"to last (.*) s or", str(error.value))[1])
    enough = [segment(long, start, start + least) for start in np.arange(0.0, 60.0 - least, least)]
    assert np.isfinite(identify(enough, "riv", identification_rate=identification_rate)["K"])
