"""Inputs and output of an identification (Eq. 3, 9 and 11), decimated through one kernel."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from ankleloop.errors import DataError
from ankleloop.joint.basis import Basis
from ankleloop.joint.hammerstein import DriveSpectra
from ankleloop.signals.decimation import decimation_factor, decimation_margin
from ankleloop.signals.differentiation import differentiation_margin
from ankleloop.subspace.records import remove_means

__all__ = [
    "INTRINSIC_NAMES",
    "Grid",
    "InputStep",
    "JointInputs",
    "Regressors",
    "decimation_grid",
    "recording_margins",
    "widen_grid",
]

INTRINSIC_NAMES = ("position", "velocity", "acceleration")
INTRINSIC_UNITS = ("rad", "rad/s", "rad/s²")
# Steps of the processing that can be left out: derivatives of the decimation kernel instead of differences of the
# decimated position, and basis functions before decimation instead of after it.
InputStep = Literal["kernel-derivatives", "early-nonlinearity"]


class Grid(NamedTuple):
    """Which recorded samples are decimated: factor, first recorded sample, and number of decimated samples."""

    factor: int
    first: int
    samples: int


def decimation_grid(samples: int, rate: float, identification_rate: float, delay: float) -> Grid:
    """Grid of all decimated samples that no filter edge touches."""
    factor = decimation_factor(rate, identification_rate)
    first, after = recording_margins(rate, factor, delay)
    count = (samples - 1 - after - first) // factor + 1
    if count < 2:
        raise DataError(
            f"the record of {samples / rate:.3g} s is too short: its filters touch "
            f"{(first + after) / rate:.3g} s at the ends. Record longer."
        )
    return Grid(factor, first, count)


def widen_grid(grid: Grid, samples: int) -> Grid:
    """All decimated samples of a record that lie between those of a grid by whole factors, as far as its ends allow."""
    margin = decimation_margin(grid.factor)
    first = margin + (grid.first - margin) % grid.factor
    count = (samples - 1 - margin - first) // grid.factor + 1
    inside = grid.first >= first and grid.first + grid.factor * grid.samples <= first + grid.factor * count
    return Grid(grid.factor, first, count) if inside else grid


def recording_margins(rate: float, factor: int, delay: float) -> tuple[int, int]:
    """Recorded samples that the filters touch: before the first decimated one, in whole factors, and after the last."""
    margin = decimation_margin(factor)
    before, after = differentiation_margin(rate, delay)
    return -(-(margin + max(before, 0)) // factor) * factor, margin + max(after, 0)


@dataclass(frozen=True, eq=False)
class JointInputs:
    """Inputs of the joint's model on one record.

    Parameters
    ----------
    values : ndarray, shape (N, 3 + k)
        P, Ṗ, P̈ and the k basis functions of the delayed velocity.
    basis : Basis
        Basis of the nonlinearity, with its scale or knots.
    delay : float
        Reflex delay [s].
    rate : float
        Identification rate [Hz].
    omitted_step : {"kernel-derivatives", "early-nonlinearity"} or None
        Step of the processing that was left out.
    """

    values: np.ndarray
    basis: Basis
    delay: float
    rate: float
    omitted_step: InputStep | None = None

    @cached_property
    def centred(self) -> list[np.ndarray]:
        """Inputs of the intrinsic and of the reflex path, less their means: shapes (N, 3) and (N, k)."""
        return np.split(remove_means([self.values])[0], [len(INTRINSIC_NAMES)], axis=1)

    @cached_property
    def drive_spectra(self) -> DriveSpectra:
        """Spectra of the inputs of the reflex path."""
        return DriveSpectra(self.centred[1], self.rate)


@dataclass(frozen=True, eq=False)
class Regressors:
    """Inputs and output of an identification.

    Parameters
    ----------
    time : ndarray, shape (N,)
        Time in the record [s].
    joint_inputs : JointInputs
        Inputs of the joint's model.
    torque : ndarray, shape (N,)
        Measured net torque [N·m].
    reference : ndarray, shape (N,), or None
        Reference of the loop [rad].
    reference_name : str or None
        Variable that serves as reference.
    grid : Grid
        Recorded samples that were decimated.
    """

    time: np.ndarray
    joint_inputs: JointInputs
    torque: np.ndarray
    reference: np.ndarray | None
    reference_name: str | None
    grid: Grid

    @property
    def inputs(self) -> np.ndarray:
        """P, Ṗ, P̈ and the basis functions of the delayed velocity, shape (N, 3 + k)."""
        return self.joint_inputs.values

    @property
    def basis(self) -> Basis:
        """Basis of the nonlinearity."""
        return self.joint_inputs.basis

    @property
    def delay(self) -> float:
        """Reflex delay [s]."""
        return self.joint_inputs.delay

    @property
    def rate(self) -> float:
        """Identification rate [Hz]."""
        return self.joint_inputs.rate

    @property
    def names(self) -> tuple[str, ...]:
        """Name of every input."""
        return (*INTRINSIC_NAMES, *self.basis.names)

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of every input."""
        return (*INTRINSIC_UNITS, *self.basis.units)

    @property
    def reflex(self) -> np.ndarray:
        """Boolean mask of the inputs of the reflex path, shape (3 + k,)."""
        return np.arange(self.inputs.shape[1]) >= len(INTRINSIC_NAMES)

    def fit_stiffness(self, torque: np.ndarray, rows: np.ndarray | slice = slice(None)) -> dict[str, float]:
        """K, B and I of the second-order model that explains a torque best, by least squares.

        Shapes: torque (M,).
        """
        motion = remove_means([self.inputs[rows, : len(INTRINSIC_NAMES)]])[0]
        values = np.linalg.lstsq(motion, torque - np.mean(torque), rcond=None)[0]
        return dict(zip("KBI", map(float, values), strict=True))
