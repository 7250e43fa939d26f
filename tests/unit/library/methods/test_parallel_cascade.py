"""The parallel cascade against alternating least squares with explicit matrices of lagged inputs."""

import numpy as np
import pytest

from ankleloop import DataError, evaluate, identify
from ankleloop.joint.prepared import prepare
from ankleloop.methods import parallel_cascade

LEADS, LAGS = 4, 50  # ± 40 ms and 0 … 0.5 s at 100 Hz


def evaluate_vaf(trial, estimate):
    return evaluate(trial, estimate).set_index(["torque", "against"])["vaf"]


class LaggedInputs:
    """Lagged position and rectified velocity, and the torque, all centred."""

    def __init__(self, trial):
        regressors = prepare(trial).regressors(
            delay=0.04, basis="rectifier", identification_rate=100.0
        )
        rows = range(LAGS, regressors.torque.size - LEADS)
        shifts = np.arange(-LEADS, LEADS + 1), np.arange(LAGS + 1), np.zeros(1, dtype=int)
        signals = zip((*regressors.inputs.T[[0, 3]], regressors.torque), shifts, strict=True)
        lagged = [np.array([signal[t - lags] for t in rows]) for signal, lags in signals]
        self.intrinsic, self.reflex, torque = (part - part.mean(axis=0) for part in lagged)
        self.torque, self.time = torque[:, 0], regressors.time[rows]

    @staticmethod
    def fit(lags, target):
        return np.linalg.lstsq(lags, target, rcond=None)[0]

    def net_vaf(self, residual):
        return 100 * (1 - residual @ residual / (self.torque @ self.torque))


@pytest.fixture(scope="module")
def cascades(clean, noisy):
    return {
        name: (trial, LaggedInputs(trial))
        for name, trial in (("clean", clean[13.0]), ("noisy", noisy))
    }


@pytest.mark.parametrize("record", ["clean", "noisy"])
def test_the_parallel_cascade_converges_to_joint_least_squares(cascades, record):
    trial, lagged = cascades[record]
    both = lagged.fit(
        np.hstack([lagged.intrinsic, lagged.reflex]), lagged.torque
    )  # without alternation
    intrinsic, reflex = np.split(both, [2 * LEADS + 1])
    best = lagged.net_vaf(lagged.torque - lagged.intrinsic @ intrinsic - lagged.reflex @ reflex)
    estimate = identify(trial, "parallel-cascade")
    assert estimate.diagnostics["converged"]
    assert (
        0 <= best - estimate.diagnostics["history"][-1] < 1e-3
    )  # the default tolerance, in points
    fine = identify(trial, "parallel-cascade", tolerance=1e-12)
    assert best == pytest.approx(fine.diagnostics["history"][-1], abs=1e-9)
    np.testing.assert_allclose(fine.torque["intrinsic"], lagged.intrinsic @ intrinsic, atol=2e-4)
    np.testing.assert_allclose(fine.torque["reflex"], lagged.reflex @ reflex, atol=2e-4)
    np.testing.assert_allclose(fine.torque["time"], lagged.time, rtol=1e-14)


@pytest.mark.parametrize("record", ["clean", "noisy"])
@pytest.mark.parametrize("passes", [1, 3])
def test_passes_of_the_parallel_cascade(cascades, record, passes):
    """Intrinsic first, then reflex, each by ordinary least squares."""
    trial, lagged = cascades[record]
    reflex, history = np.zeros_like(lagged.torque), []
    for _ in range(passes):
        intrinsic_response = lagged.fit(lagged.intrinsic, lagged.torque - reflex)
        intrinsic = lagged.intrinsic @ intrinsic_response
        reflex_response = lagged.fit(lagged.reflex, lagged.torque - intrinsic)
        reflex = lagged.reflex @ reflex_response
        history.append(lagged.net_vaf(lagged.torque - intrinsic - reflex))
    estimate = identify(trial, "parallel-cascade", max_passes=passes)
    diagnostics = estimate.diagnostics
    assert diagnostics["passes"] == len(diagnostics["history"]) == passes
    assert not diagnostics["converged"]
    negative = [
        f"{name} = " for name, value in estimate.stiffness.items() if value < 0
    ]  # biased in closed loop
    assert [text[:4] for text in diagnostics["warnings"]] == negative
    np.testing.assert_allclose(diagnostics["history"], history, atol=1e-9)
    np.testing.assert_allclose(estimate.torque["intrinsic"], intrinsic, atol=1e-8)
    np.testing.assert_allclose(estimate.torque["reflex"], reflex, atol=1e-8)
    model = estimate.predictor
    for found, response in ((model.intrinsic, intrinsic_response), (model.reflex, reflex_response)):
        np.testing.assert_allclose(found, response, rtol=1e-6, atol=1e-6 * np.max(np.abs(response)))
    np.testing.assert_allclose(model.lags()["intrinsic_lag"], np.arange(-LEADS, LEADS + 1) / 100)
    np.testing.assert_allclose(model.lags()["reflex_lag"], np.arange(LAGS + 1) / 100)


def test_convergence_that_is_not_reached_is_a_warning(noisy, monkeypatch):
    monkeypatch.setattr(parallel_cascade, "PASS_CEILING", 3)
    diagnostics = identify(noisy, "parallel-cascade", tolerance=0.0).diagnostics
    assert (diagnostics["passes"], diagnostics["converged"]) == (3, False)
    assert diagnostics["warnings"][0] == "no convergence within 3 passes"


def test_the_first_pass_is_biased_in_closed_loop_and_the_last_one_not(clean):
    first = evaluate_vaf(clean[13.0], identify(clean[13.0], "parallel-cascade", max_passes=1))
    assert first["intrinsic", "true"] < 70
    assert first["reflex", "true"] < 75
    estimate = identify(clean[13.0], "parallel-cascade", tolerance=1e-6)
    gains = np.diff(estimate.diagnostics["history"])
    assert np.all(gains[:-1] >= 1e-6)
    assert 0 < gains[-1] < 1e-6
    assert evaluate_vaf(clean[13.0], estimate).min() >= 99.9


def test_responses_longer_than_the_record_are_refused(noisy):
    with pytest.raises(
        DataError, match=r"leaves \d+ samples for 510 unknowns: record longer or shorten"
    ):
        identify(noisy.isel(time=slice(0, 10_000)), "parallel-cascade", reflex_lags=5.0)
