"""Removal of drift from the torque of a trial."""

from __future__ import annotations

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.trials.validation import validate

MAX_DEGREE = 10


def remove_drift(trial: xr.Dataset, degree: int) -> xr.Dataset:
    """Subtract a polynomial, fitted by least squares, from the torque.

    The torque drifts more slowly than any perturbation, because the muscle tires or the sensor warms up. The position
    stays as it is, because the nonlinearity depends on it.
    """
    if isinstance(degree, bool) or degree != int(degree) or not 0 <= degree <= MAX_DEGREE:
        raise ValueError(f"degree must be a whole number between 0 and {MAX_DEGREE}, got {degree!r}.")
    torque = trial["torque"].values
    grid = np.linspace(-1.0, 1.0, torque.size)
    legendre = np.polynomial.legendre
    detrended = torque - legendre.legval(grid, legendre.legfit(grid, torque, int(degree)))
    if np.ptp(detrended) <= 1e-9 * np.ptp(torque):
        raise DataError(f"a polynomial of degree {degree} takes all of the torque: there is nothing but drift in it.")
    return validate(trial.assign(torque=trial["torque"].copy(data=detrended)))
