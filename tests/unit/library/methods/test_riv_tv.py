"""Joints that change in time, in closed loop: trajectories against the truth, and records that cannot show them."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from scipy import signal as sps

from ankleloop import (
    DataError,
    evaluate,
    identify,
    load_estimate,
    new_trial,
    read_trial,
    save_estimate,
    segment,
    simulate,
)
from ankleloop.assessment.scores import true_trajectories
from ankleloop.joint.dynamics import ReflexDynamics
from ankleloop.joint.prepared import prepare
from ankleloop.joint.time_varying_course import find_onsets
from ankleloop.methods.riv_tv.equations import TimeVaryingEquations
from ankleloop.methods.riv_tv.options import RivTvOptions
from ankleloop.methods.riv_tv.solution import solve_time_varying

LIGHT = (0.1, 10.0, 100.0)
JOINT = {
    "load": LIGHT,
    "reflex_gain": 12.0,
    "stiffness_variation": 0.45,
    "viscosity_variation": 0.3,
    "viscosity_peak": 0.4,
    "gain_variation": 0.6,
    "gain_peak": 0.7,
}
QUIET = {"voluntary": 0.0, "snr_db": None}
CYCLES = {"variation": "cycle", "duration": 42.0}
LOCKED = {**CYCLES, "perturbation_locked": True}
FREQUENCIES = 2j * np.pi * np.linspace(0.1, 30.0, 100)


def relative_errors(trial, estimate, places=slice(None)):
    """Root mean square errors of K, B and G over the means of the truth."""
    truths = true_trajectories(trial, estimate.trajectories)
    return {
        name: float(
            np.sqrt(np.mean((estimate.trajectories[name].values - truth)[places] ** 2))
            / truth.mean()
        )
        for name, truth in truths.items()
    }


@pytest.fixture(scope="module")
def noisy():
    return prepare(simulate(seed=11, voluntary=0.3, **CYCLES, **JOINT))


@pytest.fixture(scope="module")
def estimate(noisy):
    return identify(noisy, "riv-tv", cycle_onsets="phase", rest_position=0.0)


def warnings_of(trial, **options):
    return " ".join(identify(trial, "riv-tv", **options).diagnostics["warnings"])


@pytest.mark.parametrize(
    ("settings", "options"),
    [
        (CYCLES, {"cycle_onsets": "phase"}),
        ({**CYCLES, "cycle_jitter": 0.06, "movement": 0.2}, {"cycle_onsets": "phase"}),
        ({**CYCLES, "locked_torque": 1.0, "pole": 60.0}, {"cycle_onsets": "phase", "order": 3}),
        ({"variation": "time", "duration": 40.0}, {}),
        ({"variation": "schedule", "duration": 60.0, "movement": 0.1}, {"schedule": "schedule"}),
    ],
    ids=["cycle", "uneven cycles and movement", "locked torque, third order", "time", "schedule"],
)
def test_noise_free_limit(settings, options):
    """What is left is how closely a dozen splines follow a cosine, and the decimation of the rectifier."""
    trial = simulate(seed=1, **QUIET, **settings, **JOINT)
    result = identify(trial, "riv-tv", **options)
    # The ends of a scheduling variable stand for what lies beyond them, too.
    errors = relative_errors(trial, result, slice(10, 85) if "schedule" in options else slice(None))
    assert errors["K"] < 0.006, errors
    assert errors["B"] < 0.015, errors
    assert errors["G"] < 0.015, errors
    assert result.stiffness["I"] == pytest.approx(0.015, rel=0.01)
    true = [40.0, 40.0, *([settings["pole"]] if "pole" in settings else [])]
    dynamics = ReflexDynamics(
        *(result.reflex[name] for name in ("omega_n", "zeta", "pole") if name in result.reflex)
    )
    np.testing.assert_allclose(dynamics.response(FREQUENCIES)[0], _lowpass(true), atol=0.01)


def _lowpass(poles):
    return np.prod([pole / (FREQUENCIES + pole) for pole in poles], axis=0)


def test_fed_back_torque_does_not_bias(noisy, estimate):
    errors = relative_errors(noisy.trial, estimate)
    assert errors["K"] < 0.05, errors
    assert errors["G"] < 0.12, errors
    squares = identify(
        noisy, "riv-tv", cycle_onsets="phase", reference="position", weighting="flat"
    )
    truth = true_trajectories(noisy.trial, estimate.trajectories)["K"]
    assert np.mean(squares.trajectories["K"].values - truth) < -0.04 * truth.mean()
    assert abs(np.mean(estimate.trajectories["K"].values - truth)) < 0.03 * truth.mean()
    scores = evaluate(noisy, estimate).set_index(["torque", "against"])["vaf"]
    assert scores["intrinsic", "true"] > 99.5
    assert scores["reflex", "true"] > 99.0


def test_bands_and_means(noisy, estimate):
    truths = true_trajectories(noisy.trial, estimate.trajectories)
    for name, truth in truths.items():
        low, high = (
            estimate.trajectories[f"{name}_low"].values,
            estimate.trajectories[f"{name}_high"].values,
        )
        assert np.all(low < estimate.trajectories[name].values)
        assert np.all(estimate.trajectories[name].values < high)
        assert np.mean((low <= truth) & (truth <= high)) > 0.6
    means = estimate.stiffness | estimate.reflex
    for name in "KBG":
        assert means[name] == pytest.approx(
            float(estimate.trajectories[name][:-1].mean()), rel=0.02
        )
        low, high = estimate.intervals[name]
        assert low < means[name] < high
    assert estimate.trajectories["K"].attrs["units"] == "N·m/rad"
    assert estimate.diagnostics["cycles"] == 28
    assert estimate.diagnostics["warnings"] == []
    assert max(estimate.diagnostics["variation_p"][name] for name in ("K", "B", "G", "all")) < 0.01


def test_a_constant_joint_is_that_of_riv():
    trial = prepare(
        simulate(
            seed=5,
            duration=56.0,
            voluntary=0.3,
            load=LIGHT,
            perturbation_locked=False,
            variation="cycle",
        )
    )
    varying, constant = identify(trial, "riv-tv", cycle_onsets="phase"), identify(trial, "riv")
    values = constant.stiffness | constant.reflex
    for name in "KBG":
        low, high = (varying.trajectories[f"{name}_{end}"].values for end in ("low", "high"))
        assert np.mean((low < values[name]) & (values[name] < high)) > 0.8
    assert varying.diagnostics["variation_p"]["all"] > 0.001
    for name in ("I", "omega_n", "zeta"):
        low, high = varying.intervals[name]
        assert low < values[name] < high


def test_coloured_noise_is_no_variation():
    """Flat weights leave the noise its colour: it is neither taken for a variation, nor for a rough trajectory."""
    p, rough = [], []
    for seed in range(5):
        trial = simulate(seed=seed, duration=42.0, voluntary=0.3, load=LIGHT, variation="cycle")
        estimate = identify(trial, "riv-tv", cycle_onsets="phase", weighting="flat")
        p.append(estimate.diagnostics["variation_p"]["all"])
        rough.append(float(estimate.trajectories["G"].std() / estimate.trajectories["G"].mean()))
    assert np.count_nonzero(np.array(p) < 0.05) <= 2  # more in 0.1 % of such tests
    assert min(p) > 1e-4
    assert np.median(rough) < 0.1


def test_the_delay_and_the_lag_of_the_torque_are_estimated():
    trial = simulate(seed=3, delay=0.05, voluntary=0.05, snr_db=20.0, **CYCLES, **JOINT)
    trial["torque"][2:] = trial["torque"].values[:-2]  # a channel that is 2 ms behind
    result = identify(trial, "riv-tv", cycle_onsets="phase", delay=None, torque_lag=None)
    assert result.reflex["delay"] == pytest.approx(0.05, abs=0.001)
    assert result.diagnostics["torque_lag"] == pytest.approx(0.002, abs=0.0003)
    low, high = result.intervals["delay"]
    assert low < 0.05 < high
    known = identify(trial, "riv-tv", cycle_onsets="phase", delay=0.05, torque_lag=0.002)
    assert relative_errors(trial, known)["B"] < 0.15


def test_another_trial_is_predicted(estimate, tmp_path):
    other = simulate(seed=12, voluntary=0.3, cycle_jitter=0.1, **CYCLES, **JOINT)
    prediction = estimate.predict(other)
    scores = evaluate(other, prediction).set_index(["torque", "against"])["vaf"]
    assert scores["intrinsic", "true"] > 99.0
    assert scores["reflex", "true"] > 99.0
    starts = other["time"].values[1:][np.diff(other["phase"].values) < -0.5]
    by_onsets = estimate.predict(other, cycle_onsets=starts)
    np.testing.assert_allclose(
        by_onsets.torque["net"][200:-200], prediction.torque["net"][200:-200], atol=0.02
    )
    save_estimate(estimate, tmp_path / "estimate.nc")
    again = load_estimate(tmp_path / "estimate.nc")
    assert again.predict(other).torque.identical(prediction.torque)
    assert again.trajectories.identical(estimate.trajectories)


@pytest.fixture(scope="module")
def scheduled():
    return simulate(seed=4, variation="schedule", duration=30.0, voluntary=0.1, **JOINT)


def test_a_scheduling_variable_from_a_file(scheduled, tmp_path):
    """The angle that schedules a joint is a further column, in degrees; the trajectories are over it."""
    channels = {name: scheduled[name].values for name in ("position", "torque", "reference")}
    angle = 15.0 + 20.0 * scheduled["schedule"].values
    table = pd.DataFrame({"time": scheduled["time"].values, **channels, "angle": angle})
    table.to_csv(tmp_path / "S1.csv", index=False)
    recorded = read_trial(
        tmp_path / "S1.csv", reference="reference", variables={"ankle_angle": "angle"}
    )
    recorded["ankle_angle"].attrs["units"] = "deg"
    result = identify(recorded, "riv-tv", schedule="ankle_angle", knots=(6, 6, 6))
    trial = new_trial(**channels, sampling_rate=1000.0, angle=angle)
    expected = identify(trial, "riv-tv", schedule="angle", knots=(6, 6, 6))
    for name in "KBG":
        np.testing.assert_allclose(
            result.trajectories[name], expected.trajectories[name], rtol=1e-6
        )
    schedule = result.trajectories["schedule"]
    assert (schedule.attrs["units"], schedule.attrs["long_name"]) == ("deg", "ankle_angle")
    assert 14.0 < schedule[0] < schedule[-1] < 36.0
    for path in (tmp_path / "estimate.nc", tmp_path / "estimate.mat"):
        save_estimate(result, path)
        assert load_estimate(path).trajectories.identical(result.trajectories)
    truth = 150.0 * (1 + 0.45 * np.cos(2 * np.pi * ((schedule - 15.0) / 20.0 - 0.5)))
    assert np.sqrt(np.mean((result.trajectories["K"].values - truth.values) ** 2)) < 0.08 * 150.0
    assert result.diagnostics["warnings"] == []
    np.testing.assert_allclose(
        result.predict(recorded).torque["net"], result.torque["net"], atol=1e-9
    )
    recorded["ankle_angle"] += 10.0
    assert any(
        "lies beyond the fitted range" in text
        for text in result.predict(recorded).diagnostics["warnings"]
    )


def excited_trial(window, cycles=40, rate=1000.0, period=1.0, seed=4, inertia=0.015):
    """An open-loop record whose perturbation acts in a part of each cycle, and its torque by a filter of SciPy."""
    rng = np.random.default_rng(seed)
    samples = int(cycles * period * rate)
    phase = np.arange(samples) / rate / period % 1.0
    steps = 0.04 * (np.repeat(rng.integers(0, 2, samples // 50), 50) - 0.5) * window(phase)
    position = sps.lfilter(
        *sps.butter(2, 15.0, fs=rate), sps.lfilter(*sps.butter(2, 15.0, fs=rate), steps)
    )
    velocity, acceleration = (
        np.gradient(position, 1 / rate),
        np.gradient(np.gradient(position, 1 / rate), 1 / rate),
    )
    stiffness = 100.0 + 40.0 * np.sin(2 * np.pi * phase)
    drive = 8.0 * np.maximum(0.0, np.roll(velocity, 40))
    reflex = sps.lfilter(*sps.bilinear([1600.0], [1.0, 80.0, 1600.0], rate), drive)
    torque = stiffness * position + 0.8 * velocity + inertia * acceleration + reflex
    torque += 0.05 * torque.std() * rng.standard_normal(samples)
    return new_trial(position, torque, rate, phase=phase), stiffness


def test_phases_without_excitation_are_blank():
    trial, _ = excited_trial(lambda phase: (phase < 0.5).astype(float))
    result = identify(trial, "riv-tv", cycle_onsets="phase", reference="position")
    curve = result.trajectories["K"]
    assert np.all(np.isnan(curve.sel(phase=slice(0.7, 0.85))))
    assert np.all(np.isnan(result.trajectories["K_low"].sel(phase=slice(0.7, 0.85))))
    inside = curve.sel(phase=slice(0.1, 0.4))
    np.testing.assert_allclose(
        inside, 100.0 + 40.0 * np.sin(2 * np.pi * inside["phase"]), rtol=0.08
    )
    assert any(
        text.startswith("K is not identified at phase 0.")
        for text in result.diagnostics["warnings"]
    )
    assert result.diagnostics["excitation"]["K"][80] < 0.02


@pytest.mark.parametrize("onsets", ["phase", None])
def test_samples_count_by_the_inverse_of_the_noise_at_their_place(onsets):
    trial, _ = excited_trial(np.ones_like)
    place = trial["phase"].values if onsets else np.linspace(0.0, 1.0, trial.sizes["time"])
    level = 4.0 ** -np.cos(2.0 * np.pi * place)
    trial["torque"] += 0.5 * level * np.random.default_rng(1).standard_normal(place.size)
    options = RivTvOptions(reference="position", cycle_onsets=onsets)
    solution = solve_time_varying(TimeVaryingEquations([prepare(trial)], options))
    course, noise = solution.equations.course, solution.system.residual(solution.parameters.linear)
    loud = np.abs(course.place[course.rows] - 0.5) < 0.2
    assert 0.7 < np.std(noise[loud]) / np.std(noise[~loud]) < 1.4  # in the torque it is above 4


@pytest.mark.parametrize(
    ("settings", "options", "message"),
    [
        ({**LOCKED, "cycle_jitter": 0.06, "movement": 0.2}, {"cycle_onsets": "phase"}, "locked"),
        (
            {"duration": 9.0, "variation": "cycle"},
            {"cycle_onsets": "phase"},
            "whole cycles lie more than 0.75 s",
        ),
        ({"duration": 9.0}, {}, "without cycles needs 9.5 s"),
        (CYCLES, {"cycle_onsets": "position"}, "the phase of a cycle goes from 0 to 1"),
        (
            {**CYCLES, **JOINT, "voluntary": 4.0},
            {"cycle_onsets": "phase"},
            "it is too weak an instrument",
        ),
    ],
)
def test_records_that_cannot_show_the_change(settings, options, message):
    with pytest.raises(DataError, match=message):
        identify(simulate(seed=1, **settings), "riv-tv", **options)


def test_weak_instruments_at_some_phases_are_warned_about():
    """Over a third of each cycle the reference is that of another record: it explains the rest alone."""
    trial, other = (simulate(seed=seed, voluntary=0.3, **CYCLES, **JOINT) for seed in (1, 2))
    trial["reference"] = xr.where(trial["phase"] < 0.3, other["reference"], trial["reference"])
    result = identify(trial, "riv-tv", cycle_onsets="phase")
    assert any(
        text.startswith("the instruments are weak") for text in result.diagnostics["warnings"]
    )
    assert any(
        text.startswith("not converged after 30 rounds") for text in result.diagnostics["warnings"]
    )
    assert result.intervals == {}
    assert np.all(np.isnan(result.trajectories["K_low"]))


def test_an_inertia_that_varies(noisy, estimate, tmp_path):
    """In open loop, against the truth; where it is constant, splines of it change nothing else."""
    inertia = 0.015 * (1.0 + 0.3 * np.sin(2 * np.pi * np.arange(40_000) / 1000.0))
    trial, stiffness = excited_trial(np.ones_like, inertia=inertia)
    result = identify(trial, "riv-tv", cycle_onsets="phase", reference="position", inertia_knots=8)
    np.testing.assert_allclose(result.trajectories["I"], inertia[:1001:10], atol=0.0015)
    np.testing.assert_allclose(result.trajectories["K"], stiffness[:1001:10], atol=6.0)
    assert np.mean(result.trajectories["I_low"] < inertia[:1001:10]) > 0.8
    assert result.stiffness["I"] == pytest.approx(0.015, rel=0.03)
    assert result.trajectories["I"].attrs["units"] == "kg·m²"
    save_estimate(result, tmp_path / "estimate.nc")
    assert (
        load_estimate(tmp_path / "estimate.nc")
        .predict(trial)
        .torque.identical(result.predict(trial).torque)
    )
    varying = identify(noisy, "riv-tv", cycle_onsets="phase", rest_position=0.0, inertia_knots=8)
    np.testing.assert_allclose(varying.trajectories["I"], 0.015, rtol=0.1)
    for name in "KBG":
        band = estimate.trajectories[f"{name}_high"] - estimate.trajectories[name]
        assert np.all(np.abs(varying.trajectories[name] - estimate.trajectories[name]) < 0.3 * band)


MOVING = {
    "variation": "cycle",
    "stiffness_variation": 0.4,
    "movement": 0.2,
    "cycle_jitter": 0.1,
    "duration": 42.0,
}


def test_options_are_selected_on_unseen_cycles_at_their_own_onsets():
    trial = simulate(seed=1, **MOVING)
    select = {"knots": [(4, 4, 4), (12, 8, 12)]}
    by_phase, by_onsets = (
        identify(trial, "riv-tv", cycle_onsets=cycles, select=select).diagnostics["selection"]
        for cycles in ("phase", find_onsets(prepare(trial), "phase"))
    )
    assert by_phase["chosen"] == by_onsets["chosen"]
    for scores in zip(by_phase["candidates"], by_onsets["candidates"], strict=True):
        first, second = (next(iter(candidate["scores"].values())) for candidate in scores)
        assert first == pytest.approx(second, abs=0.5)


def test_onsets_of_another_trial_or_of_another_time():
    trial, other = (simulate(seed=seed, **MOVING) for seed in (1, 2))
    onsets = find_onsets(prepare(trial), "phase")
    assert warnings_of(trial, cycle_onsets=onsets) == ""
    text = "the movement is not the same at all onsets of cycles"
    assert text in warnings_of(trial, cycle_onsets=find_onsets(prepare(other), "phase"))
    part = segment(trial, 14.0, 42.0)
    identify(part, "riv-tv", cycle_onsets=onsets)
    with pytest.raises(DataError, match="a segment keeps the times of its trial"):
        identify(part, "riv-tv", cycle_onsets=onsets[onsets > 14.0] - 14.0)


@pytest.mark.parametrize(("late", "word"), [(500, "s earlier"), (-500, "s later"), (0, "")])
def test_a_schedule_that_is_shifted_in_time_is_a_warning(late, word):
    trial = simulate(
        seed=1, variation="schedule", stiffness_variation=0.4, movement=0.2, duration=42.0
    )
    trial["schedule"] = ("time", np.roll(trial["schedule"].to_numpy(), late))
    warnings = warnings_of(trial, schedule="schedule")
    assert ("follows the schedule" in warnings) == bool(word)
    assert word in warnings


@pytest.mark.parametrize("seed", range(3))
def test_a_third_pole_that_is_not_there_is_a_warning(seed):
    """As by `riv`: two of three poles are shown, whichever of them is called the third."""
    trial = simulate(seed=seed, variation="cycle", stiffness_variation=0.4)
    estimate = identify(trial, "riv-tv", cycle_onsets="phase", order=3)
    assert "take order=2" in " ".join(estimate.fit_warnings)
    estimate = identify(trial, "riv-tv", cycle_onsets="phase")
    assert estimate.warnings == []
