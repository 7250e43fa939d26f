"""Inputs and output of an identification (Eq. 3, 9 and 11), decimated through one kernel; torques over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import ceil
from typing import Literal, NamedTuple

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.joint.bases import Basis
from ankleloop.quantities import STIFFNESS
from ankleloop.signals.decimation import (
    decimation_factor,
    decimation_margin,
    differentiation_margin,
)
from ankleloop.signals.least_squares import SINGULAR, fit_scaled

INTRINSIC_NAMES = ("position", "velocity", "acceleration")
MOTION = len(INTRINSIC_NAMES)
# Steps of the processing that can be left out: derivatives of the decimation kernel instead of differences of the
# decimated position, and basis functions before decimation instead of after it.
InputStep = Literal["kernel-derivatives", "early-nonlinearity"]
TORQUES = ("net", "intrinsic", "reflex")
MEASURED = "measured"  # torque of the trial beside those of an estimate


class Grid(NamedTuple):
    """Which recorded samples are decimated: factor, first recorded sample, and number of decimated samples."""

    factor: int
    first: int
    samples: int


def decimation_grid(samples: int, rate: float, identification_rate: float, delay: float) -> Grid:
    """Grid of all decimated samples that no filter edge touches."""
    factor = decimation_factor(rate, identification_rate)
    start, end = _filter_edges(factor, rate, delay)
    first = factor * ceil(start / factor)
    count = (samples - 1 - end - first) // factor + 1
    if count < 2:
        taken = filtered_duration(rate, identification_rate, delay)
        raise DataError(
            f"the record of {samples / rate:.3g} s is too short for its filters, which take {taken:.2g} s. Record "
            "longer."
        )
    return Grid(factor, first, count)


def filtered_duration(rate: float, identification_rate: float, delay: float) -> float:
    """Time at the ends of a record that its filters touch [s]."""
    return sum(_filter_edges(decimation_factor(rate, identification_rate), rate, delay)) / rate


def _filter_edges(factor: int, rate: float, delay: float) -> tuple[int, int]:
    """Recorded samples at the start and at the end of a record that its filters touch."""
    margin = decimation_margin(factor)
    before, after = differentiation_margin(rate, delay)
    return margin + before, margin + max(after, 0)


@dataclass(frozen=True, eq=False)
class Regressors:
    """Inputs and output of an identification on one record."""

    time: np.ndarray  # shape (N,): time in the record [s]
    # Shape (N, 3 + k): P, Ṗ, P̈ and the k basis functions of the delayed velocity.
    inputs: np.ndarray
    torque: np.ndarray  # shape (N,): measured net torque [N·m]
    basis: Basis  # basis of the nonlinearity, with its scale or knots
    delay: float  # reflex delay [s]
    rate: float  # identification rate [Hz]
    grid: Grid  # recorded samples that were decimated
    reference: np.ndarray | None = None  # shape (N,): reference of the loop [rad]
    reference_name: str | None = None  # variable that serves as reference
    omitted_step: InputStep | None = None  # step of the processing that was left out

    @cached_property
    def centred(self) -> list[np.ndarray]:
        """Inputs of the intrinsic and of the reflex path, less their means: shapes (N, 3) and (N, k)."""
        deviations = self.inputs - self.inputs.mean(axis=0)
        deviations.flags.writeable = False
        return np.split(deviations, [MOTION], axis=1)

    @property
    def reflex(self) -> np.ndarray:
        """Boolean mask of the inputs of the reflex path, shape (3 + k,)."""
        return np.arange(self.inputs.shape[1]) >= MOTION

    def fit_stiffness(
        self, torque: np.ndarray, rows: np.ndarray | slice = slice(None)
    ) -> dict[str, float]:
        """K, B and I of the second-order model that explains a torque best, by least squares.

        Shapes: torque (M,).
        """
        motion = self.inputs[rows, :MOTION]
        values = fit_scaled(motion - motion.mean(axis=0), torque - np.mean(torque), SINGULAR)
        return dict(zip(STIFFNESS, values.tolist(), strict=True))


def torque_dataset(time: np.ndarray, rate: float, **torques: np.ndarray) -> xr.Dataset:
    """Net, intrinsic and reflex torque [N·m] over time [s], with units and names.

    Shapes: time, torques (N,).

    >>> zero = np.zeros(3)
    >>> torque = torque_dataset(0.01 * np.arange(3), 100.0, net=zero, intrinsic=zero, reflex=zero)
    >>> torque["net"].attrs["units"], torque.attrs["identification_rate"]
    ('N·m', 100.0)
    """
    variables = {name: torque_variable(name, values) for name, values in torques.items()}
    coordinate = ("time", time, {"units": "s", "long_name": "time"})
    return xr.Dataset(variables, {"time": coordinate}, {"identification_rate": rate})


def merge_torques(parts: Sequence[xr.Dataset]) -> xr.Dataset:
    """Torques of trials one after the other, each over its own time; `trial` counts them from 1.

    Those of a single trial are returned unchanged.
    """
    if len(parts) == 1:
        return parts[0]
    sizes = [part.sizes["time"] for part in parts]
    numbers = np.repeat(np.arange(1, len(parts) + 1), sizes)
    return number_trials(xr.concat(parts, "time", combine_attrs="override"), numbers)


def number_trials(torque: xr.Dataset, numbers: np.ndarray) -> xr.Dataset:
    """Torques with the number of the trial of each sample.

    Shapes: numbers (N,).
    """
    return torque.assign_coords(trial=("time", numbers, {"long_name": "number of the trial"}))


def split_torques(torque: xr.Dataset) -> list[xr.Dataset]:
    """Torques of each trial."""
    if "trial" not in torque.coords:
        return [torque]
    return [part.drop_vars("trial") for _, part in torque.groupby("trial")]


def torque_variable(name: str, values: np.ndarray) -> xr.Variable:
    """A torque over time with its unit and name."""
    origin = "" if name == MEASURED else "estimated "
    attributes = {"units": "N·m", "long_name": f"{origin}{name} torque"}
    return xr.Variable("time", values, attributes)
