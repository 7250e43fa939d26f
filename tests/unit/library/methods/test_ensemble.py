"""`ensemble`: windows of a simulator of their own, whose joint is known; properties of the equations."""

import sys
import time
from dataclasses import replace
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
import pytest

from ankleloop import (
    DataError,
    compare,
    cut,
    identify,
    identify_each,
    load_estimate,
    new_trial,
    save_estimate,
)
from ankleloop.joint.prepared import prepare_trials
from ankleloop.methods.ensemble.equations import EnsembleEquations
from ankleloop.methods.ensemble.options import EnsembleOptions
from ankleloop.methods.ensemble.solution import EnsembleSolution
from ankleloop.methods.ensemble.windows import Windows

sys.path.append(str(Path(__file__).parents[4] / "benchmarks"))
from windows import STIFF, TRUTH, Ensemble, simulate_ensemble, simulate_record

QUIET = Ensemble(
    load=STIFF,
    trials={"nominal": 12, "up": 12},
    voluntary=0.01,
    offset=0.01,
    torque_noise=0.005,
    position_noise=1e-6,
)


@pytest.fixture(scope="module")
def windows():
    return simulate_ensemble(Ensemble(), 1)


@pytest.fixture(scope="module")
def estimate(windows):
    return identify(windows, "ensemble")


# --- truth


def test_windows_with_little_noise_give_the_truth():
    estimate = identify(simulate_ensemble(QUIET, 1), "ensemble")
    for name, value in TRUTH.items():
        assert estimate[name] == pytest.approx(value, rel=0.02), name
    assert abs(estimate["K_slope"]) < 2.0


def test_what_is_the_same_in_all_trials_has_no_influence(windows, estimate):
    """Posture, movement and their torque: any function of the time from the onset."""
    times = windows[0]["time"].values
    common = 30.0 * np.sin(8.0 * times) + 100.0 * times**2
    shifted = [part.assign(torque=part["torque"] + common) for part in windows]
    again = identify(shifted, "ensemble")
    assert again.values == pytest.approx(estimate.values, rel=1e-6)


def test_a_movement_with_its_torque_changes_little():
    moving = replace(Ensemble(load=STIFF), moving=True)
    estimate = identify(simulate_ensemble(moving, 3), "ensemble")
    for name in ("K", "B", "I", "G"):
        low, high = estimate.intervals[name]
        assert low < TRUTH[name] < high, name


def test_the_slope_of_a_stiffness_that_rises():
    rising = replace(QUIET, stiffness_slope=1.6)
    estimate = identify(simulate_ensemble(rising, 2), "ensemble")
    assert estimate["K"] == pytest.approx(TRUTH["K"] * 1.16, rel=0.02)
    assert estimate["K_slope"] == pytest.approx(TRUTH["K"] * 1.6, rel=0.1)
    constant = identify(simulate_ensemble(rising, 2), "ensemble", slope=False)
    assert constant.diagnostics["movement_p"] < 0.05
    assert "K_slope" not in constant.stiffness


def test_a_short_range_stiffness_is_warned_of():
    yielding = simulate_ensemble(replace(QUIET, short_range=150.0), 2)
    assert "a stiffness that changes with the stretch" in identify(yielding, "ensemble").warnings[0]


def test_a_joint_without_a_reflex_is_passive():
    estimate = identify(simulate_ensemble(Ensemble(load=STIFF, gain=0.0), 1), "ensemble")
    assert {"omega_n", "zeta"}.isdisjoint(estimate.reflex)
    low, high = estimate.intervals["G"]
    assert low < 0.0 < high


# --- equations


def test_no_trial_is_its_own_instrument_and_their_sum_is_zero(windows):
    options = EnsembleOptions()
    equations = EnsembleEquations(
        Windows.of(prepare_trials(windows), options), options, offsets=False
    )
    columns = equations.columns(equations.find_start()[0])
    instruments = equations.make_instruments(columns)
    scale = np.abs(columns).max(axis=(1, 2))
    assert np.all(np.abs(instruments.sum(axis=1)).max(axis=1) < 1e-9 * scale)
    changed = columns.copy()
    changed[:, 7] += scale[:, None]
    again = equations.make_instruments(changed)
    np.testing.assert_allclose(again[:, 7], instruments[:, 7], rtol=1e-9, atol=1e-12)
    assert not np.allclose(again[:, 8], instruments[:, 8])


def test_columns_are_derivatives_of_the_torque(windows):
    """By the dynamics and the delay against differences of the torque of the reflex."""
    options = EnsembleOptions()
    few = prepare_trials(windows[:20])
    equations = EnsembleEquations(Windows.of(few, options), options, offsets=False)
    parameters = equations.find_start()[0]
    size = parameters.linear.size
    columns = equations.columns(parameters)
    for number in range(size, size + 3):
        step = np.zeros(size + 3)
        step[number] = 1e-5
        ahead, behind = (
            equations.columns(parameters.add(signed))[size - 1] for signed in (step, -step)
        )
        slope = parameters.linear[-1] * (ahead - behind) / 2e-5
        np.testing.assert_allclose(columns[number], slope, atol=1e-4 * np.abs(slope).max())


# --- what takes the estimate


def test_a_file_a_figure_and_a_table_have_the_conditions(windows, estimate, tmp_path):
    for suffix in ("nc", "mat"):
        path = tmp_path / f"estimate.{suffix}"
        save_estimate(estimate, path)
        loaded = load_estimate(path)
        assert loaded == estimate
        assert loaded.conditions == {"nominal": 100, "up": 40}
    data = estimate.plot().data
    assert data["x"].max() == pytest.approx(0.25)
    assert set(data["series"]) == {"measured", "net", "intrinsic", "reflex"}
    plt.close("all")
    torque = estimate.torque.sel(time=estimate.torque["trial"] == 2)
    left = torque["measured"] - torque["net"]
    assert float(np.std(left)) < 0.1 * float(np.std(torque["measured"]))
    text = estimate.methods_text()
    assert "140 trials (100 of nominal, 40 of up), -100 to 250 ms from the onset" in text
    table = identify_each([windows], "ensemble")
    assert table["K"][0] == estimate["K"]
    assert table["trusted"][0]
    assert "onset" not in table


def test_tasks_are_compared_within_subjects():
    """The condition within an ensemble is no label of it; K is 60 % higher in one of the tasks."""
    ensembles = []
    for seed, (subject, task) in enumerate(product(("S1", "S2", "S3"), ("stand", "lean"))):
        settings = replace(QUIET, stiffness_slope=0.0 if task == "stand" else 6.0)
        parts = simulate_ensemble(settings, seed)
        ensembles.append([part.assign_attrs(subject=subject, task=task) for part in parts])
    table = identify_each(ensembles, "ensemble")
    assert {"subject", "task"} < set(table.columns)
    assert "condition" not in table
    comparison = compare(table, "task", within="subject")
    difference = comparison.query("kind == 'difference' and parameter == 'K'").iloc[0]
    assert abs(difference["value"]) == pytest.approx(0.6 * TRUTH["K"], rel=0.05)
    assert difference["low"] * difference["high"] > 0.0


def test_a_record_with_onsets_is_the_list_of_its_windows():
    record, onsets, conditions = simulate_record(Ensemble(load=STIFF), 1, duration=90.0)
    whole = identify(record, "ensemble", onsets=onsets, condition=conditions)
    assert whole == identify(cut(record, onsets, condition=conditions), "ensemble")
    low, high = whole.intervals["K"]
    assert low < TRUTH["K"] < high
    perturbed = [name == "up" for name in conditions]
    assert identify(record, "ensemble", onsets=onsets, condition=perturbed) == whole
    assert f"onsets = {onsets.size} values" in whole.methods_text()
    with pytest.raises(DataError, match="and no onset"):
        identify(record, "ensemble", onsets=onsets, condition=conditions, onset=0.3)


def test_an_identification_takes_less_than_a_second(windows):
    start = time.process_time()
    identify(windows, "ensemble")
    assert time.process_time() - start < 1.0


# --- warnings and refusals


def test_conditions_that_differ_before_the_onset_have_offsets_and_a_warning(windows):
    tensed = [
        part.assign(torque=part["torque"] + 1.5 * (part.attrs["condition"] == "up"))
        for part in windows
    ]
    estimate = identify(tensed, "ensemble")
    assert "the conditions differ before the onset" in " ".join(estimate.warnings)
    assert estimate.diagnostics["offsets"] == pytest.approx([1.5], abs=0.8)
    low, high = estimate.intervals["K"]
    assert low < TRUTH["K"] < high


def test_faults_of_a_channel_are_warned_of_with_their_window(windows):
    clipped = [part.assign(torque=part["torque"].clip(-1.0, 4.0)) for part in windows]
    assert "end of the range of the torque" in " ".join(identify(clipped, "ensemble").warnings)
    struck = windows[7].copy(deep=True)
    struck["torque"][380] += 200.0
    warnings = identify([*windows[:7], struck, *windows[8:]], "ensemble").warnings
    assert [text.startswith("trial 8 of 140: the torque has a spike") for text in warnings] == [
        True
    ]


def test_peaks_that_a_command_makes_are_no_fault():
    sharp = replace(QUIET, command="sequences", trials={str(n): 10 for n in range(4)}, after=0.65)
    assert not identify(simulate_ensemble(sharp, 5), "ensemble", window=(-0.1, 0.15)).warnings


def test_a_reflex_that_is_hardly_seen_warns():
    few = Ensemble(voluntary=3.0, trials={"nominal": 30, "up": 15})
    estimate = identify(simulate_ensemble(few, 1000), "ensemble")
    assert estimate.diagnostics["reflex_score"] < 4.0
    assert "times its standard error" in " ".join(estimate.warnings)


def test_sequences_of_each_trials_own_are_refused():
    """Their mean over a condition is hardly a command."""
    own = Ensemble(
        command="own sequences", trials={"nominal": 40, "sequence": 40}, voluntary=1.5, after=0.45
    )
    with pytest.raises(DataError, match="repeat a few sequences"):
        identify(simulate_ensemble(own, 1), "ensemble")


@pytest.mark.parametrize(
    ("change", "options", "message"),
    [
        (lambda parts: [p for p in parts if p.condition == "up"], {}, "all windows have the cond"),
        (lambda parts: [*parts[:60], *parts[-1:]][:20], {}, "each condition needs 8 trials"),
        (lambda parts: parts[0], {}, "ensemble takes windows"),
        (lambda parts: [], {}, "no windows"),
        (lambda parts: parts, {"window": (-0.1, 0.1)}, "used until 0.1 s after it"),
        (lambda parts: parts, {"window": (0.2, 0.1)}, "used until 0 s after it"),
        (lambda parts: parts, {"onset": 0.02}, "begin 0.02 s before the onset"),
        (lambda parts: parts, {"onset": 5.0}, "lies behind the end"),
        (lambda parts: [*parts, parts[0]], {}, "are the same record"),
        (
            lambda parts: [p.drop_attrs().assign_attrs(sampling_rate=1000.0) for p in parts],
            {},
            "has no condition",
        ),
    ],
)
def test_windows_that_say_nothing_are_refused(windows, change, options, message):
    with pytest.raises(DataError, match=message):
        identify(change(windows), "ensemble", **options)


def test_windows_without_an_onset_need_one(windows, estimate):
    bare = [
        new_trial(part.position.values, part.torque.values, 1000.0, condition=part.condition)
        for part in windows
    ]
    with pytest.raises(DataError, match="give onset"):
        identify(bare, "ensemble")
    assert identify(bare, "ensemble", onset=0.3) == estimate


def test_the_bias_of_weak_instruments_is_that_of_many_draws():
    """Of one unknown, whose column has noise that feedback correlates with that of the torque."""
    generator = np.random.default_rng(1)
    groups = np.repeat([0, 1], 12)
    draws = []
    for _ in range(4000):
        noise = generator.standard_normal(24)
        column = 2.0 * groups + noise
        torque = -0.8 * noise + 0.6 * generator.standard_normal(24)
        column, torque = column - column.mean(), torque - torque.mean()
        sums = np.array([column[groups == group].sum() for group in (0, 1)])
        instruments = (sums[groups] - column) / 11 + column / 23
        parts = instruments * column
        scatter = np.var(column - sums[groups] / 12) * 24 / 22
        if parts.sum() < scatter:  # an F statistic below 2, which is refused
            continue
        value = instruments @ torque / parts.sum()
        contributions = instruments * (torque - value * column)
        influences = contributions / (parts.sum() - parts)
        solution = SimpleNamespace(
            normal=parts.sum(keepdims=True)[:, None],
            trial_normals=parts[:, None, None],
            contributions=contributions[:, None],
            covariance=np.sum(influences**2, keepdims=True)[:, None],
            parameters=SimpleNamespace(linear=np.zeros(1), unknowns=()),
        )
        draws.append([value, value - EnsembleSolution.bias.fget(solution).item()])
    solved, corrected = np.array(draws).T
    assert solved.mean() > 0.06
    assert abs(corrected.mean()) < 0.02
    assert corrected.std() < solved.std()
