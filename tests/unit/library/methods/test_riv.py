"""Refined instrumental variables: unbiased in closed loop, with intervals that hold the truth."""

import numpy as np
import pytest

from ankleloop import evaluate, identify, simulate
from ankleloop.methods.riv import search

TRUTH = {"K": 150.0, "B": 0.8, "I": 0.015, "omega_n": 40.0, "zeta": 1.0}
COMPLIANT = {"load": (0.1, 10.0, 100.0), "reflex_gain": 25.0, "voluntary": 0.3}


def parameters(estimate):
    return estimate.stiffness | estimate.reflex


@pytest.fixture(scope="module")
def compliant():
    """Trials against a very compliant load, and their estimates."""
    trials = [simulate(seed=seed, **COMPLIANT) for seed in range(12)]
    return trials, [identify(trial, "riv") for trial in trials]


@pytest.mark.parametrize("gain", [2.0, 13.0])
def test_the_truth_without_noise(clean, gain):
    """In the parameters of the model as well: poles are those of the dynamics, the gain at rest is G."""
    estimate = identify(clean[gain], "riv")
    assert parameters(estimate) == pytest.approx(TRUTH | {"G": gain, "delay": 0.04}, rel=3e-3)
    assert estimate.diagnostics["converged"]
    np.testing.assert_allclose(estimate.model.D[0, :3], list(estimate.stiffness.values()))
    assert estimate.model.dcgain()[0, 3] == pytest.approx(estimate.reflex["G"], rel=1e-9)


def test_feedback_does_not_bias_the_estimates(compliant):
    """Least squares is biased on the same trials."""
    trials, estimates = compliant
    means = {name: np.mean([parameters(e)[name] for e in estimates]) for name in (*TRUTH, "G")}
    for name, truth in (TRUTH | {"G": 25.0}).items():
        spread = np.std([parameters(e)[name] for e in estimates], ddof=1) / np.sqrt(len(estimates))
        assert abs(means[name] - truth) < 0.02 * truth + 3 * spread, name
    vaf = [
        evaluate(t, e).query("against == 'true'")["vaf"].min()
        for t, e in zip(trials, estimates, strict=True)
    ]
    assert np.mean(vaf) > 99.7
    biased = [identify(trial, "pr-moesp", basis="rectifier").stiffness["K"] for trial in trials[:4]]
    assert np.mean(biased) < 0.9 * 150.0


def test_intervals_are_as_wide_as_the_scatter_of_estimates(compliant):
    _, estimates = compliant
    for name in ("K", "B", "I", "G", "omega_n", "zeta"):
        scatter = np.std([parameters(e)[name] for e in estimates], ddof=1)
        half = np.median([0.5 * np.ptp(e.intervals[name]) for e in estimates]) / 1.96
        assert 0.5 < half / scatter < 2.0, name
        assert all(
            low < parameters(e)[name] < high for e in estimates for low, high in [e.intervals[name]]
        )
    inside = [low <= TRUTH["K"] <= high for e in estimates for low, high in [e.intervals["K"]]]
    assert np.mean(inside) > 0.7


def test_the_delay_can_be_estimated():
    delays = [
        parameters(identify(simulate(seed=seed, delay=delay), "riv", delay=None))["delay"]
        for seed, delay in ((1, 0.04), (2, 0.052))
    ]
    np.testing.assert_allclose(delays, [0.04, 0.052], atol=0.002)


def test_records_in_open_loop():
    trial = simulate(seed=1, closed_loop=False, voluntary=0.3)
    for reference in ("reference", "position"):
        values = parameters(identify(trial, "riv", reference=reference))
        assert values["K"] == pytest.approx(150.0, rel=0.05)
        assert values["G"] == pytest.approx(13.0, rel=0.1)


def test_other_bases_have_the_same_dynamics(clean):
    """A polynomial of degree 8 is nearly a rectifier; a spline differs from it near the corner only."""
    trial = clean[13.0]
    for basis, degree, accuracy in (("chebyshev", 8, 0.05), ("spline", 10, 0.01)):
        estimate = identify(trial, "riv", basis=basis, degree=degree)
        assert estimate.stiffness["K"] == pytest.approx(150.0, rel=0.6 * accuracy)
        assert estimate.reflex["omega_n"] == pytest.approx(40.0, rel=accuracy)
        assert estimate.reflex["G"] == pytest.approx(13.0, rel=accuracy)
        assert estimate.reflex["threshold"] == pytest.approx(0.0, abs=0.5 * accuracy)
        assert {"G", "threshold"} <= set(estimate.intervals)
        assert estimate.model.D.shape == (1, 3 + degree)
        assert basis == "chebyshev" or evaluate(trial, estimate)["vaf"].min() >= 99.99


def test_a_third_pole():
    """Three real poles can be split into two and one in any way, so all three are compared."""
    truth = np.sort([40.0 * (0.8 + 0.6j), 40.0 * (0.8 - 0.6j), 70.0])
    trial = simulate(seed=1, zeta=0.8, pole=70.0, snr_db=None, voluntary=0.0)
    estimate = identify(trial, "riv", order=3)
    omega_n, zeta, pole = (estimate.reflex[name] for name in ("omega_n", "zeta", "pole"))
    poles = omega_n * (zeta + np.array([1j, -1j]) * np.sqrt(1 - zeta**2))
    np.testing.assert_allclose(np.sort([*poles, pole]), truth, rtol=0.02)
    assert estimate.model.A.shape == (3, 3)
    low, high = identify(simulate(seed=1, zeta=0.8, pole=70.0), "riv", order=3).intervals["pole"]
    assert low < 70.0 < high


def test_missing_convergence_is_a_warning(monkeypatch):
    monkeypatch.setattr(search, "MOST_ITERATIONS", 1)
    monkeypatch.setattr(search, "MOST_REFINEMENTS", 1)
    monkeypatch.setattr(search, "TOLERANCE", 1e-9)
    estimate = identify(simulate(seed=1, duration=20.0), "riv")
    assert not estimate.diagnostics["converged"]
    assert "not converged after " in estimate.diagnostics["warnings"][0]
    assert (estimate.intervals, estimate.diagnostics["standard_errors"]) == ({}, {})
    assert estimate.diagnostics["intervals"] is None
