"""Each step that is left out does what it says, against computations of its own."""

import numpy as np
import pytest
from scipy import linalg

from ankleloop import evaluate, identify
from ankleloop.joint.prepared import prepare
from ankleloop.methods.moesp import OMITTED_STEPS
from ankleloop.signals.decimation import decimate

OPTIONS = {"delay": 0.04, "degree": 5, "identification_rate": 100.0, "reference": "reference"}
ROWS = 15


@pytest.fixture(scope="module")
def trial(noisy):
    return prepare(noisy)


@pytest.mark.parametrize("rate", [100.0, 500.0])
def test_without_derivatives_of_the_kernel_there_are_differences(trial, rate):
    options = OPTIONS | {"basis": "rectifier", "identification_rate": rate}
    complete = trial.regressors(**options)
    position, *motion, drive = trial.regressors(
        **options, omitted_step="kernel-derivatives"
    ).inputs.T
    np.testing.assert_array_equal([position, drive], complete.inputs[:, [0, 3]].T)
    velocity = np.gradient(position, 1 / rate)
    inside = slice(2, -2)  # np.gradient has one-sided differences at the ends
    for signal, expected in zip(motion, (velocity, np.gradient(velocity, 1 / rate)), strict=True):
        np.testing.assert_allclose(
            signal[inside], expected[inside], rtol=0, atol=1e-9 * np.abs(expected).max()
        )
    # At the ends they use positions beyond the other samples: the differences are as good there as anywhere.
    error = np.abs(motion[0] - complete.inputs[:, 1])
    assert error[[0, 1, -2, -1]].max() <= error[inside].max()


@pytest.mark.parametrize("basis", ["chebyshev", "rectifier"])
def test_without_the_early_nonlinearity_it_acts_on_decimated_velocity(trial, basis):
    complete = trial.regressors(**OPTIONS, basis=basis)
    late = trial.regressors(**OPTIONS, basis=basis, omitted_step="early-nonlinearity")
    np.testing.assert_array_equal(late.inputs[:, :3], complete.inputs[:, :3])
    velocity = decimate(trial.velocity(0.04), *complete.grid)
    terms = np.where(velocity > 0, velocity, 0.0)[:, None]
    if basis == "chebyshev":
        terms = np.polynomial.chebyshev.chebvander(
            velocity / np.abs(trial.velocity(0.04)).max(), 5
        )[:, 1:]
    np.testing.assert_allclose(late.inputs[:, 3:], terms, rtol=0, atol=1e-12)
    assert np.abs(late.inputs[:, 3:] - complete.inputs[:, 3:]).max() > 1e-3


def block_rows(signal, first, count):
    """Hankel matrix, written out."""
    columns = len(signal) - 2 * ROWS + 1
    return np.vstack([signal[first + row : first + row + columns].T for row in range(count)])


def test_without_the_rank_policy_it_is_an_ordinary_factorisation(trial):
    """The factorisation of PI-MOESP with the reference in the place of past inputs, as subspace packages have it."""
    estimate = identify(trial, "pr-moesp", basis="rectifier", omitted_step="rank-policy")
    regressors = trial.regressors(**OPTIONS, basis="rectifier")
    u, r, y = (
        (signal - signal.mean(axis=0)) / signal.std(axis=0)
        for signal in (regressors.inputs, regressors.reference[:, None], regressors.torque[:, None])
    )
    stacked = np.vstack(
        [block_rows(u, ROWS, ROWS), block_rows(r, 0, ROWS), block_rows(y, ROWS, ROWS)]
    )
    stacked -= stacked.mean(axis=1, keepdims=True)
    L = linalg.qr(stacked.T, mode="r")[0][: len(stacked)].T
    inputs, instruments = 4 * ROWS, 5 * ROWS
    left = np.linalg.svd(L[instruments:, inputs:instruments])[0][:, :2]
    A = np.linalg.pinv(left[:-1]) @ left[1:]
    poles, expected = (
        np.sort_complex(values) for values in (estimate.diagnostics["poles"], np.linalg.eigvals(A))
    )
    np.testing.assert_allclose(poles, expected, rtol=0, atol=1e-5)
    assert estimate.diagnostics["rank"] == inputs
    assert identify(trial, "pr-moesp", basis="rectifier").diagnostics["rank"] < inputs


@pytest.mark.parametrize("step", OMITTED_STEPS)
@pytest.mark.parametrize("method", ["pr-moesp", "eiv-moesp"])
def test_estimates_say_so_and_predict_alike(trial, method, step):
    complete = identify(trial, method)
    estimate = identify(trial, method, omitted_step=step)
    assert any(f"omitted_step: {step}" in text for text in estimate.diagnostics["warnings"])
    assert not any("omitted_step" in text for text in complete.diagnostics["warnings"])
    assert estimate.stiffness != complete.stiffness
    # The same trial: torques differ by the initial state alone, which dies away within the trim of a second.
    again, first = (
        evaluate(trial, part)["vaf"].to_numpy() for part in (estimate.predict(trial), estimate)
    )
    np.testing.assert_allclose(again, first, rtol=0, atol=0.05)
