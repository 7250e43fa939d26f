"""What every method returns, and how it is kept on disk."""

import json
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.records.files import number_type, write_netcdf

__all__ = ["TORQUES", "Estimate", "load_estimates", "save_estimates", "torque_dataset"]

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
        What the method saw on its way: singular values, order, poles, ranks, passes, warnings.
    predictor : callable or None
        Makes the torques of another trial, a data set like `torque`; None where the method has no fixed model, and
        for estimates read from a file.
    """

    method: str
    torque: xr.Dataset
    matrices: object
    stiffness: dict
    reflex: dict
    intervals: dict = field(default_factory=dict)
    diagnostics: dict = field(default_factory=dict)
    predictor: Callable | None = field(default=None, repr=False)

    @cached_property
    def model(self):
        """The model as a `control.StateSpace`; None for non-parametric methods."""
        return None if self.matrices is None else self.matrices.state_space()

    def predict(self, trial):
        """The same estimate with the torques that it gives on another trial, from a state of rest.

        Parameters
        ----------
        trial : xarray.Dataset
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

    def __repr__(self):
        values = ", ".join(
            f"{name} = {value:.4g}{self._interval(name)} {STIFFNESS_UNITS[name]}"
            for name, value in self.stiffness.items()
        )
        lines = [f"<Estimate by {self.method}: {values}>"]
        lines += [f"  warning: {text}" for text in self.diagnostics.get("warnings", ())]
        return "\n".join(lines)

    def _interval(self, name):
        """The 95 % interval of a parameter in words, where there is one."""
        return " ({:.4g} … {:.4g})".format(*self.intervals[name]) if name in self.intervals else ""


def torque_dataset(time, rate, **torques):
    """Torques over time with units and names.

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


def _plain(value):
    """Diagnostics as JSON: complex numbers as [real, imaginary]."""
    if isinstance(value, (complex, np.complexfloating)):
        return [value.real, value.imag]
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} cannot be kept in diagnostics")


def save_estimates(estimates, path, precision="double"):
    """Write the estimates of a batch of trials to one NetCDF file, whole or not at all.

    Parameters
    ----------
    estimates : sequence of Estimate
        Estimates by one method, of trials of equal length.
    path : path-like
        File to write.
    precision : {"double", "single"}
        Floating-point numbers of the torques on disk.

    Raises
    ------
    ValueError
        For an unknown precision.
    """
    first = estimates[0].torque
    kind = number_type(precision)
    torque = first.assign(
        {
            name: (
                ("trial", "time"),
                np.stack([estimate.torque[name].values for estimate in estimates]).astype(kind),
                first[name].attrs,
            )
            for name in first.data_vars
        }
    )
    names = list(estimates[0].stiffness)
    reflex_names = list(dict.fromkeys(name for estimate in estimates for name in estimate.reflex))
    batch = torque.assign(
        stiffness=(("trial", "parameter"), [[e.stiffness[name] for name in names] for e in estimates]),
        reflex_parameters=(
            ("trial", "reflex_parameter"),
            [[e.reflex.get(name, np.nan) for name in reflex_names] for e in estimates],
        ),
        intervals=(("trial",), [json.dumps(e.intervals, default=_plain) for e in estimates]),
        diagnostics=(("trial",), [json.dumps(e.diagnostics, default=_plain) for e in estimates]),
    )
    batch = batch.assign_coords(parameter=names, reflex_parameter=reflex_names)
    batch["stiffness"].attrs["units"] = ", ".join(STIFFNESS_UNITS[name] for name in names)
    batch.attrs["method"] = estimates[0].method
    write_netcdf(batch, path, {name: {"_FillValue": None} for name in TORQUES})


def load_estimates(path):
    """Read what `save_estimates` wrote.

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    list of Estimate
        Without their models, which are not kept.
    """
    with xr.open_dataset(path, engine="h5netcdf") as batch:
        batch = batch.load()
    return [_estimate(batch.isel(trial=k)) for k in range(batch.sizes["trial"])]


def _named(one, names, values):
    return {str(name): float(value) for name, value in zip(one[names].values, one[values].values, strict=True)}


def _estimate(one):
    reflex = _named(one, "reflex_parameter", "reflex_parameters")
    return Estimate(
        method=one.attrs["method"],
        torque=one[list(TORQUES)].drop_vars(["parameter", "reflex_parameter"], errors="ignore").astype(float),
        matrices=None,
        stiffness=_named(one, "parameter", "stiffness"),
        reflex={name: value for name, value in reflex.items() if np.isfinite(value)},
        intervals={name: tuple(bounds) for name, bounds in json.loads(str(one["intervals"].values)).items()},
        diagnostics=json.loads(str(one["diagnostics"].values)),
    )
