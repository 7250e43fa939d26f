"""Estimates as files that other programs read: NetCDF, MATLAB v5, CSV."""

from pathlib import Path

import numpy as np
import pandas as pd
import scipy.io

from ankleloop.errors import DataError
from ankleloop.joint.estimate import TORQUES
from ankleloop.records.files import whole_file, write_netcdf

__all__ = ["export_estimate"]

LONGEST_NAME = 31  # of a variable in a MATLAB v5 file


def export_estimate(estimate, path):
    """Write one estimate to a file for another program.

    The suffix decides. `.nc` and `.mat` hold the torques over time, the matrices A, B, C, D with the names of their
    inputs, K, B_viscosity, I, the reflex parameters and the intervals; `.csv` holds the torques over time.

    Parameters
    ----------
    estimate : Estimate
        The estimate.
    path : path-like
        A file ending in .nc, .mat or .csv, in a folder that exists; it appears when it is complete.

    Raises
    ------
    DataError
        For another suffix.

    Examples
    --------
    >>> import tempfile
    >>> from ankleloop.methods.registry import identify
    >>> from ankleloop.simulation import simulate
    >>> estimate = identify(simulate(seed=1, duration=20.0), "riv")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     export_estimate(estimate, f"{folder}/estimate.mat")
    ...     found = scipy.io.loadmat(f"{folder}/estimate.mat", simplify_cells=True)["estimate"]
    >>> found["K"] == estimate.stiffness["K"], found["model"]["A"].shape
    (True, (2, 2))
    """
    path = Path(path)
    writers = {".nc": _netcdf, ".mat": _matlab, ".csv": _csv}
    if path.suffix not in writers:
        raise DataError(
            f"{path.name}: estimates are exported as {', '.join(writers)}; got {path.suffix or 'no suffix'}."
        )
    writers[path.suffix](estimate, path)


def _parameters(estimate):
    """Numbers by name; the viscosity is not to be taken for the matrix B."""
    names = {"B": "B_viscosity"}
    values = {names.get(name, name): value for name, value in (estimate.stiffness | estimate.reflex).items()}
    for name, (low, high) in estimate.intervals.items():
        values |= {f"{names.get(name, name)}_low": low, f"{names.get(name, name)}_high": high}
    return values


def _model(estimate):
    m = estimate.matrices
    if m is None:
        return {}
    inputs, outputs = m.names if m.names is not None else ((), ())
    return {"A": m.A, "B": m.B, "C": m.C, "D": m.D, "dt": m.dt, "inputs": list(inputs), "outputs": list(outputs)}


def _netcdf(estimate, path):
    model = _model(estimate)
    data = estimate.torque[list(TORQUES)].copy()
    for name, value in _parameters(estimate).items():
        data[name] = float(value)
    if model:
        data = data.assign_coords(input=model["inputs"], output=model["outputs"])
        data["A"] = (("state", "next_state"), model["A"])
        data["B"] = (("state", "input"), model["B"])
        data["C"] = (("output", "state"), model["C"])
        data["D"] = (("output", "input"), model["D"])
        data.attrs["dt"] = model["dt"]
    data.attrs["method"] = estimate.method
    data.attrs["warnings"] = " ".join(estimate.diagnostics.get("warnings", ()))
    write_netcdf(data, path)


def _matlab(estimate, path):
    torque = {name: estimate.torque[name].values[:, None] for name in TORQUES}
    model = {
        name: np.array(value, dtype=object)[:, None] if isinstance(value, list) else value
        for name, value in _model(estimate).items()
    }
    struct = {
        "method": estimate.method,
        "time": estimate.torque["time"].values[:, None],
        "torque": torque,
        **{name[:LONGEST_NAME]: float(value) for name, value in _parameters(estimate).items()},
        "model": model or np.empty((0, 0)),
        "warnings": " ".join(estimate.diagnostics.get("warnings", ())),
    }
    with whole_file(path) as unfinished:
        scipy.io.savemat(unfinished, {"estimate": struct}, appendmat=False, do_compression=True, oned_as="column")


def _csv(estimate, path):
    table = pd.DataFrame(
        {"time_s": estimate.torque["time"].values}
        | {f"torque_{name}_nm": estimate.torque[name].values for name in TORQUES}
    )
    with whole_file(path) as unfinished:
        table.to_csv(unfinished, index=False)
