"""Dynamics of the reflex against SciPy and against differences."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal as sps

from ankleloop.joint.dynamics import ReflexDynamics, fit_dynamics
from ankleloop.subspace.input_matrices import simulate_response


@pytest.mark.parametrize(
    ("dynamics", "gain", "denominator"),
    [
        (ReflexDynamics(40.0, 0.8), 1600.0, [1.0, 64.0, 1600.0]),
        (ReflexDynamics(40.0, 0.8, 30.0), 48000.0, np.polymul([1.0, 64.0, 1600.0], [1.0, 30.0])),
    ],
    ids=["second order", "third order"],
)
def test_matrices_against_scipy(dynamics, gain, denominator):
    u = np.random.default_rng(3).standard_normal(500)
    numerator, discrete, _ = sps.cont2discrete(([gain], denominator), 0.01, method="foh")
    torque = simulate_response(*dynamics.matrices(100.0), u[:, None])[:, 0]
    np.testing.assert_allclose(torque, sps.lfilter(numerator.ravel(), discrete, u), atol=1e-9)


@pytest.mark.parametrize("values", [(35.0, 0.9), (35.0, 0.9, 60.0)])
def test_derivatives_against_differences(values):
    s = 2j * np.pi * np.linspace(0.1, 38.0, 50)
    response, derivatives = ReflexDynamics(*values).response(s)
    for step, derivative in zip(1e-6 * np.eye(len(values)), derivatives, strict=True):
        shifted = ReflexDynamics(*values).scale(step).response(s)[0]
        np.testing.assert_allclose((shifted - response) / 1e-6, derivative, rtol=1e-4)


@settings(max_examples=20, deadline=None)
@given(st.floats(12.0, 60.0), st.floats(0.4, 1.6), st.floats(0.5, 20.0))
def test_the_fit_to_a_low_pass_is_this_low_pass(omega, zeta, gain):
    s = 2j * np.pi * np.linspace(0.1, 38.0, 300)
    fitted, dynamics, share = fit_dynamics(
        gain * ReflexDynamics(omega, zeta).response(s)[0], s, np.ones(300)
    )
    assert fitted == pytest.approx(gain, rel=1e-4)
    assert (dynamics.omega_n, dynamics.zeta) == pytest.approx((omega, zeta), rel=1e-4)
    assert share == pytest.approx(1.0, abs=1e-7)


def test_noise_is_hardly_explained_by_a_low_pass():
    """The search for the closest one does not end in time, which is no warning to the user of the estimate."""
    noise = np.random.default_rng(39).standard_normal((2, 60))
    s = 2j * np.pi * np.linspace(0.2, 20.0, 60)
    _, _, share = fit_dynamics(noise[0] + 1j * noise[1], s, np.ones(60))
    assert 0.0 < share < 0.2
