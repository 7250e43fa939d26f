"""A prepared trial: methods and scores share its values, and give exactly the results that they give alone."""

import gc
import weakref

import numpy as np
import pytest

from ankleloop import identify, simulate
from ankleloop.joint.prepared import prepare


@pytest.fixture(scope="module")
def trials():
    return [simulate(seed=seed, duration=12.0) for seed in (1, 2)]


# --- sharing


def test_options_do_not_mix(trials):
    """Values of one delay, rate, basis or reference do not serve another."""
    shared = prepare(trials[0])
    for options in (
        {},
        {"delay": 0.05},
        {"identification_rate": 50.0},
        {"basis": "rectifier"},
        {"basis": "chebyshev", "degree": 3},
        {"basis": "spline"},
        {"input_matrices": "instruments"},
        {"input_matrices": "instruments", "basis": "rectifier", "delay": 0.05},
        {},
    ):
        assert identify(shared, "pr-moesp", **options) == identify(trials[0], "pr-moesp", **options)
    for options in ({}, {"reflex_lags": 0.3}, {"intrinsic_lags": 0.02}, {}):
        cascade = {"max_passes": 2, **options}
        assert identify(shared, "parallel-cascade", **cascade) == identify(
            trials[0], "parallel-cascade", **cascade
        )


# --- memory


def test_a_trial_is_freed_with_its_last_name(trials):
    prepared = prepare(trials[0])
    identify(prepared, "riv")
    alive = weakref.ref(prepared)
    gc.disable()
    del prepared
    is_alive = alive() is not None
    gc.enable()
    assert not is_alive


# --- editing


def regressors_of(trial):
    return trial.regressors(
        delay=0.04, basis="spline", degree=5, identification_rate=100.0, reference="reference"
    )


def test_a_prepared_trial_cannot_be_edited_and_keeps_its_estimate(trials):
    data = trials[0].copy(deep=True)
    prepared = prepare(data)
    before = identify(prepared, "pr-moesp")
    for name in data.data_vars:
        with pytest.raises(ValueError, match="read-only"):
            prepared.trial[name].values[:] *= 2
        with pytest.raises(ValueError, match="read-only"):
            prepared.samples[name][0] = 0.0
    with pytest.raises(ValueError, match="read-only"):
        prepared.time[0] = 0.0
    assert prepared.trial.identical(trials[0])
    assert identify(prepared, "pr-moesp") == before


def test_samples_are_shared_with_the_data_set_which_stays_the_users(trials):
    data = trials[0].copy(deep=True)
    prepared = prepare(data)
    assert np.shares_memory(prepared.samples["position"], data["position"].values)
    data["position"].values[:] *= 2.0
    data.attrs["seed"] = 7
    assert prepared.trial.attrs["seed"] == 1
