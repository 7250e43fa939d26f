"""An unstable system in a loop that stabilises it: kept on request."""

import numpy as np
import pytest

from ankleloop.subspace import moesp

A, B, C = np.array([[1.161, 0.3], [0.0, 0.5]]), np.array([[1.0], [0.5]]), np.array([[1.0, 0.4]])
FREQUENCIES = np.exp(1j * np.linspace(0.1, 3.0, 20))


def close_loop(dynamics=A, samples=3000, noise=0.0, seed=0):
    """Inputs, outputs and reference of a proportional feedback about a point of operation."""
    rng = np.random.default_rng(seed)
    r, v = rng.standard_normal((2, samples))
    u, y, x = np.empty((samples, 1)), np.empty((samples, 1)), np.array([1.0, -2.0])
    for t in range(samples):
        deviation = (C @ x).item() + noise * v[t]
        u[t], y[t] = 2.0 + r[t] - 0.7 * deviation, 7.0 + deviation
        x = dynamics @ x + B[:, 0] * (u[t] - 2.0)
    return u, y, r


def respond(dynamics, B, C, D):
    return np.array(
        [(C @ np.linalg.solve(z * np.eye(2) - dynamics, B) + D).item() for z in FREQUENCIES]
    )


def error(estimate, dynamics=A):
    m = estimate.matrices
    truth = respond(dynamics, B, C, np.zeros((1, 1)))
    return np.abs(respond(m.A, m.B, m.C, m.D) - truth).max() / np.abs(truth).max()


@pytest.mark.parametrize("input_matrices", ["least-squares", "instruments"])
@pytest.mark.parametrize("projection", ["ordinary", "correlation"])
def test_an_unstable_system_is_kept_on_request(projection, input_matrices):
    u, y, r = close_loop()
    options = {"instrument_rows": 30, "input_matrices": input_matrices}
    estimate = moesp(u, y, 10, 2, "past-reference", projection, r, stable=False, **options)
    np.testing.assert_allclose(np.sort(estimate.diagnostics["poles"].real), [0.5, 1.161], atol=1e-8)
    assert error(estimate) < 1e-8
    np.testing.assert_allclose(estimate.simulate(u[:40]), y[:40], atol=1e-6)
    assert not estimate.diagnostics["stable"]
    (warning,) = estimate.diagnostics["warnings"]
    assert "spectral radius 1.1610" in warning
    assert "it was kept (stable=False)" in warning


def test_by_default_it_is_replaced_and_the_warning_names_the_option():
    u, y, r = close_loop()
    estimate = moesp(u, y, 10, 2, "past-reference", "ordinary", r)
    assert estimate.diagnostics["spectral_radius"] < 1
    assert not estimate.diagnostics["stable"]
    (warning,) = estimate.diagnostics["warnings"]
    assert "it was replaced by a guaranteed stable one" in warning
    assert "stable=False" in warning


def test_an_integrator_in_a_loop():
    """Without means: an integrator turns an error of the mean of its input into a ramp."""
    dynamics = np.array([[1.0, 0.3], [0.0, 0.5]])
    u, y, r = close_loop(dynamics)
    data = u - 2.0, y - 7.0
    estimate = moesp(*data, 10, 2, "past-reference", "ordinary", r, stable=False, offsets=False)
    assert error(estimate, dynamics) < 1e-6
    np.testing.assert_allclose(estimate.simulate(data[0]), data[1], atol=1e-5)
