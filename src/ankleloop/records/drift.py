"""What is done to a trial before it is identified."""

import numpy as np

from ankleloop.errors import DataError
from ankleloop.records.trial import validate

__all__ = ["remove_drift"]

STEEPEST = 10


def remove_drift(trial, degree):
    """Take a polynomial out of the torque.

    A drift of the torque is slower than any perturbation: the muscle tires, the sensor warms up. The position stays as
    it is, for the nonlinearity depends on it.

    Parameters
    ----------
    trial : xarray.Dataset
        The trial.
    degree : int
        Degree of the polynomial over the whole record; 0 takes the mean.

    Returns
    -------
    xarray.Dataset
        A valid trial; the true torques of a simulation stay as they are.

    Raises
    ------
    ValueError
        If the degree is not a whole number between 0 and 10.
    DataError
        If nothing is left of the torque.

    Examples
    --------
    >>> from ankleloop.records.trial import new_trial
    >>> t = np.arange(100) / 100
    >>> trial = new_trial(0.01 * np.sin(20 * t), np.sin(20 * t) + 5 * t**2, 100.0)
    >>> bool(abs(np.polyfit(t, remove_drift(trial, 2)["torque"], 2)).max() < 1e-9)
    True
    """
    if isinstance(degree, bool) or degree != int(degree) or not 0 <= degree <= STEEPEST:
        raise ValueError(f"degree must be a whole number between 0 and {STEEPEST}, got {degree!r}.")
    torque = trial["torque"].values
    grid = np.linspace(-1.0, 1.0, torque.size)
    legendre = np.polynomial.legendre
    left = torque - legendre.legval(grid, legendre.legfit(grid, torque, int(degree)))
    if np.ptp(left) <= 1e-9 * np.ptp(torque):
        raise DataError(f"a polynomial of degree {degree} takes all of the torque: there is nothing but drift in it.")
    return validate(trial.assign(torque=trial["torque"].copy(data=left)))
