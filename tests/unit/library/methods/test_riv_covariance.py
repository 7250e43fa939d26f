"""Intervals of `riv` where the model is incomplete."""

import sys

import numpy as np
import pytest
from scipy import stats

from ankleloop import identify, simulate
from ankleloop.assessment.scores import parameter_row
from ankleloop.joint.prepared import prepare
from ankleloop.methods.riv.covariance import robust_covariance, time_scores
from ankleloop.methods.riv.equations import Equations
from ankleloop.methods.riv.search import solve

NAMES = ("K", "B", "I", "G", "omega_n", "zeta")
INCOMPLETE = {"reflex_threshold": 0.6, "snr_db": 30.0, "voluntary": 0.01, "duration": 20.0}


def solve_trial(trial, weighting="noise"):
    trial = prepare(trial)
    regressors = trial.regressors(
        delay=0.04, basis="rectifier", identification_rate=100.0, reference="reference"
    )
    equations = Equations([trial], [regressors], weighting)
    return solve(equations, equations.find_start(2, estimate_delay=False))


def newey_west(scores, lags):
    """Variance of the sum of scores with the Bartlett kernel (Newey and West 1987), lag by lag."""
    total = scores @ scores.T
    for lag in range(1, lags):
        product = scores[:, lag:] @ scores[:, :-lag].T
        total += (1.0 - lag / lags) * (product + product.T)
    return total


def test_scores_sum_to_the_left_side():
    """At the start, where it is not zero; flat weights do not depend on the residual."""
    point = solve_trial(simulate(seed=1, duration=20.0), "flat").points[0]
    np.testing.assert_allclose(time_scores(point).sum(axis=1), point.side, rtol=1e-9)


def test_the_variance_of_the_sum_against_another_estimator():
    """The slope of the equations is the same in both, so that what is compared is the variance of the left side."""
    solution = solve_trial(simulate(seed=1, **INCOMPLETE | {"duration": 100.0}), "flat")
    covariance, freedom = robust_covariance(solution.point, solution.free)
    assert freedom > 90
    inverse = np.linalg.inv(solution.point.slope)
    expected = inverse @ newey_west(time_scores(solution.point), 100) @ inverse.T
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), np.sqrt(np.diag(expected)), rtol=0.25)


def test_both_kinds_agree_where_the_model_is_complete():
    trials = [simulate(seed=seed, duration=30.0) for seed in range(12)]
    ratios = []
    for solution in map(solve_trial, trials):
        robust, _ = robust_covariance(solution.point, solution.free)
        ratios.append(np.diag(robust) / np.diag(solution.point.covariance(solution.free)))
    np.testing.assert_allclose(np.sqrt(np.mean(ratios, axis=0)), 1.0, atol=0.12)


def test_robust_errors_are_the_scatter_of_incomplete_models():
    """With little noise the scatter is that of the misfit, which the movement makes."""
    estimates = [identify(simulate(seed=seed, **INCOMPLETE), "riv") for seed in range(40)]
    assert {estimate.diagnostics["intervals"] for estimate in estimates} == {"robust"}
    values = np.array([[(e.stiffness | e.reflex)[name] for name in NAMES] for e in estimates])
    errors = np.array(
        [[e.diagnostics["standard_errors"][name] for name in NAMES] for e in estimates]
    )
    ratios = np.sqrt(np.mean(errors**2, axis=0)) / np.std(values, axis=0, ddof=1)
    assert np.all((ratios > 0.7) & (ratios < 1.4)), dict(zip(NAMES, ratios, strict=True))


def test_the_movement_decides():
    complete, incomplete = (
        identify(simulate(seed=2, **settings), "riv") for settings in ({}, INCOMPLETE)
    )
    assert complete.diagnostics["movement_p"] > 0.01 > incomplete.diagnostics["movement_p"]
    assert complete.diagnostics["intervals"] == "asymptotic"
    (low, high), error = incomplete.intervals["B"], incomplete.diagnostics["standard_errors"]["B"]
    assert (incomplete.diagnostics["intervals"], (high - low) / (2 * error) > 2.0) == (
        "robust",
        True,
    )


def test_false_alarms():
    """The test may see a movement in one complete model of a hundred."""
    alarms = sum(
        solve_trial(simulate(seed=seed, duration=15.0)).point.movement_p < 0.05
        for seed in range(40)
    )
    assert alarms <= 7


def correlation_probability(point, signal):
    """Of correlations of a whitened residual and a whitened signal at lags within ± 0.5 s, summed lag by lag."""
    band = point.equations.band
    white = signal / np.sqrt(band.smooth(np.abs(signal) ** 2, 1.0))
    products = point.residual / np.sqrt(point.noise) * white.conj()
    interval = 0.5 * band.samples / band.rate / (band.parts[0].bins.start + band.frequency.size)
    lags = interval * np.arange(-int(0.5 / interval), int(0.5 / interval) + 1)
    sums = [np.sum(products * np.exp(2j * np.pi * band.frequency * lag)).real for lag in lags]
    energy = np.sum(np.square(sums)) / (0.5 * band.frequency.size * band.correlation)
    return stats.chi2.sf(energy, lags.size)


@pytest.mark.parametrize("settings", [{"duration": 15.0}, {"snr_db": None, "voluntary": 0.5}])
def test_the_smaller_of_two_probabilities_counts_twice(settings):
    point = solve_trial(simulate(seed=1, **settings)).point
    position, *_ = predicted = point.equations.predicted
    drive = point.parameters.linear[3] * predicted[3]
    smaller = min(correlation_probability(point, signal) for signal in (position, drive))
    assert 1e-6 < smaller < 0.5
    assert point.movement_p == pytest.approx(2.0 * smaller, rel=1e-6)


@pytest.mark.parametrize("kind", ["asymptotic", "robust"])
def test_the_kind_is_an_option(kind):
    trial = simulate(seed=1, duration=20.0)
    estimate = identify(trial, "riv", intervals=kind)
    assert estimate.diagnostics["intervals"] == kind
    assert parameter_row(trial, estimate)["intervals"] == kind
    with pytest.raises(ValueError, match=r"^method 'riv': intervals must be one of"):
        identify(trial, "riv", intervals="exact")


def test_what_drifts_over_the_record_widens_no_interval(monkeypatch):
    """A record that is repeated would drift again: the two slowest cosines are left out."""
    solution = solve_trial(simulate(seed=1, duration=20.0))
    expected, _ = robust_covariance(solution.point, solution.free)
    scores = time_scores(solution.point)
    phase = np.pi * (np.arange(scores.shape[1]) + 0.5) / scores.shape[1]
    drift = scores.std(axis=1, keepdims=True) * (np.cos(phase) - np.cos(2.0 * phase))
    module = sys.modules[robust_covariance.__module__]
    monkeypatch.setattr(module, "time_scores", lambda point: scores + drift)
    covariance, _ = robust_covariance(solution.point, solution.free)
    np.testing.assert_allclose(covariance, expected, rtol=1e-6)
