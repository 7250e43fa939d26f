"""A trial in the files in which laboratories keep recordings, for demonstrations and tests of the readers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import scipy.io
import xarray as xr

from ankleloop.trials.files import PathLike, atomic_file

UNITS = {"position": "rad", "reference": "rad", "torque": "N·m"}
FILE_FORMATS = {"csv": ".csv", "matlab-5": ".mat", "hdf5": ".h5"}  # and their suffixes


def write_recording(
    trial: xr.Dataset, path: PathLike, file_format: str, *, overwrite: bool = False
) -> None:
    """Write position, torque and reference of a trial as a recording, without the true torques of a simulation."""
    channels = {name: trial[name].values for name in UNITS if name in trial}
    rate = float(trial.attrs["sampling_rate"])
    with atomic_file(path, overwrite=overwrite) as partial:
        if file_format == "csv":
            columns = {
                "time_s": trial["time"].values,
                "angle_deg": channels["position"] * 180.0 / math.pi,
                "torque_nm": channels["torque"],
            }
            if "reference" in channels:
                columns["command_deg"] = channels["reference"] * 180.0 / math.pi
            pd.DataFrame(columns).to_csv(partial, index=False)
        elif file_format == "matlab-5":
            variables = {**channels, "fs": rate}
            scipy.io.savemat(
                partial, variables, appendmat=False, do_compression=True, oned_as="column"
            )
        else:
            _write_hdf5(channels, rate, partial)


def _write_hdf5(channels: Mapping[str, np.ndarray], rate: float, path: Path) -> None:
    """Write channels with their units and checksums."""
    with h5py.File(path, "w") as file:
        file.attrs["sampling_rate"] = rate
        for name, values in channels.items():
            data = file.create_dataset(name, data=values, compression="gzip", fletcher32=True)
            data.attrs["units"] = UNITS[name]
