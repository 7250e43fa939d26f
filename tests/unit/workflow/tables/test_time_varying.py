"""Summaries of studies of joints that change in time."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from ankleloop import DataError, simulate
from ankleloop.assessment.cramer_rao import trajectory_bound
from ankleloop.assessment.scores import score_trajectories, true_trajectories
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.regressors import torque_dataset
from ankleloop.simulation.settings import SimulationSettings
from ankleloop_workflow.jobs.predictions import predict
from ankleloop_workflow.tables.estimate_tables import write_estimates
from ankleloop_workflow.tables.time_varying import (
    average_study,
    average_trajectories,
    compare_with_bound,
    measure_trajectories,
    profile_trajectories,
)

PLACES = np.linspace(0.0, 1.0, 101)
SETTINGS = SimulationSettings.defaults() | {
    "variation": "cycle",
    "stiffness_variation": 0.4,
    "duration": 20.0,
}


def make_estimate(offsets, places=PLACES, dimension="phase"):
    truths = profile_trajectories(SETTINGS, "phase", PLACES)
    variables = {name: (dimension, truths[name] + offsets) for name in "KBG"}
    variables |= {f"{name}_{end}": variables[name] for name in "KBG" for end in ("low", "high")}
    torque = torque_dataset(
        np.arange(100) / 100, 100.0, **dict.fromkeys(("net", "intrinsic", "reflex"), np.zeros(100))
    )
    return Estimate(
        "riv-tv", torque, {}, {}, trajectories=xr.Dataset(variables, coords={dimension: places})
    )


@pytest.mark.parametrize("shape", ["smooth", "square"])
@pytest.mark.parametrize("variation", ["cycle", "time", "schedule"])
def test_profiles_are_those_of_simulated_trials(variation, shape):
    settings = {
        "duration": 12.0,
        "variation": variation,
        "variation_shape": shape,
        "gain_variation": 0.5,
    }
    trial = simulate(seed=1, cycle_jitter=0.05, **settings)
    truths = true_trajectories(trial)
    (dimension,) = truths.sizes
    profile = profile_trajectories(settings, dimension, truths[dimension].values)
    far = (
        np.abs(np.gradient(truths["G"].values)) < 1.0
    )  # of the steps, which lie between two samples
    np.testing.assert_allclose(profile["G"][far], truths["G"].values[far], atol=0.05)


def test_bias_and_random_error_are_those_of_each_place():
    rng = np.random.default_rng(2)
    errors = 6.0 + rng.standard_normal((40, 101)) * 3.0
    curves = average_trajectories([make_estimate(error) for error in errors], SETTINGS)
    assert curves["n"].eq(40).all()
    trial = simulate(seed=1, **SETTINGS)
    rows = [score_trajectories(trial, make_estimate(error)) for error in errors]
    details = pd.DataFrame(rows).assign(point="p", method="m", trial=range(40))
    row = (
        measure_trajectories(details, curves.assign(point="p", method="m"))
        .set_index("parameter")
        .loc["K"]
    )
    assert row["bias"] == pytest.approx(100 * 6.0 / 150.0, rel=0.03)
    assert row["random"] == pytest.approx(100 * 3.0 / 150.0, rel=0.03)
    assert row["mean_error"] == pytest.approx(100 * errors.mean() / 150.0, rel=0.02)
    # The mean square over trials is that of the bias and of the scatter about it.
    square = np.mean([value["K_nrmse"] ** 2 for value in rows])
    assert row["bias"] ** 2 + row["random"] ** 2 * 39 / 40 == pytest.approx(square, rel=0.02)
    assert row["total"] == pytest.approx(np.sqrt(square), rel=0.03)
    assert row["trials"] == 40


def test_places_that_some_trials_do_not_identify_count_fewer_trials():
    blank = np.zeros(101)
    blank[:10] = np.nan
    curves = average_trajectories(
        [make_estimate(blank), make_estimate(np.full(101, 2.0))], SETTINGS
    )
    part = curves[curves["parameter"] == "K"].reset_index(drop=True)
    assert part.loc[:9, "n"].eq(1).all()
    assert part.loc[:9, "sd"].isna().all()
    np.testing.assert_allclose(
        part["mean"] - part["truth"], np.where(np.arange(101) < 10, 2.0, 1.0), atol=1e-9
    )
    assert average_trajectories([], SETTINGS).empty


def test_a_study_without_trajectories_is_refused(tmp_path):
    estimate = make_estimate(np.zeros(101))
    constant = Estimate("riv", estimate.torque, {"K": 1.0}, {})
    with write_estimates(tmp_path / "e.parquet") as table:
        table.add(constant, point="only", name="riv", number=0)
    with pytest.raises(DataError, match="no estimate of the study has trajectories"):
        average_study([tmp_path / "e.parquet"], {"only": SETTINGS}, ["riv"])


POINT = {
    "variation": "cycle",
    "duration": 42.0,
    "stiffness_variation": 0.4,
    "cycle_onsets": "phase",
}


def test_efficiency_of_estimates_that_scatter_as_the_bound_says(tmp_path):
    """Normal errors with the deviations of the bound have an efficiency of 100 %, and its interval holds that."""
    rng, trials = np.random.default_rng(1), 400
    settings = {name: value for name, value in POINT.items() if name != "cycle_onsets"}
    bound = trajectory_bound(seed=0, **settings)
    truth = simulate(seed=0, **settings)["stiffness_true"].values[:1400].mean()
    errors = 100.0 / truth * bound["K"].values * rng.standard_normal((trials, bound.sizes["phase"]))
    means = 100.0 / truth * float(bound["K_mean"]) * rng.standard_normal(trials)
    scores = {"K_nrmse": np.sqrt((errors**2).mean(axis=1)), "K_bias": means}
    details = pd.DataFrame(
        scores | {f"{name}_{score}": 1.0 for name in "BG" for score in ("nrmse", "bias")}
    )
    details = details.assign(point="p", method="m")
    path = tmp_path / "predictions.parquet"
    points = {"p": SimulationSettings(**settings).model_dump()}
    predict(path, "s", points, {"trajectories": 1})
    bounds = pd.read_parquet(path)
    table = compare_with_bound(details, bounds, "m").set_index("parameter")
    assert table.loc["K", "efficiency"] == pytest.approx(100.0, rel=0.03)
    assert table.loc["K", "mean_low"] < 100.0 < table.loc["K", "mean_high"]
    assert table.loc["K", "mean_high"] / table.loc["K", "mean_low"] < 1.4
    assert compare_with_bound(details, bounds, "other").empty
    assert compare_with_bound(details, bounds.head(0), "m").empty
