"""The result that every method returns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.quantities import QUANTITIES
from ankleloop.subspace.matrices import Matrices

if TYPE_CHECKING:
    from control import StateSpace

    from ankleloop.joint.prepared import PreparedTrial

__all__ = ["TORQUES", "Estimate", "torque_dataset"]

TORQUES = ("net", "intrinsic", "reflex")
STIFFNESS_UNITS = {"K": "N·m/rad", "B": "N·m·s/rad", "I": "kg·m²"}


@dataclass(frozen=True)
class Estimate:
    """Result of an identification.

    Parameters
    ----------
    method : str
        Name of the method.
    torque : xarray.Dataset
        `net`, `intrinsic` and `reflex` torque over time [N·m], as deviations from their means.
    matrices : ankleloop.subspace.matrices.Matrices or None
        Model in physical units from position, velocity, acceleration and the basis functions to the torque; None for
        non-parametric methods. `model` is the same as a `control.StateSpace`.
    stiffness : dict
        "K" [N·m/rad], "B" [N·m·s/rad], "I" [kg·m²].
    reflex : dict
        "delay" [s] and, where the method gives them, "G" [N·m·s/rad], "omega_n" [rad/s], "zeta".
    intervals : dict
        95 % intervals (low, high) by the same names, where the method gives them.
    diagnostics : dict
        Details of the identification: singular values, order, poles, ranks, passes, warnings.
    predictor : callable or None
        Computes the torques of another trial, a data set like `torque`; None where the method has no fixed model, and
        for estimates read from a file.
    """

    method: str
    torque: xr.Dataset
    matrices: Matrices | None
    stiffness: dict[str, float]
    reflex: dict[str, float]
    intervals: dict[str, tuple[float, float]] = field(default_factory=dict)
    diagnostics: dict[str, Any] = field(default_factory=dict)
    predictor: Callable[[Any], xr.Dataset] | None = field(default=None, repr=False)

    @cached_property
    def model(self) -> StateSpace | None:
        """The model as a `control.StateSpace`; None for non-parametric methods."""
        return None if self.matrices is None else self.matrices.state_space()

    def predict(self, trial: xr.Dataset | PreparedTrial) -> Estimate:
        """The estimate with the torques that its model gives on another trial, from a state of rest.

        Parameters
        ----------
        trial : xarray.Dataset or PreparedTrial
            A trial that the fit need not have seen; `evaluate` scores the result on it.

        Returns
        -------
        Estimate

        Raises
        ------
        DataError
            If the trial is unusable, or the estimate has no model to predict with.
        """
        if self.predictor is None:
            raise DataError(
                f"the estimate by {self.method} has no model to predict with: the method has none, or the estimate was "
                "read from a file. Identify again."
            )
        return replace(self, torque=self.predictor(trial))

    def __repr__(self) -> str:
        values = ", ".join(
            f"{name} = {value:.4g}{self._interval(name)} {QUANTITIES[name].unit}"
            for name, value in self.stiffness.items()
        )
        lines = [f"<Estimate by {self.method}: {values}>"]
        lines += [f"  warning: {text}" for text in self.diagnostics.get("warnings", ())]
        return "\n".join(lines)

    def _interval(self, name: str) -> str:
        """The 95 % interval of a parameter as text, empty where there is none."""
        return " ({:.4g} … {:.4g})".format(*self.intervals[name]) if name in self.intervals else ""


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
    """
    variables = {
        name: ("time", values, {"units": "N·m", "long_name": f"estimated {name} torque"})
        for name, values in torques.items()
    }
    coordinate = ("time", time, {"units": "s", "long_name": "time"})
    return xr.Dataset(variables, coords={"time": coordinate}, attrs={"identification_rate": float(rate)})
