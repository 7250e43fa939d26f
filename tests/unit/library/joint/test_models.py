"""Models on other trials: what belongs to the model comes from the fit, what belongs to the trial from the trial."""

import numpy as np
import pytest
from method_options import basis_options

from ankleloop import DataError, evaluate, identify, simulate, vaf
from ankleloop.joint.models import simulate_torques
from ankleloop.joint.prepared import prepare
from ankleloop.methods.registry import JOINT_METHODS

NOISE_FREE = {"snr_db": None, "voluntary": 0.0}


@pytest.fixture(scope="module")
def trial():
    return simulate(seed=1, duration=25.0, **NOISE_FREE)


@pytest.fixture(scope="module")
def other():
    return simulate(seed=2, duration=25.0, **NOISE_FREE)


def identify_model(trial, method, **options):
    """An estimate with a model that predicts; the test is left out for a method that has none."""
    estimate = identify(trial, method, **options)
    if estimate.predictor is None:
        pytest.skip(f"{method} has no model")
    return estimate


@pytest.mark.parametrize("method", JOINT_METHODS)
def test_the_recording_rate_is_that_of_the_trial(trial, method):
    """A trial of half the rate has the same torques as far as its velocity has the same band."""
    (options,) = basis_options(method, "rectifier")
    estimate = identify_model(trial, method, **options)
    fast = estimate.predict(trial).torque
    slow = estimate.predict(
        trial.isel(time=slice(0, None, 2)).assign_attrs(sampling_rate=500.0)
    ).torque
    common = slow["time"][(slow["time"] > 2.0) & (slow["time"] < 24.0)]
    for name in fast:
        pair = (
            torque[name].sel(time=common, method="nearest", tolerance=1e-6)
            for torque in (fast, slow)
        )
        assert vaf(*pair) > 99.5
    assert estimate.predictor.inputs.recording_rate == 1000.0


@pytest.mark.parametrize("method", JOINT_METHODS)
def test_scale_and_knots_are_those_of_the_fit(trial, other, method):
    """Half the movement is half the intrinsic torque; a basis that was fitted anew would not give half the reflex."""
    smaller = other.assign(position=0.5 * other["position"])
    for options in basis_options(method, "rectifier", "chebyshev", "spline"):
        estimate = identify_model(trial, method, **options)
        whole, half = (estimate.predict(record).torque for record in (other, smaller))
        np.testing.assert_allclose(half["intrinsic"], 0.5 * whole["intrinsic"], atol=1e-9)
        regressors = estimate.predictor.inputs.regressors(prepare(smaller))
        assert regressors.basis is estimate.predictor.inputs.basis
        velocity = prepare(smaller).velocity(0.04)
        np.testing.assert_array_equal(
            regressors.basis(velocity),
            estimate.predictor.inputs.basis(prepare(other).velocity(0.04) * 0.5),
        )
        if options == {"basis": "rectifier"}:  # positively homogeneous
            np.testing.assert_allclose(half["reflex"], 0.5 * whole["reflex"], atol=1e-8)


@pytest.mark.parametrize("method", ["pr-moesp", "riv"])
@pytest.mark.parametrize("basis", ["chebyshev", "spline", "rectifier"])
def test_velocities_beyond_the_fit_are_warned_of(trial, other, method, basis):
    estimate = identify(trial, method, basis=basis)
    assert estimate.predict(trial).diagnostics == estimate.diagnostics
    fast = estimate.predict(other.assign(position=3.0 * other["position"]))
    warnings = [
        text
        for text in fast.diagnostics["warnings"]
        if text not in estimate.diagnostics["warnings"]
    ]
    if basis == "rectifier":
        assert warnings == []
    else:
        assert len(warnings) == 1
        assert warnings[0].startswith("the velocity of this trial goes from -")
        assert f"the {basis} basis was fitted from -" in warnings[0]


def reflex_score(trial, estimate):
    return evaluate(trial, estimate).set_index(["torque", "against"]).loc[("reflex", "true"), "vaf"]


@pytest.mark.parametrize(
    "options", [{}, {"delay": None}, {"order": 3}, {"basis": "spline", "delay": None}], ids=str
)
def test_the_torques_of_riv_are_those_of_its_model(trial, other, options):
    estimate = identify(trial, "riv", **options)
    assert estimate.predict(trial).torque.identical(estimate.torque)
    assert reflex_score(other, estimate.predict(other)) == pytest.approx(
        reflex_score(trial, estimate), abs=1.0
    )


def test_the_initial_state_belongs_to_the_record(trial, other):
    """With it the model gives the torques of the estimate; a prediction begins at rest, and comes to the same."""
    estimate = identify(trial, "pr-moesp", basis="rectifier")
    model = estimate.predictor
    torques = simulate_torques(
        model.matrices, model.initial_state, model.inputs.regressors(prepare(trial))
    )
    np.testing.assert_allclose(torques["reflex"], estimate.torque["reflex"], atol=1e-12)
    difference = (estimate.predict(trial).torque["reflex"] - torques["reflex"]).values
    assert np.ptp(difference[:20]) > 1e-3
    np.testing.assert_allclose(difference[300:], difference[-1], atol=1e-6)


def test_short_trials_are_refused(trial):
    estimate = identify(trial, "parallel-cascade")
    short = trial.isel(time=slice(0, 1100))
    with pytest.raises(
        DataError, match=r"the trial has \d+ samples, responses take 54: record longer"
    ):
        estimate.predict(short)
