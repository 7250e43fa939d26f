"""The real-time algorithm: exact for perturbations that decorrelate the paths, biased for others."""

import numpy as np
import pytest

import ankleloop
from ankleloop import identify, new_trial, simulate
from ankleloop.methods.real_time import _track

QUIET = {
    "snr_db": None,
    "voluntary": 0.0,
    "closed_loop": False,
    "duration": 60.0,
    "reflex_gain": 5.0,
}


@pytest.fixture(scope="module")
def means():
    """Means over seeds for a decorrelating perturbation and for a PRBS, in open loop without noise."""
    values = {}
    for perturbation in ("pulses", "prbs"):
        estimates = [
            identify(
                simulate(seed=seed, perturbation=perturbation, switching_interval=0.2, **QUIET),
                "real-time",
            )
            for seed in range(4)
        ]
        values[perturbation] = {
            name: np.mean([e.stiffness[name] for e in estimates]) for name in "KBI"
        }
        values[perturbation]["G"] = np.mean([e.reflex["G"] for e in estimates])
    return values


def test_a_decorrelating_perturbation_gives_the_truth_and_a_prbs_a_bias(means):
    for name, truth, accuracy in (
        ("K", 150.0, 0.03),
        ("B", 0.8, 0.05),
        ("I", 0.015, 0.05),
        ("G", 5.0, 0.05),
    ):
        assert means["pulses"][name] == pytest.approx(truth, rel=accuracy)
    assert means["prbs"]["K"] > 1.05 * 150.0


def test_information_form_is_weighted_least_squares():
    """With forgetting, the parameters known at a time are those of exponentially weighted least squares of the past."""
    rng = np.random.default_rng(1)
    inputs, forgetting, chunk = rng.standard_normal((200, 2)), 0.97, 10
    target = inputs @ [2.0, -3.0] + 0.7 + 0.1 * rng.standard_normal(200)
    _, parameters = _track(inputs, target, forgetting, chunk, 0)
    for k in (5, 12, 19):
        past = slice(0, k * chunk)
        weights = np.sqrt(forgetting ** np.arange(k * chunk)[::-1])
        phi = np.column_stack([inputs, np.ones(200)])[past]
        expected = np.linalg.lstsq(phi * weights[:, None], target[past] * weights, rcond=None)[0]
        np.testing.assert_allclose(parameters[k], expected[:2], rtol=1e-6)


def test_predictions_depend_on_the_past_only():
    rng = np.random.default_rng(2)
    inputs = rng.standard_normal((300, 2))
    target = inputs @ [1.0, 2.0]
    before, _ = _track(inputs, target, 0.99, 10, 50)
    target[200:] = 1e3  # the future changes
    after, _ = _track(inputs, target, 0.99, 10, 50)
    np.testing.assert_array_equal(before[:200], after[:200])


def test_the_trace_follows_a_joint_that_changes():
    """Of two records end to end the second has half the stiffness."""
    first, second = (
        simulate(seed=seed, perturbation="pulses", switching_interval=0.2, stiffness=k, **QUIET)
        for seed, k in ((1, 150.0), (2, 75.0))
    )
    joined = new_trial(
        np.concatenate([first["position"], second["position"]]),
        np.concatenate([first["torque"], second["torque"]]),
        1000.0,
    )
    traces = identify(joined, "real-time", memory=5.0).diagnostics
    time, k = traces["trace_time"], traces["trace_K"]
    assert k[(time > 40) & (time < 59)].mean() == pytest.approx(150.0, rel=0.05)
    assert k[(time > 100) & (time < 119)].mean() == pytest.approx(75.0, rel=0.08)
    assert {len(traces[f"trace_{name}"]) for name in "KBIG"} == {len(time)}


def test_torque_covers_the_record_and_means_exclude_the_settling_time():
    trial = simulate(seed=1, perturbation="pulses", switching_interval=0.2, **QUIET)
    estimate = identify(trial, "real-time", settling=20.0)
    time, k = estimate.diagnostics["trace_time"], estimate.diagnostics["trace_K"]
    start = float(estimate.torque["time"][0])
    assert estimate.stiffness["K"] == pytest.approx(k[time >= start + 20.0].mean(), rel=1e-9)
    assert estimate.torque.sizes["time"] > 5_900
    scores = ankleloop.evaluate(trial, estimate).set_index(["torque", "against"])["vaf"]
    assert (scores > 95).all()
