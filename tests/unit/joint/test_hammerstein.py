"""Nonlinearity and dynamics, separated: exact where a model is of that kind, and close where a basis is not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ankleloop import DataError, identify, simulate
from ankleloop.joint.basis import fit_basis
from ankleloop.joint.dynamics import ReflexDynamics, fit_dynamics
from ankleloop.joint.hammerstein import StaticNonlinearity, response_gain, separate
from ankleloop.subspace.input_matrices import response
from ankleloop.subspace.matrices import Matrices

RATE = 100.0


def white_below(rng, samples, highest):
    """Noise without anything above a frequency [Hz]."""
    spectrum = np.fft.rfft(rng.standard_normal(samples))
    spectrum[np.fft.rfftfreq(samples, 1 / RATE) > highest] = 0
    return np.fft.irfft(spectrum, samples)


@settings(max_examples=20, deadline=None)
@given(st.floats(12.0, 60.0), st.floats(0.4, 1.6), st.floats(0.5, 20.0))
def test_a_low_pass_is_found_in_its_own_response(omega, zeta, gain):
    s = 2j * np.pi * np.linspace(0.1, 38.0, 300)
    found, dynamics, share = fit_dynamics(gain * ReflexDynamics(omega, zeta).response(s)[0], s, np.ones(300))
    assert found == pytest.approx(gain, rel=1e-4)
    assert (dynamics.omega_n, dynamics.zeta) == pytest.approx((omega, zeta), rel=1e-4)
    assert share == pytest.approx(1.0, abs=1e-7)


@settings(max_examples=15, deadline=None)
@given(st.integers(2, 6), st.integers(0, 1000))
def test_a_hammerstein_system_is_separated_exactly(terms, seed):
    """Coefficients are proportional to those that made the model, whatever the basis functions are correlated with."""
    rng = np.random.default_rng(seed)
    velocity = white_below(rng, 4000, 20.0)
    basis = fit_basis(velocity, "chebyshev", terms)
    truth = rng.standard_normal(terms)
    A, b, C, d = ReflexDynamics(30.0, 0.7).matrices(RATE)
    matrices = Matrices(A, b * truth, C, d * truth, 1 / RATE)
    path = separate(matrices, basis(velocity).T, basis)
    np.testing.assert_allclose(path.nonlinearity.coefficients, truth, rtol=0.03)
    assert path.rank_one == pytest.approx(1.0, abs=1e-9)
    assert path.dynamics.omega_n == pytest.approx(30.0, rel=0.05)


def test_what_is_not_one_system_is_told():
    rng = np.random.default_rng(1)
    inputs = rng.standard_normal((4000, 2))
    basis = fit_basis(inputs[:, 0], "chebyshev", 2)
    slow, fast = (ReflexDynamics(omega, 0.7).matrices(RATE) for omega in (10.0, 60.0))
    A = np.block([[slow[0], np.zeros((2, 2))], [np.zeros((2, 2)), fast[0]]])
    B = np.block([[slow[1], np.zeros((2, 1))], [np.zeros((2, 1)), fast[1]]])
    C, D = np.hstack([slow[2], fast[2]]), np.hstack([slow[3], fast[3]])
    assert separate(Matrices(A, B, C, D, 1 / RATE), inputs, basis).rank_one < 0.95
    with pytest.raises(DataError, match="no reflex torque"):
        separate(Matrices(A, 0 * B, C, 0 * D, 1 / RATE), inputs, basis)


@pytest.mark.parametrize("threshold", [-0.4, 0.0, 0.7])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_threshold_is_found(threshold, sign):
    velocity = np.random.default_rng(2).standard_normal(20_000)
    basis = fit_basis(velocity, "spline", 20)
    torque = sign * 5.0 * np.maximum(velocity - threshold, 0.0)
    design = basis(velocity)
    coefficients = np.linalg.lstsq(design.T - design.mean(axis=1), torque - torque.mean(), rcond=None)[0]
    gain, found, share = StaticNonlinearity(basis, coefficients).rectifier()
    assert gain == pytest.approx(5.0 * sign, rel=0.02)
    assert found == pytest.approx(threshold, abs=0.03)
    assert share > 0.999


def test_the_response_of_the_parallel_cascade():
    drive = np.maximum(white_below(np.random.default_rng(3), 4000, 20.0), 0.0)
    impulse = np.zeros(60)
    impulse[0] = 1.0
    taps = response(*ReflexDynamics(40.0, 1.0).matrices(RATE), impulse[:, None])[:, 0]
    path = response_gain(7.0 * taps, drive, RATE, fit_basis(drive, "rectifier", 1))
    assert path.parameters["G"] == pytest.approx(7.0, rel=0.05)
    assert path.parameters["omega_n"] == pytest.approx(40.0, rel=0.05)


@pytest.mark.parametrize(
    ("method", "options", "accuracy"),
    [
        ("pr-moesp", {"basis": "rectifier"}, 0.003),
        ("pr-moesp", {"basis": "spline", "degree": 8}, 0.005),
        ("eiv-moesp", {"basis": "rectifier"}, 0.01),
        ("parallel-cascade", {}, 0.01),
    ],
)
def test_methods_without_noise_find_the_physical_parameters(method, options, accuracy):
    estimate = identify(simulate(seed=1, snr_db=None, voluntary=0.0), method, **options)
    for name, truth in (("G", 13.0), ("omega_n", 40.0), ("zeta", 1.0)):
        assert estimate.reflex[name] == pytest.approx(truth, rel=accuracy), name
    curve = estimate.diagnostics["nonlinearity"]
    straight = 13.0 * np.maximum(curve["velocity"], 0.0)
    # A spline rounds the corner.
    np.testing.assert_allclose(curve["torque"], straight, atol=0.05 * np.ptp(straight))
    assert estimate.diagnostics["separation"]["rank_one"] > 0.9999


def test_a_third_pole_is_reported():
    trial = simulate(seed=1, zeta=0.7, pole=50.0, snr_db=None, voluntary=0.0)
    found = identify(trial, "pr-moesp", basis="rectifier", order=3).reflex
    assert found["pole"] == pytest.approx(50.0, rel=0.05)
    assert found["omega_n"] == pytest.approx(40.0, rel=0.03)
