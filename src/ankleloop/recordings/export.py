"""Estimates as files for other programs: whole ones as NetCDF or MATLAB v5, torques as CSV."""

from __future__ import annotations

import os
from pathlib import Path

import pandas as pd

from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.estimate_files import save_estimate
from ankleloop.joint.regressors import TORQUES
from ankleloop.trials.files import atomic_file, source_files

SUFFIXES = (".nc", ".mat", ".csv")


def export_estimate(estimate: Estimate, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write one estimate to a file for another program.

    `.nc` and `.mat` are the files of `ankleloop.save_estimate`, with torques, model, parameters, intervals and
    diagnostics; `.csv` is a table of the torques over time.

    Parameters
    ----------
    estimate : Estimate
        The estimate.
    path : path-like
        A file ending in .nc, .mat or .csv, in a folder that exists; it appears when it is complete.
    overwrite : bool
        Whether to replace a file of this name; without it an existing file is refused.

    Raises
    ------
    DataError
        For another suffix, if the file exists or the estimate is read from it, or if it cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> import scipy.io
    >>> from ankleloop.methods.registry import identify
    >>> from ankleloop.simulation.simulate import simulate
    >>> estimate = identify(simulate(seed=1, duration=20.0), "riv")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     export_estimate(estimate, f"{folder}/estimate.mat")
    ...     exported = scipy.io.loadmat(f"{folder}/estimate.mat", simplify_cells=True)["estimate"]
    >>> exported["stiffness"]["K"] == estimate.stiffness["K"], exported["model"]["A"].shape
    (True, (2, 2))
    """
    path = Path(path)
    if path.suffix not in SUFFIXES:
        raise DataError(
            f"{path.name}: estimates are exported as {', '.join(SUFFIXES)}; got {path.suffix or 'no suffix'}."
        )
    if path.suffix != ".csv":
        save_estimate(estimate, path, overwrite=overwrite)
        return
    columns = {"time_s": estimate.torque["time"].values}
    columns |= {f"torque_{name}_nm": estimate.torque[name].values for name in TORQUES}
    with atomic_file(path, overwrite=overwrite, inputs=source_files(estimate.torque)) as partial:
        pd.DataFrame(columns).to_csv(partial, index=False)
