"""Trajectories of K, B and G with their bands, as a data set."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.quantities import QUANTITIES
from ankleloop.records.group_files import Fields

__all__ = ["describe_schedule", "read_trajectories", "trajectory_dataset"]

COORDINATES = {
    "phase": ("1", "phase of the cycle"),
    "time": ("s", "time from the first sample"),
    "schedule": ("", "scheduling variable"),
}
NAMES = ("K", "B", "G", "I")
ENDS = {"": "{}", "_low": "lower end of the 95 % band of the {}", "_high": "upper end of the 95 % band of the {}"}


def describe_schedule(trial: xr.Dataset, schedule: str | None) -> dict[str, str]:
    """Name and unit of the scheduling variable of a trial, as `trajectory_dataset` takes them."""
    if schedule is None:
        return {}
    return {"variable": schedule, "variable_unit": str(trial[schedule].attrs.get("units", ""))}


def trajectory_dataset(
    dimension: str,
    coordinate: np.ndarray,
    values: Mapping[str, np.ndarray],
    *,
    variable: str = "",
    variable_unit: str = "",
) -> xr.Dataset:
    """Trajectories over phase, time or a scheduling variable, with units and names.

    Shapes: coordinate (places,), values (places,).
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
    attributes = {"units": variable_unit or unit, "long_name": variable or long_name}
    stated = {"variable": variable, "variable_unit": variable_unit}
    return xr.Dataset(
        variables,
        coords={dimension: (dimension, coordinate, attributes)},
        attrs={name: text for name, text in stated.items() if text},
    )


def read_trajectories(fields: Fields) -> xr.Dataset:
    """Trajectories whose values a file holds."""
    dimension = next((name for name in COORDINATES if name in fields.values), None)
    if dimension is None:
        raise DataError(f"{fields.source}: there is no coordinate of the trajectories: the file is damaged.")
    coordinate = fields.array(dimension)
    names = [name + end for name in NAMES for end in ENDS if name != "I" or name in fields.values]
    values = {name: fields.array(name, coordinate.size, finite=False) for name in names}
    stated = {name: fields.text(name) for name in ("variable", "variable_unit") if name in fields.values}
    return trajectory_dataset(dimension, coordinate, values, **stated)
