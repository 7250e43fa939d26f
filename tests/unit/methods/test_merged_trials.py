"""Trials that `riv` and `riv-tv` merge: one estimate, that of a record that consists of all of them."""

import itertools

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
from ankleloop.joint.prepared import make_regressors, prepare_trials
from ankleloop.joint.regressors import split_torques
from ankleloop.methods.riv.equations import Equations, Point

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


def test_pieces_of_a_record_without_noise_give_the_truth_in_any_order():
    pieces = cut(simulate(seed=1, **QUIET))
    estimate = identify(pieces, "riv")
    for name, value in values_of(estimate).items():
        assert value == pytest.approx(TRUTH[name], rel=5e-3), name
    again = identify([pieces[number] for number in (3, 1, 4, 0, 2)], "riv")
    assert values_of(again) == pytest.approx(values_of(estimate), rel=1e-9)


def test_the_order_of_trials_does_not_matter(trials, merged):
    again = identify(trials[::-1], "riv")
    assert values_of(again) == pytest.approx(values_of(merged), rel=1e-9)
    assert merged.diagnostics["intervals"] == "asymptotic"
    for name, interval in merged.intervals.items():
        assert again.intervals[name] == pytest.approx(interval, rel=1e-9), name


@pytest.mark.parametrize("options", [{}, {"basis": "spline", "degree": 4}, {"weighting": "flat"}])
def test_one_trial_in_a_list_is_that_trial(trials, options):
    assert identify(trials[:1], "riv", **options) == identify(trials[0], "riv", **options)


def test_the_merged_estimate_is_about_the_weighted_mean_of_single_ones():
    trials = [simulate(seed=seed, duration=30.0, voluntary=0.2) for seed in range(70, 74)]
    together = identify(trials, "riv")
    single = [identify(trial, "riv") for trial in trials]
    errors = together.diagnostics["standard_errors"]
    for name in ("K", "B", "I", "G"):
        deviations = np.array([each.diagnostics["standard_errors"][name] for each in single])
        each = [values_of(estimate)[name] for estimate in single]
        mean = np.average(each, weights=deviations**-2.0)
        assert errors[name] == pytest.approx(np.sum(deviations**-2.0) ** -0.5, rel=0.2), name
        assert abs(values_of(together)[name] - mean) < 0.7 * errors[name], name


@pytest.mark.parametrize("voluntary", [0.05, 0.5])
def test_short_trials_are_not_biased_and_their_intervals_hold_the_truth(voluntary):
    """A response to the reference that each trial had for itself would follow its noise: B would be 3 % too small."""
    inside = dict.fromkeys("KBG", 0)
    errors = {name: [] for name in inside}
    for group in range(16):
        seeds = range(1000 + 6 * group, 1006 + 6 * group)
        estimate = identify(
            [simulate(seed=seed, duration=10.0, voluntary=voluntary, **LIGHT) for seed in seeds],
            "riv",
        )
        for name in inside:
            low, high = estimate.intervals[name]
            inside[name] += low < TRUTH[name] < high
            errors[name].append(values_of(estimate)[name] / TRUTH[name] - 1.0)
    for name, count in inside.items():
        assert count >= 12, name
        uncertain = np.std(errors[name]) / 4.0
        assert abs(np.mean(errors[name])) < 0.01 + 2.5 * uncertain, name


def make_equations(trials, weighting="flat"):
    prepared = prepare_trials(trials)
    records = make_regressors(
        prepared,
        basis="rectifier",
        degree=1,
        delay=0.04,
        identification_rate=100.0,
        reference="position",
    )
    return Equations(prepared, records, weighting)


def test_equations_of_two_trials_are_the_sums_of_those_of_each(trials):
    parameters = make_equations(trials[:1]).find_start(2, estimate_delay=True)
    points = [
        Point(make_equations(part), parameters) for part in (trials[:2], trials[:1], trials[1:2])
    ]
    # Flat weights are the inverse of the mean noise of the record.
    sides = [point.side * point.level[0] for point in points]
    slopes = [point.normal * point.level[0] for point in points]
    np.testing.assert_allclose(sides[0], sides[1] + sides[2], rtol=1e-9)
    size = np.abs(slopes[0]).max()
    np.testing.assert_allclose(slopes[0], slopes[1] + slopes[2], atol=1e-12 * size)


# --- what takes the estimate


def test_torques_stand_one_after_the_other_over_the_time_of_each_trial(trials, merged):
    torque = merged.torque
    assert np.unique(torque["trial"]).tolist() == [1, 2, 3, 4]
    parts = split_torques(torque)
    for number, (trial, part) in enumerate(zip(trials, parts, strict=True), 1):
        own = torque.sel(time=torque["trial"] == number)
        np.testing.assert_array_equal(own["net"], part["net"])
        alone = merged.predict(trial).torque
        np.testing.assert_array_equal(own["time"], alone["time"])
        np.testing.assert_allclose(own["net"], alone["net"], atol=1e-9)
        np.testing.assert_allclose(own["measured"], alone["measured"], atol=1e-12)
    assert merged.predict(trials) == merged


def test_the_vaf_counts_the_samples_of_all_trials(trials, merged):
    table = evaluate(trials, merged, intervals=True).set_index(["torque", "against"])
    residuals = []
    measured = []
    for part in split_torques(merged.torque):
        start, end = part["time"].values[[0, -1]]
        inner = part.sel(time=slice(start + 1.0, end - 1.0))
        for signals, values in (
            (residuals, inner["measured"] - inner["net"]),
            (measured, inner["measured"]),
        ):
            signals.append(values.values - values.values.mean())
    vaf = 100.0 * (1.0 - np.var(np.concatenate(residuals)) / np.var(np.concatenate(measured)))
    row = table.loc["net", "measured"]
    assert row["vaf"] == pytest.approx(vaf, abs=1e-6)
    assert merged.vaf_net == pytest.approx(vaf, abs=1e-6)
    assert row["low"] < vaf < row["high"]
    assert parameter_row(trials, merged)["K"] == merged.stiffness["K"]
    with pytest.raises(DataError, match="the torques of 4 trials, and 3 are given"):
        evaluate(trials[:3], merged)


@pytest.mark.parametrize("suffix", ["nc", "mat"])
def test_a_file_keeps_the_trials(trials, merged, tmp_path, suffix):
    save_estimate(merged, tmp_path / f"merged.{suffix}")
    loaded = load_estimate(tmp_path / f"merged.{suffix}")
    assert loaded == merged
    np.testing.assert_array_equal(loaded.torque["trial"], merged.torque["trial"])
    assert loaded.predict(trials).torque.equals(merged.torque)


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
    with pytest.raises(DataError, match=r"the shortest trial 2.32 s: less than ten blocks"):
        block_bootstrap([trials[0], segment(trials[1], 0.0, 3.0)], "riv", block=2.5)


# --- riv-tv


def onsets_of(trial):
    """Onsets of cycles [s] of a simulated trial."""
    phase = trial["phase"].values
    return trial["time"].values[1:][np.diff(phase) < -0.5]


def relative_errors(trial, estimate):
    """Root mean square errors of K, B and G over the means of the truth."""
    errors = {}
    for name, truth in true_trajectories(trial, estimate.trajectories).items():
        square = np.mean((estimate.trajectories[name].values - truth) ** 2)
        errors[name] = float(np.sqrt(square) / truth.mean())
    return errors


@pytest.fixture(scope="module")
def walks():
    """Cycles of uneven duration."""
    settings = {"variation": "cycle", "cycle_jitter": 0.05, **CHANGE, **QUIET}
    return [simulate(seed=seed, duration=12.0 + 2.0 * seed, **settings) for seed in range(4)]


def test_cycles_of_all_trials_count_each_by_its_onsets(walks):
    onsets = [onsets_of(walk) for walk in walks]
    estimate = identify(walks, "riv-tv", cycle_onsets=onsets, rest_position=0.0)
    last = [
        float(walk["time"][-1]) - 1.13 for walk in walks
    ]  # filters and margins reach no further
    whole = [
        np.sum((times > 1.13) & (times < end)) - 1 for times, end in zip(onsets, last, strict=True)
    ]
    assert estimate.diagnostics["cycles"] == sum(whole)
    errors = relative_errors(walks[0], estimate)
    assert errors["K"] < 0.006, errors
    assert errors["B"] < 0.015, errors
    assert errors["G"] < 0.015, errors
    assert evaluate(walks, estimate).set_index(["torque", "against"])["vaf"].min() > 99.9
    assert estimate.predict(walks, cycle_onsets=onsets) == estimate


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda onsets: onsets[:3], "onsets of cycles for 3 trials, and 4 trials"),
        (lambda onsets: [*onsets[:3], onsets[3][:1]], "fewer than two onsets"),
        (lambda onsets: [*onsets[:3], onsets[3] + 90.0], "the onsets go from 9"),
        (lambda onsets: [times[:3] for times in onsets], "too few whole cycles"),
    ],
)
def test_onsets_that_are_not_those_of_the_trials_are_refused(walks, change, message):
    with pytest.raises(DataError, match=message):
        identify(walks, "riv-tv", cycle_onsets=change([onsets_of(walk) for walk in walks]))


def test_merged_cycles_predict_another_trial_at_its_onsets(walks):
    onsets = [onsets_of(walk) for walk in walks]
    estimate = identify(walks[:3], "riv-tv", cycle_onsets=onsets[:3], rest_position=0.0)
    prediction = estimate.predict(walks[3], cycle_onsets=onsets[3])
    assert "trial" not in prediction.torque.coords
    assert prediction.vaf_net > 99.9
    with pytest.raises(DataError, match="give predict the cycle_onsets"):
        estimate.predict(walks[3])


def test_movements_of_three_seconds_are_one_course_over_their_time():
    settings = {"duration": 3.0, "variation": "time", **CHANGE, **QUIET}
    movements = [simulate(seed=seed, **settings) for seed in range(40)]
    estimate = identify(movements, "riv-tv")
    low, high = estimate.trajectories["time"].values[[0, -1]]
    assert 1.0 < low < 1.2
    assert 2.4 < high < 2.5
    errors = relative_errors(movements[0], estimate)
    assert errors["K"] < 0.02, errors
    assert errors["B"] < 0.05, errors
    assert errors["G"] < 0.06, errors
    assert estimate.diagnostics["warnings"] == []
    assert estimate.predict(movements) == estimate
    with pytest.raises(DataError, match="riv-tv needs 2 s: record longer"):
        identify([*movements[:8], segment(movements[8], 0.0, 2.5)], "riv-tv")
    with pytest.raises(DataError, match="the record is too short"):
        identify(movements[:7], "riv-tv")
