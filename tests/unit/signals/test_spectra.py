"""Spectra, exact discretisation, reflex dynamics and prediction, against independent truths."""

import numpy as np
import pytest
from scipy import signal as sps

from ankleloop import DataError
from ankleloop.joint.dynamics import ReflexDynamics
from ankleloop.joint.reference_response import explained_by, finite_response, share_explained
from ankleloop.signals.discretisation import held_linearly, step_matrices
from ankleloop.signals.spectra import Band, smoothed
from ankleloop.subspace.input_matrices import response


def test_white_noise_has_the_density_of_its_variance():
    rng = np.random.default_rng(1)
    band = Band(20_000, 100.0, 1.0, 40.0)
    power = np.abs(band.transform(rng.standard_normal(20_000))) ** 2 / band.density
    assert power.mean() == pytest.approx(2 / 100.0, rel=0.03)
    assert band.frequency[0] >= 1.0
    assert band.frequency[-1] <= 40.0


def test_the_taper_keeps_drift_out_of_other_frequencies():
    band = Band(5000, 100.0, 5.0, 38.0)
    drift = np.linspace(-1.0, 1.0, 5000)
    assert np.abs(band.transform(drift)).max() < 1e-3 * np.abs(np.fft.rfft(drift)).max()


def test_correlation_is_how_much_the_taper_costs():
    """The variance of a mean over frequencies, measured, against the factor that is said."""
    rng = np.random.default_rng(2)
    band = Band(1000, 100.0, 1.0, 40.0)
    means = [np.mean(np.abs(band.transform(rng.standard_normal(1000))) ** 2) for _ in range(2000)]
    expected = np.mean(means) ** 2 / band.frequency.size * band.correlation
    assert np.var(means) == pytest.approx(expected, rel=0.15)


def test_smoothing_keeps_levels_and_slopes():
    assert smoothed(np.full(100, 3.0), 10) == pytest.approx(np.full(100, 3.0))
    line = smoothed(np.arange(100.0), 10)
    assert line[20:80] == pytest.approx(np.arange(20.0, 80.0))


def test_one_step_against_an_adaptive_solver():
    from scipy.integrate import solve_ivp

    A, B = np.array([[0.0, 1.0], [-900.0, -20.0]]), np.array([[0.0], [900.0]])
    F, before, after = step_matrices(A, B, 0.02)
    start, u0, u1 = np.array([0.3, -2.0]), 0.7, -0.4
    exact = solve_ivp(
        lambda t, x: A @ x + B[:, 0] * (u0 + (u1 - u0) * t / 0.02), (0, 0.02), start, rtol=1e-10, atol=1e-12
    ).y[:, -1]
    np.testing.assert_allclose(F @ start + before[:, 0] * u0 + after[:, 0] * u1, exact, rtol=1e-7)


def test_matrices_against_scipy():
    dynamics = ReflexDynamics(40.0, 0.8)
    u = np.random.default_rng(3).standard_normal(500)
    num, den, _ = sps.cont2discrete(([1600.0], [1.0, 64.0, 1600.0]), 0.01, method="foh")
    np.testing.assert_allclose(
        response(*dynamics.matrices(100.0), u[:, None])[:, 0], sps.lfilter(num.ravel(), den, u), atol=1e-9
    )
    A, B, C, D = held_linearly(np.array([[-2.0]]), np.array([[2.0]]), np.eye(1), 0.1)
    assert (C @ np.linalg.solve(np.eye(1) - A, B) + D).item() == pytest.approx(1.0)  # gain at rest


@pytest.mark.parametrize("values", [(35.0, 0.9), (35.0, 0.9, 60.0)])
def test_derivatives_of_the_dynamics_against_differences(values):
    s = 2j * np.pi * np.linspace(0.1, 38.0, 50)
    here, derivatives = ReflexDynamics(*values).response(s)
    for step, derivative in zip(1e-6 * np.eye(len(values)), derivatives, strict=True):
        there = ReflexDynamics(*values).moved(step).response(s)[0]
        np.testing.assert_allclose((there - here) / 1e-6, derivative, rtol=1e-4)


def test_a_third_pole_against_scipy():
    u = np.random.default_rng(3).standard_normal(500)
    denominator = np.polymul([1.0, 64.0, 1600.0], [1.0, 30.0])
    num, den, _ = sps.cont2discrete(([48000.0], denominator), 0.01, method="foh")
    np.testing.assert_allclose(
        response(*ReflexDynamics(40.0, 0.8, 30.0).matrices(100.0), u[:, None])[:, 0],
        sps.lfilter(num.ravel(), den, u),
        atol=1e-9,
    )


def test_a_finite_response_is_found_in_coloured_noise():
    rng = np.random.default_rng(4)
    x = sps.lfilter([1.0], [1.0, -0.8], rng.standard_normal(20_000))
    truth = np.array([0.0, 0.2, 1.0, 0.5, -0.3, 0.1])  # from one sample ahead to four behind
    y = np.convolve(x, truth)[1 : 1 + x.size] + 10 * sps.lfilter([0.02], [1.0, -0.98], rng.standard_normal(20_000))
    found = finite_response(y, x, 100.0, leads=0.01, lags=0.04)
    np.testing.assert_allclose(found, truth, atol=0.1)
    with pytest.raises(DataError, match="too short for a response"):
        finite_response(y[:20], x[:20], 100.0)


def test_what_is_explained_keeps_its_time():
    rng = np.random.default_rng(5)
    source = sps.sosfiltfilt(sps.butter(4, 10.0, fs=1000.0, output="sos"), rng.standard_normal(40_000))
    delayed = np.roll(source, 70)
    grid = (10, 500, 3800)
    explained = explained_by(delayed[500:38_500:10], source, grid, 1000.0)
    middle = slice(2000, -3000)
    assert np.std((explained - delayed + delayed.mean())[middle]) < 0.02 * np.std(delayed)
    share = share_explained(delayed[500:38_500:10], source[500:38_500:10], 100.0)
    assert share > 0.95
    assert share_explained(rng.standard_normal(3800), source[500:38_500:10], 100.0) < 0.05
