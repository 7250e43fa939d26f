"""Removal of drift: a polynomial is subtracted from the torque, and from nothing else."""

import numpy as np
import pytest

from ankleloop.errors import DataError
from ankleloop.trials.trial import new_trial, remove_drift

T = np.arange(2000) / 1000.0
POSITION = 0.02 * np.sin(2 * np.pi * 3 * T)
TORQUE = 3.0 * np.cos(2 * np.pi * 3 * T)


@pytest.mark.parametrize("degree", [0, 1, 3, 10])
def test_polynomial_is_subtracted(degree):
    drift = np.polynomial.Polynomial(np.linspace(1.0, 2.0, degree + 1))(T)
    trial = new_trial(POSITION, TORQUE + drift, 1000.0)
    detrended = remove_drift(trial, degree)
    expected = remove_drift(new_trial(POSITION, TORQUE, 1000.0), degree)
    np.testing.assert_allclose(detrended["torque"], expected["torque"], atol=1e-9)
    np.testing.assert_array_equal(detrended["position"], POSITION)
    np.testing.assert_array_equal(trial["torque"], TORQUE + drift)


@pytest.mark.parametrize("degree", [2.5, 11])
def test_degree_is_a_whole_number_up_to_ten(degree):
    with pytest.raises(ValueError, match="degree must be"):
        remove_drift(new_trial(POSITION, TORQUE, 1000.0), degree)


def test_torque_that_is_a_polynomial_is_refused():
    with pytest.raises(DataError, match="a polynomial of degree 1 takes all of the torque"):
        remove_drift(new_trial(POSITION, 1.0 + T, 1000.0), 1)
