"""Trajectories of K, B and G with their bands, as a data set."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.quantities import QUANTITIES
from ankleloop.records.group_files import Fields

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


@dataclass(frozen=True)
class Splines:
    """Uniform cubic B-splines over 0 … 1, or the indicators of equal intervals."""

    size: int  # number of splines; 4 at least for a basis of degree 3
    periodic: bool  # whether 1 is the same place as 0
    degree: int = 3  # cubic splines, or indicators

    def __call__(self, place: np.ndarray) -> np.ndarray:
        """Values of the splines at places within 0 … 1, shape (N, size)."""
        intervals = self.size if self.periodic or self.degree == 0 else self.size - 3
        scaled = np.clip(place, 0.0, 1.0) * intervals
        first = np.minimum(scaled.astype(int), intervals - 1)
        values, rows = np.zeros((place.size, self.size)), np.arange(place.size)
        if self.degree == 0:
            values[rows, first] = 1.0
            return values
        u = scaled - first
        pieces = ((1 - u) ** 3, 3 * u**3 - 6 * u**2 + 4, -3 * u**3 + 3 * u**2 + 3 * u + 1, u**3)
        for k, piece in enumerate(pieces):
            np.add.at(values, (rows, (first + k) % self.size), piece / 6.0)
        return values

    @cached_property
    def penalty(self) -> np.ndarray:
        """Sum of the squares of second differences of the coefficients as a matrix; none for indicators."""
        if self.degree == 0:
            return np.zeros((self.size, self.size))
        if self.periodic:
            unit = np.eye(self.size)
            differences = np.roll(unit, 1, axis=0) - 2 * unit + np.roll(unit, -1, axis=0)
        else:
            differences = np.diff(np.eye(self.size), 2, axis=0)
        return differences.T @ differences

    @property
    def rank(self) -> int:
        """Rank of the penalty: coefficients of a constant, and of a straight line if not periodic, cost nothing."""
        return 0 if self.degree == 0 else self.size - (1 if self.periodic else 2)
