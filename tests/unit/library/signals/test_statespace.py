"""Low-pass filters in state-space form and their exact discretisation, against SciPy and an adaptive solver."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ankleloop.signals.statespace import companion, lowpass_denominator, step_matrices


@pytest.mark.parametrize("pole", [None, 30.0])
def test_the_companion_form_has_the_transfer_function(pole):
    denominator = lowpass_denominator(40.0, 0.8, pole)
    factors = [1.0, 64.0, 1600.0], [1.0] if pole is None else [1.0, pole]
    np.testing.assert_allclose(denominator, np.polymul(*factors), rtol=1e-15)
    s = 2j * np.pi * np.array([0.0, 1.0, 7.0, 30.0])
    A, B, C = companion(denominator)
    response = [(C @ np.linalg.solve(value * np.eye(len(A)) - A, B)).item() for value in s]
    np.testing.assert_allclose(response, denominator[-1] / np.polyval(denominator, s), rtol=1e-12)


def test_one_step_against_an_adaptive_solver():
    A, B = np.array([[0.0, 1.0], [-900.0, -20.0]]), np.array([[0.0], [900.0]])
    F, before, after = step_matrices(A, B, 0.02)
    start, u0, u1 = np.array([0.3, -2.0]), 0.7, -0.4
    exact = solve_ivp(
        lambda t, x: A @ x + B[:, 0] * (u0 + (u1 - u0) * t / 0.02),
        (0, 0.02),
        start,
        rtol=1e-10,
        atol=1e-12,
    ).y[:, -1]
    np.testing.assert_allclose(F @ start + before[:, 0] * u0 + after[:, 0] * u1, exact, rtol=1e-7)


@pytest.mark.parametrize("cutoff", [100.0, 1e3, 5e3, 1.2e4, 1e5])
def test_fast_filters_are_as_accurate_as_slow_ones(cutoff):
    """A step in multiples of the filter's own time has the same effect, whatever the units of the states are."""
    denominator = np.array([1.0, 4.0, 9.0, 10.0, 4.0])
    powers = cutoff ** np.arange(5)
    slow, fast = (
        step_matrices(*companion(denominator * factor)[:2], 1e-4 * s)
        for factor, s in ((1.0, cutoff), (powers, 1.0))
    )
    units = cutoff ** np.arange(4)
    np.testing.assert_allclose(fast[0] * units / units[:, None], slow[0], rtol=0, atol=1e-6)
    np.testing.assert_allclose(fast[1] / units[:, None], slow[1], rtol=0, atol=1e-6)
