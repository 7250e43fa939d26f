"""Scores of trajectories against truths that are known in closed form."""

import numpy as np
import pytest
import xarray as xr

from ankleloop import identify, new_trial, simulate
from ankleloop.assessment.scores import parameter_row, score_trajectories, true_trajectories
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.regressors import torque_dataset

PLACES = np.linspace(0.0, 1.0, 101)
NAMES = ("stiffness_true", "viscosity_true", "reflex_gain_true")


def make_trial(profile, variation="cycle", cycle=2.0, **attributes):
    """A trial of eight seconds whose K, B and G follow a profile of the place within 0 … 1."""
    time = np.arange(8000) / 1000.0
    place = time / 8.0 if variation == "time" else time % cycle / cycle
    noise = np.random.default_rng(1).standard_normal((2, time.size))
    variables = {} if variation == "time" else {"phase": place}
    truths = {name: profile(place) for name in NAMES}
    settings = {"variation": variation, "cycle_duration": cycle, **attributes}
    return new_trial(0.01 * noise[0], noise[1], 1000.0, **variables, **truths, **settings)


def make_estimate(values, margin=None, dimension="phase", places=PLACES, **fields):
    variables = dict.fromkeys("KBG", (dimension, values))
    if margin is not None:
        variables |= {f"{name}_low": (dimension, values - margin) for name in "KBG"}
        variables |= {f"{name}_high": (dimension, values + margin) for name in "KBG"}
    torque = torque_dataset(np.arange(800) / 100, 100.0, net=np.arange(800.0))
    curves = xr.Dataset(variables, coords={dimension: places})
    return Estimate("test", torque, {"K": 1.0}, {"G": 1.0}, trajectories=curves, **fields)


def smooth(place):
    return 100.0 + 50.0 * np.sin(2 * np.pi * place)


def test_error_bias_and_coverage_are_those_of_the_definition():
    error = 4.0 + 3.0 * np.cos(2 * np.pi * 5 * PLACES[:-1])
    estimate = make_estimate(smooth(PLACES[:-1]) + error, margin=4.5, places=PLACES[:-1])
    row = score_trajectories(make_trial(smooth), estimate)
    assert row["K_bias"] == pytest.approx(4.0, abs=0.01)
    assert row["K_nrmse"] == pytest.approx(np.sqrt(4.0**2 + 0.5 * 3.0**2), abs=0.01)
    assert row["K_covered"] == pytest.approx(100.0 * np.mean(error <= 4.5), abs=1.1)


def test_trajectories_over_something_else_and_constant_joints_have_no_scores():
    trial = make_trial(smooth)
    assert score_trajectories(trial, make_estimate(smooth(PLACES), dimension="time")) == {}
    constant = simulate(seed=1, duration=10.0)
    assert true_trajectories(constant) is None
    assert score_trajectories(constant, make_estimate(smooth(PLACES))) == {}


def test_rows_of_tables_hold_the_scores_of_varying_and_of_constant_estimates():
    trial = simulate(seed=1, duration=30.0, variation="cycle", stiffness_variation=0.4)
    varying = parameter_row(trial, identify(trial, "riv-tv", cycle_onsets="phase"))
    constant = parameter_row(trial, identify(trial, "riv"))
    assert varying["K_nrmse"] < 10.0 < constant["K_nrmse"]
    # Of a cosine, a constant misses all but its mean.
    assert constant["K_nrmse"] == pytest.approx(
        np.hypot(100 * 0.4 / np.sqrt(2), constant["K_bias"]), rel=0.02
    )
    assert varying["variation_p"] < 1e-6
    assert varying["cycles"] == 19
    assert "variation_p" not in constant
