"""Estimates as files that other programs read: NetCDF, MATLAB v5, CSV."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import scipy.io

from ankleloop.errors import DataError
from ankleloop.joint.estimate import TORQUES, Estimate
from ankleloop.records.files import atomic_file, write_netcdf

__all__ = ["export_estimate"]

MAX_NAME_LENGTH = 31  # of a variable in a MATLAB v5 file


def export_estimate(estimate: Estimate, path: str | os.PathLike[str]) -> None:
    """Write one estimate to a file for another program.

    The format follows from the suffix. `.nc` and `.mat` hold the torques over time, the matrices A, B, C, D with the
    names of their inputs, K, B_viscosity, I, the reflex parameters and the intervals; `.csv` holds the torques over
    time.

    Parameters
    ----------
    estimate : Estimate
        The estimate.
    path : path-like
        A file ending in .nc, .mat or .csv, in a folder that exists; it appears when it is complete.

    Raises
    ------
    DataError
        For another suffix, or if the folder does not exist.

    Examples
    --------
    >>> import tempfile
    >>> from ankleloop.methods.registry import identify
    >>> from ankleloop.simulation.simulate import simulate
    >>> estimate = identify(simulate(seed=1, duration=20.0), "riv")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     export_estimate(estimate, f"{folder}/estimate.mat")
    ...     exported = scipy.io.loadmat(f"{folder}/estimate.mat", simplify_cells=True)["estimate"]
    >>> exported["K"] == estimate.stiffness["K"], exported["model"]["A"].shape
    (True, (2, 2))
    """
    path = Path(path)
    writers = {".nc": _write_netcdf, ".mat": _write_mat, ".csv": _write_csv}
    if path.suffix not in writers:
        raise DataError(
            f"{path.name}: estimates are exported as {', '.join(writers)}; got {path.suffix or 'no suffix'}."
        )
    writers[path.suffix](estimate, path)


def _collect_parameters(estimate: Estimate) -> dict[str, float]:
    """Parameters and the limits of their intervals by name; the viscosity is renamed, since B is also a matrix."""
    names = {"B": "B_viscosity"}
    values = {names.get(name, name): value for name, value in (estimate.stiffness | estimate.reflex).items()}
    for name, (low, high) in estimate.intervals.items():
        values |= {f"{names.get(name, name)}_low": low, f"{names.get(name, name)}_high": high}
    return {name: float(value) for name, value in values.items()}


def _collect_model(estimate: Estimate) -> dict[str, Any]:
    """Matrices with their sampling interval and the names of inputs and outputs; empty without a model."""
    m = estimate.matrices
    if m is None:
        return {}
    inputs, outputs = m.names if m.names is not None else ((), ())
    return {"A": m.A, "B": m.B, "C": m.C, "D": m.D, "dt": m.dt, "inputs": list(inputs), "outputs": list(outputs)}


def _join_warnings(estimate: Estimate) -> str:
    return " ".join(estimate.diagnostics.get("warnings", ()))


def _write_netcdf(estimate: Estimate, path: Path) -> None:
    model = _collect_model(estimate)
    data = estimate.torque[list(TORQUES)].assign(_collect_parameters(estimate))
    if model:
        data = data.assign_coords(input=model["inputs"], output=model["outputs"])
        data["A"] = (("state", "next_state"), model["A"])
        data["B"] = (("state", "input"), model["B"])
        data["C"] = (("output", "state"), model["C"])
        data["D"] = (("output", "input"), model["D"])
        data.attrs["dt"] = model["dt"]
    data.attrs |= {"method": estimate.method, "warnings": _join_warnings(estimate)}
    write_netcdf(data, path)


def _write_mat(estimate: Estimate, path: Path) -> None:
    model = {
        name: np.array(value, dtype=object)[:, None] if isinstance(value, list) else value
        for name, value in _collect_model(estimate).items()
    }
    struct = {
        "method": estimate.method,
        "time": estimate.torque["time"].values[:, None],
        "torque": {name: estimate.torque[name].values[:, None] for name in TORQUES},
        **{name[:MAX_NAME_LENGTH]: value for name, value in _collect_parameters(estimate).items()},
        "model": model or np.empty((0, 0)),
        "warnings": _join_warnings(estimate),
    }
    with atomic_file(path) as partial:
        scipy.io.savemat(partial, {"estimate": struct}, appendmat=False, do_compression=True, oned_as="column")


def _write_csv(estimate: Estimate, path: Path) -> None:
    columns = {"time_s": estimate.torque["time"].values}
    columns |= {f"torque_{name}_nm": estimate.torque[name].values for name in TORQUES}
    with atomic_file(path) as partial:
        pd.DataFrame(columns).to_csv(partial, index=False)
