"""Identification without scaling, and without means and offsets."""

import numpy as np
import pytest

from ankleloop.signals.vaf import vaf
from ankleloop.subspace.input_matrices import simulate_response
from ankleloop.subspace.moesp import moesp

A, B = np.array([[0.8, 0.3], [-0.3, 0.7]]), np.array([[1.0, 0.5], [0.2, -1.0]])
C, D = np.array([[1.0, 0.4]]), np.array([[0.5, 0.0]])
POLES = np.linalg.eigvals(A)


def simulate(u, offset=0.0):
    x, y = np.zeros(2), np.empty((len(u), 1))
    for t, sample in enumerate(u):
        y[t] = C @ x + D @ sample + offset
        x = A @ x + B @ sample
    return y


@pytest.fixture(scope="module")
def u():
    """Inputs with means of their own."""
    return np.random.default_rng(1).normal([1.0, -3.0], 1.0, (600, 2))


def pole_error(estimate):
    return np.abs(np.sort_complex(estimate.diagnostics["poles"]) - np.sort_complex(POLES)).max()


def gain(estimate):
    """Steady-state gain in the units of the data."""
    m = estimate.matrices
    return m.C @ np.linalg.solve(np.eye(2) - m.A, m.B) + m.D


GAIN = C @ np.linalg.solve(np.eye(2) - A, B) + D


@pytest.mark.parametrize("instruments", ["none", "past-input", "past-input-output"])
@pytest.mark.parametrize("scaling", [True, False])
def test_units_of_the_data_are_kept(u, instruments, scaling):
    units = np.array([2.0, 0.1])
    estimate = moesp(u * units, simulate(u), 6, 2, instruments, scaling=scaling)
    assert pole_error(estimate) < 1e-6
    np.testing.assert_allclose(gain(estimate) * units, GAIN, atol=1e-6)


@pytest.mark.parametrize("instruments", ["past-input", "past-input-output"])
def test_without_offsets_the_data_must_have_none(u, instruments):
    exact = moesp(u, simulate(u), 6, 2, instruments, offsets=False)
    assert pole_error(exact) < 1e-8
    np.testing.assert_allclose(gain(exact), GAIN, atol=1e-8)
    np.testing.assert_allclose(exact.initial_state, 0.0, atol=1e-8)
    shifted = simulate(u, offset=5.0)
    assert pole_error(moesp(u, shifted, 6, 2, instruments)) < 1e-8
    assert np.abs(gain(moesp(u, shifted, 6, 2, instruments, offsets=False)) - GAIN).max() > 0.1


@pytest.mark.parametrize("scaling", [True, False])
def test_the_record_is_simulated_with_its_means(u, scaling):
    y = simulate(u, offset=-20.0)
    estimate = moesp(u, y, 6, 2, scaling=scaling)
    simulated = estimate.simulate(u)
    np.testing.assert_allclose(simulated, y, atol=1e-8)
    assert vaf(y[:, 0], simulated[:, 0]) > 100.0 - 1e-9
    m = estimate.matrices
    deviations = simulate_response(
        m.A, m.B, m.C, m.D, u - estimate.input_means, estimate.initial_state
    )
    np.testing.assert_allclose(deviations + estimate.offsets, y, atol=1e-8)


def test_merged_records_are_simulated_with_means_of_their_own():
    rng = np.random.default_rng(3)
    u = [rng.normal(mean, 1.0, (samples, 2)) for mean, samples in ((3.0, 200), (-5.0, 150))]
    y = [simulate(part, offset) for part, offset in zip(u, (10.0, -4.0), strict=True)]
    estimate = moesp(u, y, 6, 2)
    for number, (inputs, outputs) in enumerate(zip(u, y, strict=True)):
        np.testing.assert_allclose(estimate.simulate(inputs, number), outputs, atol=1e-8)
    assert estimate.offsets.shape == (2, 1)
    assert estimate.input_means.shape == (2, 2)
