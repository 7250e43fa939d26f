"""A trial in the files in which laboratories keep recordings, for demonstrations and tests of the readers."""

from __future__ import annotations

import math
import os
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import scipy.io
import xarray as xr

from ankleloop.trials.files import atomic_file

MATLAB_HEADER = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, HDF5 schema 1.00 ."
USER_BLOCK = 512  # bytes before the HDF5 file, where MATLAB has its header
UNITS = {"position": "rad", "reference": "rad", "torque": "N·m"}

Channels = dict[str, np.ndarray]


def write_recording(
    trial: xr.Dataset, path: str | os.PathLike[str], file_format: str, *, overwrite: bool = False
) -> None:
    """Write position, torque and reference of a trial as a recording, without the true torques of a simulation."""
    channels = {name: trial[name].values for name in UNITS if name in trial}
    with atomic_file(path, overwrite=overwrite) as partial:
        FILE_FORMATS[file_format][1](partial, trial["time"].values, channels, float(trial.attrs["sampling_rate"]))


def _write_csv(path: Path, time: np.ndarray, channels: Channels, rate: float) -> None:
    columns = {"time_s": time, "angle_deg": channels["position"] * 180.0 / math.pi, "torque_nm": channels["torque"]}
    if "reference" in channels:
        columns["command_deg"] = channels["reference"] * 180.0 / math.pi
    pd.DataFrame(columns).to_csv(path, index=False)


def _write_matlab(path: Path, time: np.ndarray, channels: Channels, rate: float) -> None:
    scipy.io.savemat(path, {**channels, "fs": rate}, appendmat=False, do_compression=True, oned_as="column")


def _write_matlab_hdf5(path: Path, time: np.ndarray, channels: Channels, rate: float) -> None:
    with h5py.File(path, "w", userblock_size=USER_BLOCK) as file:
        for name, values in {**channels, "fs": np.array([rate])}.items():
            # MATLAB counts dimensions the other way round: a column is a row here.
            file.create_dataset(name, data=values[None], compression="gzip")
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
    with open(path, "r+b") as stream:
        stream.write(MATLAB_HEADER.ljust(124) + b"\x00\x02IM")


def _write_hdf5(path: Path, time: np.ndarray, channels: Channels, rate: float) -> None:
    with h5py.File(path, "w") as file:
        file.attrs["sampling_rate"] = rate
        for name, values in channels.items():
            file.create_dataset(name, data=values, compression="gzip", fletcher32=True).attrs["units"] = UNITS[name]


def _write_netcdf(path: Path, time: np.ndarray, channels: Channels, rate: float) -> None:
    variables = {name: ("time", values, {"units": UNITS[name]}) for name, values in channels.items()}
    data = xr.Dataset(variables, coords={"time": ("time", time, {"units": "s"})}, attrs={"sampling_rate": rate})
    data.to_netcdf(path, engine="h5netcdf")


# Suffix of each format, and what writes it.
FILE_FORMATS = {
    "csv": (".csv", _write_csv),
    "matlab-5": (".mat", _write_matlab),
    "matlab-7.3": (".mat", _write_matlab_hdf5),
    "hdf5": (".h5", _write_hdf5),
    "netcdf": (".nc", _write_netcdf),
}
