"""One estimate with its model in a file, for this library and for others: NetCDF or MATLAB v5, with JSON."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.models import Model, ResponseModel, model_from_fields
from ankleloop.joint.regressors import TORQUES, torque_dataset
from ankleloop.joint.time_varying_course import read_trajectories
from ankleloop.joint.time_varying_model import TimeVaryingModel
from ankleloop.options import check_flag, check_path, show_value
from ankleloop.quantities import QUANTITIES
from ankleloop.signals.sampling import check_same_rate, compute_rate
from ankleloop.trials.group_files import Fields, read_groups, write_groups
from ankleloop.trials.readable_files import name_errors

FORMAT, VERSION = "ankleloop estimate", 1
VARIABLE = "estimate"  # of a MATLAB file
JSON = "json"  # the diagnostics

# Dimensions, so that a product along the common one is a product of matrices: A.dot(x) is A x.
DIMENSIONS: Mapping[str, tuple[str, ...]] = {
    "A": ("next_state", "state"),
    "B": ("next_state", "input"),
    "C": ("output", "state"),
    "D": ("output", "input"),
    "initial_state": ("state",),
    "input_delay": ("input",),
    "basis_knots": ("knot",),
    "stiffness": ("parameter",),
    "coefficients": ("basis_function",),
    "limits": ("end",),
    "stiffness_splines": ("stiffness_spline",),
    "viscosity_splines": ("viscosity_spline",),
    "gain_splines": ("gain_spline",),
    "intrinsic_response": ("intrinsic_lag",),
    "reflex_response": ("reflex_lag",),
    "decimation_kernel": ("derivative", "decimation_lag"),
    "velocity_kernel": ("velocity_lag",),
}
UNITS = {
    "input_delay": "s",
    "delay": "s",
    "torque_lag": "s",
    "rest_position": "rad",
    "inertia": "kg·m²",
    "stiffness_splines": "N·m/rad",
    "viscosity_splines": "N·m·s/rad",
    "gain_splines": "N·m·s/rad",
    "identification_rate": "Hz",
    "recording_rate": "Hz",
    "basis_scale": "rad/s",
    "basis_knots": "rad/s",
    "intrinsic_response": "N·m/rad",
    "reflex_response": "N·m·s/rad",
    "intrinsic_lag": "s",
    "reflex_lag": "s",
    "decimation_lag": "recorded samples",
    "velocity_lag": "recorded samples",
    "velocity_kernel": "1/s",
}
ARRAY, COMPLEX = "$array", "$complex"  # keys that mark them


def save_estimate(estimate: Estimate, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write an estimate and its model to a file, from which `load_estimate` reads the same estimate.

    docs/reference/estimates.md describes the file field by field, and how another program computes torques from it.

    Parameters
    ----------
    estimate : Estimate
        The estimate.
    path : path-like
        A file ending in .nc or .mat, in a folder that exists; it appears when it is complete.
    overwrite : bool
        Whether to replace a file of this name; without it an existing file is refused.

    Raises
    ------
    DataError
        For another suffix, if the file exists or the estimate is read from it, or if it cannot be written.
    TypeError
        For diagnostics that are no numbers, texts, arrays, or lists and dictionaries of those.

    Examples
    --------
    >>> import tempfile
    >>> from ankleloop import identify, simulate
    >>> trial, other = (simulate(seed=seed, duration=20.0) for seed in (1, 2))
    >>> estimate = identify(trial, "riv")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_estimate(estimate, f"{folder}/estimate.nc")
    ...     same = load_estimate(f"{folder}/estimate.nc")
    >>> same.predict(other).torque.identical(estimate.predict(other).torque)
    True
    """
    path = check_path("save_estimate", "path", path)
    check_flag("save_estimate", "overwrite", overwrite)
    if not isinstance(estimate, Estimate):
        raise TypeError(f"save_estimate: estimate must be an Estimate, got {show_value(estimate)}.")
    parameters = {"stiffness": estimate.stiffness, "reflex": estimate.reflex}
    groups = {
        "": _describe_file(estimate),
        "torque": estimate.torque[[*TORQUES]],
        **{group: _describe_parameters(values) for group, values in parameters.items()},
        "intervals": _describe_parameters(estimate.intervals, "end"),
        "diagnostics": xr.Dataset(attrs={JSON: dump_values(estimate.diagnostics)}),
    }
    if estimate.predictor is not None:
        groups["model"] = _describe_model(estimate.predictor)
    if estimate.trajectories is not None:
        groups["trajectories"] = estimate.trajectories
    write_groups(groups, path, VARIABLE, overwrite=overwrite)


def load_estimate(path: str | os.PathLike[str]) -> Estimate:
    """Read the estimate that `save_estimate` wrote, with its model.

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    Estimate
        Tuples in its diagnostics have become lists.

    Raises
    ------
    DataError
        If there is no such file, it is damaged or of another origin, or a newer version of the library wrote it.

    Examples
    --------
    >>> load_estimate("nowhere.nc")
    Traceback (most recent call last):
      ...
    ankleloop.errors.DataError: nowhere.nc: there is no such file: check the path.
    """
    path = check_path("load_estimate", "path", path)
    groups = read_groups(path, VARIABLE)
    with name_errors(path, "estimate file", "restore it from a copy, or identify again and save it"):
        return _read_estimate(groups)


def _read_estimate(groups: Mapping[str, Fields]) -> Estimate:
    _check_format(groups[""])
    missing = {"torque", "stiffness", "reflex", "diagnostics"} - set(groups)
    if missing:
        source = groups[""].source
        raise DataError(f"{source}: there is no group {min(missing)!r}: the file is damaged, or of another origin.")
    predictor = model_from_fields(groups["model"]) if "model" in groups else None
    intervals = groups["intervals"] if "intervals" in groups else Fields("", {})
    return Estimate(
        method=groups[""].text("method"),
        torque=_read_torque(groups["torque"]),
        matrices=None if predictor is None else predictor.matrices,
        stiffness=_read_parameters(groups["stiffness"]),
        reflex=_read_parameters(groups["reflex"]),
        intervals=_read_intervals(intervals),
        diagnostics=load_values(groups["diagnostics"].text(JSON), groups["diagnostics"].source),
        predictor=predictor,
        trajectories=read_trajectories(groups["trajectories"]) if "trajectories" in groups else None,
    )


def _describe_file(estimate: Estimate) -> xr.Dataset:
    warnings = " ".join(estimate.diagnostics.get("warnings", ()))
    return xr.Dataset(
        attrs={"format": FORMAT, "format_version": VERSION, "method": estimate.method, "warnings": warnings}
    )


def _check_format(file: Fields) -> None:
    if file.values.get("format") != FORMAT:
        raise DataError(f"{file.source}: no estimate file, which has the format {FORMAT!r}: write it by save_estimate.")
    version = file.number("format_version")
    if version > VERSION:
        raise DataError(
            f"{file.source}: version {version:g} of the format, of which this library knows versions up to {VERSION}: "
            "install the newest ankleloop."
        )


def _describe_parameters(values: Mapping[str, Any], *dimensions: str) -> xr.Dataset:
    data = xr.Dataset({name: (dimensions, np.array(value, dtype=float)) for name, value in values.items()})
    for name in values:
        if name in QUANTITIES:
            data[name].attrs = {"units": QUANTITIES[name].unit, "long_name": QUANTITIES[name].name}
    return data


def _read_parameters(fields: Fields) -> dict[str, float]:
    return {name: float(fields.array(name, 1, finite=False)[0]) for name in fields.values}


def _read_intervals(fields: Fields) -> dict[str, tuple[float, float]]:
    ends = {name: fields.array(name, 2, finite=False).tolist() for name in fields.values}
    return {name: (low, high) for name, (low, high) in ends.items()}


def _read_torque(fields: Fields) -> xr.Dataset:
    time = fields.array("time")
    torques = {name: fields.array(name, time.size, finite=False) for name in TORQUES}
    rate = fields.number("identification_rate")
    check_same_rate(rate, compute_rate(time, source=fields.source), source=fields.source)
    data = torque_dataset(time, rate, **torques)
    attributes = {name: value for name, value in fields.values.items() if name not in ("time", *TORQUES)}
    return data.assign_attrs(
        {name: value if isinstance(value, str) else np.asarray(value).item() for name, value in attributes.items()}
    )


def _describe_model(model: Model) -> xr.Dataset:
    """Fields of a model, and what other programs need to compute its torques: kernels, and matrices if it has any."""
    values: dict[str, Any] = {"kind": model.kind, **model.fields(), **model.inputs.kernels()}
    values["basis_function"] = list(model.inputs.basis.names)
    rate = model.inputs.identification_rate
    if isinstance(model, ResponseModel):
        leads = model.intrinsic.size // 2
        values["intrinsic_lag"] = np.arange(-leads, leads + 1) / rate
        values["reflex_lag"] = np.arange(model.reflex.size) / rate
    elif not isinstance(model, TimeVaryingModel):
        m = model.matrices
        values |= {"A": m.A, "B": m.B, "C": m.C, "D": m.D, "input_delay": np.array(model.inputs.delays)}
        values |= {"input": list(model.inputs.names), "output": ["torque"]}
    texts = {name: value for name, value in values.items() if isinstance(value, str)}
    variables = {
        name: xr.Variable(DIMENSIONS.get(name, (name,)) if np.ndim(value) else (), value)
        for name, value in values.items()
        if name not in texts
    }
    for name in variables.keys() & UNITS.keys():
        variables[name].attrs["units"] = UNITS[name]
    return xr.Dataset(variables, attrs=texts)


def dump_values(values: Any) -> str:
    """Values as JSON; tuples become lists, complex numbers pairs."""
    return json.dumps(values, default=_mark)


def load_values(text: str, source: str) -> Any:
    """Values that `dump_values` wrote."""
    try:
        return json.loads(text, object_hook=_restore)
    except (KeyError, RecursionError, TypeError, ValueError) as cause:
        raise DataError(f"{source}: the values cannot be read ({cause}): the file is damaged.") from cause


def _mark(value: Any) -> Any:
    """What takes the place of a value that JSON does not have."""
    if isinstance(value, np.ndarray):
        if value.dtype.kind not in "biufc":
            raise TypeError(f"an array of type {value.dtype} cannot be kept in diagnostics")
        numbers = value.ravel().astype(complex).view(float) if value.dtype.kind == "c" else value.ravel()
        return {ARRAY: numbers.tolist(), "dtype": str(value.dtype), "shape": list(value.shape)}
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, complex):
        return {COMPLEX: [value.real, value.imag]}
    raise TypeError(f"{type(value).__name__} cannot be kept in diagnostics")


def _restore(values: dict[str, Any]) -> Any:
    if COMPLEX in values:
        return complex(*values[COMPLEX])
    if ARRAY not in values:
        return values
    dtype = np.dtype(values["dtype"])
    if dtype.kind not in "biufc":
        raise TypeError(f"an array of type {dtype}")
    array = np.array(values[ARRAY], dtype=float if dtype.kind == "c" else dtype)
    return (array.view(complex).astype(dtype) if dtype.kind == "c" else array).reshape(values["shape"])
