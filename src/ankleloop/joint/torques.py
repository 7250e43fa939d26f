"""Torques of an estimate over time."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import xarray as xr

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
    template = _template(np.asarray(time, dtype=float).tobytes(), float(rate), tuple(torques))
    return template.copy(data=torques)


@lru_cache(maxsize=2)
def _template(times: bytes, rate: float, names: tuple[str, ...]) -> xr.Dataset:
    """Torques of zero: estimates that follow each other share their times, and a copy takes less than a new dataset."""
    time = np.frombuffer(times)
    zeros = np.broadcast_to(0.0, time.size)
    variables = {name: ("time", zeros, {"units": "N·m", "long_name": f"estimated {name} torque"}) for name in names}
    coordinate = ("time", time, {"units": "s", "long_name": "time"})
    return xr.Dataset(variables, coords={"time": coordinate}, attrs={"identification_rate": rate})
