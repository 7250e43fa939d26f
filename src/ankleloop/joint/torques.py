"""Torques of an estimate over time."""

from __future__ import annotations

import numpy as np
import xarray as xr

__all__ = ["TORQUES", "torque_dataset"]

TORQUES = ("net", "intrinsic", "reflex")


def torque_dataset(time: np.ndarray, rate: float, **torques: np.ndarray) -> xr.Dataset:
    """Torques over time, with units and names.

    Parameters
    ----------
    time : ndarray, shape (N,)
        Time [s].
    rate : float
        Identification rate [Hz].
    **torques : ndarray, shape (N,)
        `net`, `intrinsic`, `reflex` [N·m].

    Returns
    -------
    xarray.Dataset

    Examples
    --------
    >>> zero = np.zeros(3)
    >>> torque = torque_dataset(0.01 * np.arange(3), 100.0, net=zero, intrinsic=zero, reflex=zero)
    >>> torque["net"].attrs["units"], torque.attrs["identification_rate"]
    ('N·m', 100.0)
    """
    variables = {
        name: ("time", values, {"units": "N·m", "long_name": f"estimated {name} torque"})
        for name, values in torques.items()
    }
    coordinate = ("time", time, {"units": "s", "long_name": "time"})
    return xr.Dataset(variables, coords={"time": coordinate}, attrs={"identification_rate": float(rate)})
