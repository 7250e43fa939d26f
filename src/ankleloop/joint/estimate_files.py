"""Files of estimates with their models, in NetCDF or MATLAB v5."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.models import model_dataset, read_model
from ankleloop.joint.regressors import MEASURED, TORQUES, number_trials, torque_dataset
from ankleloop.joint.time_varying_course import read_trajectories
from ankleloop.options import as_text, check_flag, check_path, show_value
from ankleloop.quantities import QUANTITIES
from ankleloop.trials.files import PathLike
from ankleloop.trials.group_files import Fields, read_groups, write_groups
from ankleloop.trials.readable_files import name_errors

FORMAT = "ankleloop estimate"
VERSION = 1
MATLAB_VARIABLE = "estimate"
PARAMETER_GROUPS = ("stiffness", "reflex", "intervals")
DIAGNOSTICS_TEXT = "json"  # field that holds the diagnostics

# Keys of a JSON object that stands for one of these.
ARRAY_KEY = "$array"
COMPLEX_KEY = "$complex"


def save_estimate(estimate: Estimate, path: PathLike, *, overwrite: bool = False) -> None:
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
        For another suffix, if the file exists, or if it cannot be written.
    TypeError
        For diagnostics that are no numbers, texts, arrays, or lists and dictionaries of those.

    See Also
    --------
    ankleloop.load_estimate : Reads the file.

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
    attributes = {
        "format": FORMAT,
        "format_version": VERSION,
        "method": estimate.method,
        "warnings": " ".join(estimate.warnings),
    }
    groups = {"": xr.Dataset(attrs=attributes), "torque": estimate.torque}
    for name in PARAMETER_GROUPS:
        groups[name] = _parameter_dataset(getattr(estimate, name))
    if estimate.predictor is not None:
        groups["model"] = model_dataset(estimate.predictor)
    if estimate.trajectories is not None:
        groups["trajectories"] = estimate.trajectories
    diagnostics = dump_values(estimate.diagnostics)
    groups["diagnostics"] = xr.Dataset(attrs={DIAGNOSTICS_TEXT: diagnostics})
    write_groups(groups, path, MATLAB_VARIABLE, overwrite=overwrite)


def _parameter_dataset(values: Mapping[str, Any]) -> xr.Dataset:
    """Numbers, or pairs of numbers, with their units and names."""
    variables = {}
    for name, value in values.items():
        dimensions = ("end",) if np.ndim(value) else ()
        attributes = {"units": QUANTITIES[name].unit, "long_name": QUANTITIES[name].name}
        variables[name] = (dimensions, np.array(value, float), attributes)
    return xr.Dataset(variables)


def load_estimate(path: PathLike) -> Estimate:
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

    See Also
    --------
    ankleloop.save_estimate : Writes the file.

    Examples
    --------
    >>> load_estimate("nowhere.nc")
    Traceback (most recent call last):
      ...
    ankleloop.errors.DataError: nowhere.nc: there is no such file: check the path.
    """
    path = check_path("load_estimate", "path", path)
    groups = read_groups(path, MATLAB_VARIABLE)
    with name_errors(
        path, "estimate file", "restore it from a copy, or identify again and save it"
    ):
        file = groups[""]
        if as_text(file.values.get("format")) != FORMAT:
            raise DataError(
                f"{file.source}: no estimate file, which has the format {FORMAT!r}: write it by save_estimate."
            )
        version = file.number("format_version")
        if version > VERSION:
            raise DataError(
                f"{file.source}: version {version:g} of the format is newer than this library: install the newest one."
            )
        return read_estimate(groups)


def read_estimate(groups: Mapping[str, Fields]) -> Estimate:
    """The estimate whose groups a file or a row of a table holds."""
    torque = groups["torque"]
    time = torque.array("time")
    names = [*TORQUES, MEASURED] if MEASURED in torque.values else TORQUES
    torques = {name: torque.array(name, time.size, finite=False) for name in names}
    dataset = torque_dataset(time, torque.number("identification_rate"), **torques)
    if "trial" in torque.values:
        dataset = number_trials(dataset, torque.array("trial", time.size).astype(int))
    trajectories = groups.get("trajectories")
    return Estimate(
        method=groups[""].text("method"),
        torque=dataset,
        stiffness=_read_numbers(groups["stiffness"]),
        reflex=_read_numbers(groups.get("reflex", Fields("", {}))),  # an apparatus has none
        intervals=_read_intervals(groups.get("intervals", Fields("", {}))),
        diagnostics=load_values(groups["diagnostics"].text(DIAGNOSTICS_TEXT)),
        predictor=read_model(groups["model"]) if "model" in groups else None,
        trajectories=read_trajectories(trajectories) if trajectories else None,
    )


def _read_numbers(fields: Fields) -> dict[str, float]:
    """Numbers by name; one may be nan."""
    return {name: fields.array(name, 1, finite=False).item() for name in fields.values}


def _read_intervals(fields: Fields) -> dict[str, tuple[float, float]]:
    """Ends of intervals by name."""
    ends = {name: fields.array(name, 2, finite=False).tolist() for name in fields.values}
    return {name: (low, high) for name, (low, high) in ends.items()}


def dump_values(values: Any) -> str:
    """Values as JSON; tuples become lists, complex numbers pairs."""
    return json.dumps(values, default=_mark)


def load_values(text: str) -> Any:
    """Values that `dump_values` wrote."""
    return json.loads(text, object_hook=_restore)


def _mark(value: Any) -> Any:
    """What takes the place of a value that JSON does not have."""
    if isinstance(value, xr.Variable):  # of a group, whose fields are read as numbers of a shape
        return value.values.tolist()
    if isinstance(value, np.ndarray):
        return {
            ARRAY_KEY: value.ravel().tolist(),
            "dtype": str(value.dtype),
            "shape": list(value.shape),
        }
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, complex):
        return {COMPLEX_KEY: [value.real, value.imag]}
    raise TypeError(f"{type(value).__name__} cannot be kept in diagnostics")


def _restore(values: dict[str, Any]) -> Any:
    """The value that an object stands for; another object as it is."""
    if COMPLEX_KEY in values:
        return complex(*values[COMPLEX_KEY])
    if ARRAY_KEY in values:
        return np.array(values[ARRAY_KEY], dtype=values["dtype"]).reshape(values["shape"])
    return values
