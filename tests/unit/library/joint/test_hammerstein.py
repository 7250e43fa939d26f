"""Separation of nonlinearity and dynamics: exact for a Hammerstein system, and close where a basis approximates it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ankleloop import DataError, identify, simulate
from ankleloop.joint.bases import BASES
from ankleloop.joint.dynamics import ReflexDynamics
from ankleloop.joint.hammerstein import DriveSpectra, ReflexPath, separate_path
from ankleloop.subspace.matrices import Matrices

RATE = 100.0


def band_limited_noise(rng, samples, highest):
    """Noise without power above a frequency [Hz]."""
    spectrum = np.fft.rfft(rng.standard_normal(samples))
    spectrum[np.fft.rfftfreq(samples, 1 / RATE) > highest] = 0
    return np.fft.irfft(spectrum, samples)


@settings(max_examples=15, deadline=None)
@given(st.integers(2, 6), st.integers(0, 1000))
def test_a_hammerstein_system_is_separated_exactly(terms, seed):
    """Coefficients are those of the system, whatever the correlation of the basis functions."""
    rng = np.random.default_rng(seed)
    velocity = band_limited_noise(rng, 4000, 20.0)
    basis = BASES["chebyshev"].fit(velocity, terms)
    truth = rng.standard_normal(terms)
    A, b, C, d = ReflexDynamics(30.0, 0.7).matrices(RATE)
    matrices = Matrices(A, b * truth, C, d * truth, 1 / RATE)
    spectra = DriveSpectra.of(basis(velocity).T, RATE)
    path = separate_path(matrices.frequency_response(np.exp(spectra.s / RATE)), spectra, basis)
    np.testing.assert_allclose(path.coefficients, truth, rtol=0.03)
    assert path.rank_one == pytest.approx(1.0, abs=1e-9)
    assert path.dynamics.omega_n == pytest.approx(30.0, rel=0.05)


def test_two_systems_have_a_low_rank_one_share():
    rng = np.random.default_rng(1)
    inputs = rng.standard_normal((4000, 2))
    basis, spectra = BASES["chebyshev"].fit(inputs[:, 0], 2), DriveSpectra.of(inputs, RATE)
    slow, fast = (ReflexDynamics(omega, 0.7).matrices(RATE) for omega in (10.0, 60.0))
    A = np.block([[slow[0], np.zeros((2, 2))], [np.zeros((2, 2)), fast[0]]])
    B = np.block([[slow[1], np.zeros((2, 1))], [np.zeros((2, 1)), fast[1]]])
    C, D = np.hstack([slow[2], fast[2]]), np.hstack([slow[3], fast[3]])
    responses = Matrices(A, B, C, D).frequency_response(np.exp(spectra.s / RATE))
    assert separate_path(responses, spectra, basis).rank_one < 0.95
    with pytest.raises(DataError, match="no reflex torque"):
        separate_path(0 * responses, spectra, basis)


@pytest.mark.parametrize("threshold", [-0.4, 0.0, 0.7])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_gain_and_threshold_of_a_rectifier(threshold, sign):
    velocity = np.random.default_rng(2).standard_normal(20_000)
    basis = BASES["spline"].fit(velocity, 20)
    torque = sign * 5.0 * np.maximum(velocity - threshold, 0.0)
    design = basis(velocity)
    coefficients = np.linalg.lstsq(
        design.T - design.mean(axis=1), torque - torque.mean(), rcond=None
    )[0]
    gain, fitted, share = ReflexPath(basis, coefficients, ReflexDynamics(40.0, 1.0)).rectifier
    assert gain == pytest.approx(5.0 * sign, rel=0.02)
    assert fitted == pytest.approx(threshold, abs=0.03)
    assert share > 0.999


@pytest.mark.parametrize(
    ("method", "options", "accuracy"),
    [
        ("pr-moesp", {"basis": "rectifier"}, 0.003),
        ("pr-moesp", {"basis": "spline", "degree": 8}, 0.005),
        ("eiv-moesp", {"basis": "rectifier"}, 0.01),
        ("parallel-cascade", {}, 0.01),
    ],
)
def test_physical_parameters_without_noise(method, options, accuracy):
    estimate = identify(simulate(seed=1, snr_db=None, voluntary=0.0), method, **options)
    for name, truth in (("G", 13.0), ("omega_n", 40.0), ("zeta", 1.0)):
        assert estimate.reflex[name] == pytest.approx(truth, rel=accuracy), name
    curve = estimate.diagnostics["nonlinearity"]
    truth = 13.0 * np.maximum(curve["velocity"], 0.0)
    # A spline rounds the corner.
    np.testing.assert_allclose(curve["torque"], truth, atol=0.05 * np.ptp(truth))
    assert estimate.diagnostics["separation"]["rank_one"] > 0.9999
