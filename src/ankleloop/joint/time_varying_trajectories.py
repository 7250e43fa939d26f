"""Trajectories of K, B and G with their bands, as a data set."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.quantities import QUANTITIES
from ankleloop.records.group_files import Fields

__all__ = ["read_trajectories", "trajectory_dataset"]

COORDINATES = {
    "phase": ("1", "phase of the cycle"),
    "time": ("s", "time from the first sample"),
    "schedule": ("", "scheduling variable"),
}
NAMES = ("K", "B", "G", "I")
ENDS = {"": "{}", "_low": "lower end of the 95 % band of the {}", "_high": "upper end of the 95 % band of the {}"}


def trajectory_dataset(dimension: str, coordinate: np.ndarray, values: Mapping[str, np.ndarray]) -> xr.Dataset:
    """Trajectories over phase, time or a scheduling variable, with units and names.

    Parameters
    ----------
    dimension : {"phase", "time", "schedule"}
        What they are functions of.
    coordinate : ndarray, shape (places,)
        Its values.
    values : mapping of str to ndarray, shape (places,)
        "K", "K_low", "K_high" and the same for B and G, and for I where it varies.

    Returns
    -------
    xarray.Dataset
    """
    variables = {}
    for name in NAMES:
        if name not in values:
            continue
        quantity = QUANTITIES[name]
        for end, text in ENDS.items():
            attributes = {"units": quantity.unit, "long_name": text.format(quantity.name)}
            variables[name + end] = (dimension, values[name + end], attributes)
    unit, long_name = COORDINATES[dimension]
    attributes = {"units": unit, "long_name": long_name}
    return xr.Dataset(variables, coords={dimension: (dimension, coordinate, attributes)})


def read_trajectories(fields: Fields) -> xr.Dataset:
    """Trajectories whose values a file holds.

    Parameters
    ----------
    fields : Fields
        The coordinate and the values by name.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    DataError
        If a value is missing or of a wrong size.
    """
    dimension = next((name for name in COORDINATES if name in fields.values), None)
    if dimension is None:
        raise DataError(f"{fields.source}: there is no coordinate of the trajectories: the file is damaged.")
    coordinate = fields.array(dimension)
    names = [name + end for name in NAMES for end in ENDS if name != "I" or name in fields.values]
    return trajectory_dataset(
        dimension, coordinate, {name: fields.array(name, coordinate.size, finite=False) for name in names}
    )
