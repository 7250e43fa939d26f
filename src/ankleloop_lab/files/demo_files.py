"""A trial in the files in which laboratories keep recordings, for demonstrations and tests of the readers."""

from __future__ import annotations

import math

import h5py
import pandas as pd
import scipy.io
import xarray as xr

from ankleloop.trials.channels import CHANNELS, VARIABLES
from ankleloop.trials.files import PathLike, atomic_file

FILE_FORMATS = {"csv": ".csv", "matlab-5": ".mat", "hdf5": ".h5"}  # and their suffixes


def write_recording(
    trial: xr.Dataset, path: PathLike, file_format: str, *, overwrite: bool = False
) -> None:
    """Write position, torque and reference of a trial as a recording, without the true torques of a simulation."""
    channels = {name: trial[name].values for name in CHANNELS if name in trial}
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
            with h5py.File(partial, "w") as file:
                file.attrs["sampling_rate"] = rate
                for name, values in channels.items():
                    file[name] = values
                    file[name].attrs["units"] = VARIABLES[name][0]
