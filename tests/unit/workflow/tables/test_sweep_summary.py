import numpy as np
import pandas as pd
import pytest
from scipy import stats
from synthetic_sweep import SETTINGS, grid, make_trials

from ankleloop_workflow.plotting.sweeps import SweepAxis
from ankleloop_workflow.tables.sweeps import measure_trials, pair_methods, summarise_effects

QUANTITIES = ["vaf_net_true", "K_error", "G_error", "failures", "warnings"]
VARIED = ["reflex_gain", "voluntary"]
POINTS = grid(reflex_gain=[5.0, 10.0, 20.0], voluntary=[0.0, 0.5])


def hit(row):
    return row["trial"] == 1 and row["point.voluntary"] == 0.5 and row["method"] == "moesp"


@pytest.fixture
def table():
    return make_trials(POINTS, trials=4, fail=hit, warn=lambda row: row["trial"] == 2)


@pytest.fixture
def trials(table):
    return measure_trials(table, VARIED, QUANTITIES, SETTINGS)


def test_errors_are_relative_to_the_truth_of_each_point(trials, table):
    np.testing.assert_allclose(
        trials["G_error"],
        100 * (table["G"] - table["point.reflex_gain"]) / table["point.reflex_gain"],
    )
    np.testing.assert_allclose(trials["K_error"], 100 * (table["K"] - 150.0) / 150.0)


def test_error_of_a_truth_of_zero_does_not_exist():
    table = make_trials(grid(reflex_gain=[0.0, 10.0])).assign(G=1.0)
    trials = measure_trials(table, ["reflex_gain"], ["G_error", "G"], SETTINGS)
    without = table["point.reflex_gain"] == 0.0
    assert trials.loc[without, "G_error"].isna().all()
    assert trials.loc[~without, "G_error"].notna().all()


def test_differences_are_those_of_the_same_trial(trials):
    pairs = pair_methods(trials.sample(frac=1.0, random_state=0), "riv", "moesp", ["K_error"])
    by_trial = trials.pivot(index=["point", "trial"], columns="method", values="K_error")
    expected = (by_trial["riv"] - by_trial["moesp"]).rename("K_error")
    got = pairs.set_index(["point", "trial"])["K_error"].reindex(expected.index)
    pd.testing.assert_series_equal(got, expected)
    assert got.isna().sum() == 3  # one method failed
    assert pairs["failed"].sum() == 3
    assert set(pairs["method"]) == {"riv − moesp"}
    assert not (pairs["failed"] & pairs["warned"]).any()


def test_effect_has_the_interval_over_conditions(trials):
    axis = SweepAxis.of("voluntary", "v [1]", [0.0, 0.5])
    effects = summarise_effects(trials, axis, ["vaf_net_true"])
    part = trials[(trials["point.voluntary"] == 0.5) & (trials["method"] == "moesp")]
    means = part.groupby("point.reflex_gain")["vaf_net_true"].mean()
    row = effects[(effects["setting"] == 0.5) & (effects["method"] == "moesp")].iloc[0]
    low, _ = stats.t.interval(0.95, 2, means.mean(), stats.sem(means))
    assert (row["mean"], row["mean"] - row["margin"], row["n"]) == pytest.approx(
        (means.mean(), low, 3)
    )
    assert (row["trials"], row["failures"]) == (12, 3)


def test_effect_over_two_conditions_has_no_interval(trials):
    effects = summarise_effects(trials, SweepAxis.of("reflex_gain", "G", [5.0, 10.0]), ["K_error"])
    assert effects["n"].eq(2).all()
    assert effects["mean"].notna().all()
    assert effects["margin"].isna().all()


def test_effect_of_an_option_has_the_interval_over_trials():
    table = make_trials(grid(block_rows=[12, 18]), trials=6)
    trials = measure_trials(table, ["block_rows"], ["K"], SETTINGS)
    effects = summarise_effects(trials, SweepAxis.of("block_rows", "block rows", [12, 18]), ["K"])
    assert (effects["n"] == 6).all()
    part = table[(table["point.block_rows"] == 12) & (table["method"] == "riv")]["K"]
    row = effects[(effects["setting"] == 12) & (effects["method"] == "riv")].iloc[0]
    low, high = stats.t.interval(0.95, 5, part.mean(), stats.sem(part))
    assert (row["mean"] - row["margin"], row["mean"] + row["margin"]) == pytest.approx((low, high))


def test_effects_of_many_values_are_means_over_bins():
    values = np.linspace(0.0, 1.0, 50)
    trials = make_trials([{"voluntary": value} for value in values], trials=1).assign(
        failed=False, warned=False
    )
    effects = summarise_effects(trials, SweepAxis.of("voluntary", "v", values), ["K"])
    assert effects["setting"].nunique() == 10
    assert effects["trials"].sum() == len(trials)
    first = trials[(trials["point.voluntary"] < 0.1) & (trials["method"] == "riv")]["K"].mean()
    assert effects[effects["method"] == "riv"].sort_values("setting")["mean"].iloc[
        0
    ] == pytest.approx(first)
