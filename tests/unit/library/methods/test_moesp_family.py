"""The MOESP family: the truth without noise, its models, references, and merged trials."""

import control
import numpy as np
import pytest

from ankleloop import METHODS, DataError, evaluate, identify, segment, simulate
from ankleloop.joint.prepared import prepare
from ankleloop.methods.moesp import MEMBERS

TRUE_POLES = np.poly([np.exp(-0.4), np.exp(-0.4)])  # two at 40 rad/s, at 100 Hz


def evaluate_vaf(trial, estimate):
    return evaluate(trial, estimate).set_index(["torque", "against"])["vaf"]


def assert_joint(estimate, gain=13.0):
    """K = 150, B = 0.8, I = 0.015 and a double pole at 40 rad/s."""
    values = estimate.stiffness | estimate.reflex
    truth = {
        "K": 150.0,
        "I": 0.015,
        "B": 0.8,
        "G": gain,
        "omega_n": 40.0,
        "zeta": 1.0,
        "delay": 0.04,
    }
    for name, accuracy in zip(truth, (0.005, 0.005, 0.015, 0.005, 0.01, 0.01, 0.0), strict=True):
        assert values[name] == pytest.approx(truth[name], rel=accuracy), name
    np.testing.assert_allclose(np.poly(estimate.model.poles()), TRUE_POLES, atol=0.01)


# --- recovery of the truth


@pytest.mark.parametrize(
    ("method", "options"),
    [(method, {}) for method in MEMBERS]
    + [
        ("pr-moesp", {"projection": "correlation"}),
        ("pr-moesp", {"input_matrices": "instruments"}),
    ],
    ids=str,
)
@pytest.mark.parametrize("gain", [2.0, 13.0])
def test_a_rectifier_recovers_the_joint_without_noise(clean, gain, method, options):
    estimate = identify(clean[gain], method, basis="rectifier", **options)
    assert_joint(estimate, gain)
    assert evaluate_vaf(clean[gain], estimate).min() >= 99.99


def test_a_polynomial_is_not_a_rectifier(clean):
    """With degree 5 about half a percent of the net torque stays unexplained, most of it in the reflex."""
    estimate = identify(clean[13.0], "pr-moesp", basis="chebyshev")
    result = evaluate_vaf(clean[13.0], estimate)
    assert 1.13 < estimate.reflex["G"] / 13.0 < 1.21
    assert 0.94 < estimate.stiffness["I"] / 0.015 < 1.0
    assert estimate.stiffness["K"] == pytest.approx(150.0, rel=0.01)
    assert 99.0 < result["net", "true"] < 99.9
    assert 97.0 < result["reflex", "true"] < 99.5


def test_the_third_order_form_of_the_reflex():
    trial = simulate(seed=1, voluntary=0.0, snr_db=None, pole=20.0)
    second, third = (
        identify(trial, "pr-moesp", basis="rectifier", order=order) for order in (2, 3)
    )
    expected = np.poly([np.exp(-0.4), np.exp(-0.4), np.exp(-0.2)])
    np.testing.assert_allclose(np.poly(third.model.poles()), expected, atol=0.01)
    assert evaluate_vaf(trial, third).min() >= 99.99
    assert evaluate_vaf(trial, second)["reflex", "true"] < 99.95
    assert third.reflex["G"] == pytest.approx(13.0, rel=0.005)


@pytest.mark.parametrize("rate", [50.0, 200.0])
def test_other_identification_rates(clean, rate):
    estimate = identify(clean[13.0], "pr-moesp", basis="rectifier", identification_rate=rate)
    assert estimate.model.dt == 1 / rate
    assert estimate.stiffness["K"] == pytest.approx(150.0, rel=0.02)
    assert evaluate_vaf(clean[13.0], estimate)["net", "true"] > 99.9


# --- models


@pytest.mark.parametrize(("basis", "degree"), [("chebyshev", 5), ("rectifier", 1), ("spline", 6)])
@pytest.mark.parametrize(
    ("method", "free_b"), [*((method, False) for method in MEMBERS), ("pr-moesp", True)]
)
def test_the_model_reproduces_the_torques(noisy, method, basis, degree, free_b):
    estimate = identify(noisy, method, basis=basis, degree=degree, free_b=free_b)
    regressors = prepare(noisy).regressors(
        delay=0.04, basis=basis, degree=degree, identification_rate=100.0
    )
    model = estimate.model
    terms = (
        ["rectified_velocity"]
        if basis == "rectifier"
        else [f"{basis}_{k}" for k in range(1, degree + 1)]
    )
    assert model.input_labels == ["position", "velocity", "acceleration", *terms]
    u = (regressors.inputs - regressors.inputs.mean(axis=0)).T
    # From this sample on the effect of the initial state is below rounding.
    start = int(np.log(1e-13) / np.log(np.max(np.abs(model.poles()))))
    assert start < 1500
    for torque, channels in (
        ("net", slice(None)),
        ("intrinsic", slice(0, 3)),
        ("reflex", slice(3, None)),
    ):
        inputs = np.zeros_like(u)
        inputs[channels] = u[channels]
        simulated = control.forced_response(model, inputs=inputs).outputs[0][start:]
        actual = estimate.torque[torque].values[start:]
        # Torques are deviations from their means.
        np.testing.assert_allclose(
            actual - actual.mean(), simulated - simulated.mean(), atol=1e-7, err_msg=torque
        )
    np.testing.assert_allclose(estimate.torque["time"], regressors.time, rtol=1e-14)
    stiffness = [estimate.stiffness[name] for name in "KBI"]
    if free_b:  # the effect of P, Ṗ and P̈ through the state counts as well
        expected = np.linalg.lstsq(u[:3].T, estimate.torque["intrinsic"].values, rcond=None)[0]
        np.testing.assert_allclose(stiffness, expected, rtol=1e-6)
        assert np.all(model.B != 0)
    else:
        assert stiffness == model.D[0, :3].tolist()
        assert np.array_equal(np.any(model.B != 0, axis=0), regressors.reflex)


@pytest.mark.parametrize("basis", ["rectifier", "spline"])
def test_free_b_still_separates_the_torques(clean, basis):
    """Without noise the joint is a special case of the model with free B, and so are its two torques."""
    estimate = identify(clean[13.0], "pr-moesp", basis=basis, degree=8, free_b=True)
    result = evaluate_vaf(clean[13.0], estimate)
    assert result["net", "true"] >= 99.9
    assert min(result["intrinsic", "true"], result["reflex", "true"]) >= 99.0
    assert estimate.stiffness["K"] == pytest.approx(150.0, rel=0.05)


def test_ranks_and_stability_are_diagnostics(clean, noisy):
    for order in (2, 3):
        diagnostics = identify(
            noisy, "pr-moesp", basis="rectifier", projection="correlation", order=order
        ).diagnostics
        assert diagnostics["instrument_rows"] >= 4 * 15 + order
    # T₁ is the velocity 4 samples late: 11 of its 15 Hankel rows are rows of the velocity, up to filter errors.
    diagnostics = identify(
        clean[13.0], "pr-moesp", basis="chebyshev", degree=1, order=1
    ).diagnostics
    assert diagnostics["rank"] <= 4 * 15 - 11
    unstable = identify(noisy, "pi-moesp", basis="rectifier", order=6)
    (warning,) = unstable.diagnostics["warnings"]
    assert all(text in warning for text in ("unstable A (spectral radius 1.0", "order 6"))
    assert warning in repr(unstable)
    assert evaluate_vaf(noisy, unstable)["net", "measured"] > 90


# --- the reference


@pytest.mark.parametrize("options", [{}, {"input_matrices": "instruments"}])
def test_the_position_serves_as_reference_of_an_open_loop_record(options):
    trial = simulate(
        seed=1, duration=20.0, closed_loop=False, voluntary=0.0, snr_db=None
    ).drop_vars("reference")
    estimate = identify(trial, "pr-moesp", basis="rectifier", reference="position", **options)
    assert estimate.diagnostics["reference"] == "position"
    assert_joint(estimate)
    assert evaluate_vaf(trial, estimate).min() >= 99.99


# --- merged trials


def test_short_trials_are_merged():
    """Ten records of five seconds give what the whole record gives, and their order does not matter."""
    whole = simulate(seed=1, snr_db=None, voluntary=0.0)
    parts = [segment(whole, 5.0 * k, 5.0 * (k + 1)) for k in range(10)]
    estimate = identify(parts, "pr-moesp", basis="rectifier")
    assert estimate.stiffness["K"] == pytest.approx(150.0, rel=2e-3)
    assert estimate.reflex["G"] == pytest.approx(13.0, rel=5e-3)
    assert evaluate(parts, estimate, trim=0.0).query("torque == 'net'")["vaf"].min() > 99.9
    again = identify(
        [parts[k] for k in (3, 8, 1, 6, 0, 9, 4, 7, 2, 5)], "pr-moesp", basis="rectifier"
    )
    assert again.stiffness["K"] == pytest.approx(estimate.stiffness["K"], rel=1e-6)


def test_only_methods_that_merge_take_several_trials():
    parts = [simulate(seed=seed, duration=8.0) for seed in range(3)]
    for name, method in METHODS.items():
        assert method.merges or name not in {*MEMBERS, "riv", "riv-tv"}
        if not method.merges:
            with pytest.raises(DataError, match=f"^{name} identifies one trial at a time"):
                method(parts)
    with pytest.raises(DataError, match="options are selected on one trial at a time"):
        identify(parts, "pr-moesp", select={"order": [1, 2]})
    with pytest.raises(DataError, match="no trials"):
        identify([], "pi-moesp")
    slower = simulate(seed=3, duration=8.0, recording_rate=500.0)
    with pytest.raises(DataError, match="trial 4 of 4 has 500 Hz, the first one 1000 Hz"):
        identify([*parts, slower], "riv")
