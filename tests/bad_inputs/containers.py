"""MATLAB, HDF5 and NetCDF files."""

from functools import partial
from pathlib import Path

import numpy as np
import xarray as xr

from ankleloop import read_trial
from bad_inputs.bad_input import rows_of
from bad_inputs.inputs import POSITION, RATE, TIME, TORQUE, changed, cut_off, hdf5_file, mat_file


def netcdf_file(position=POSITION, **variables):
    """A NetCDF file of the signals over t, with others beside them."""

    def make(folder: Path) -> Path:
        data = xr.Dataset({"position": ("t", position), "torque": ("t", TORQUE), **variables})
        data.attrs["sampling_rate"] = RATE
        data.to_netcdf(
            folder / "a.nc", engine="h5netcdf", encoding={"position": {"_FillValue": -1e9}}
        )
        return folder / "a.nc"

    return make


DAYS = ("t", TIME, {"units": "days since 2024-01-01"})
CELLS = np.array([1.0, "b"], dtype=object)


def cells(*values):
    """A cell array."""
    array = np.empty(len(values), dtype=object)
    array[:] = values
    return array


row = rows_of(read_trial)
in_radians = partial(read_trial, position_unit="rad")
in_degrees = partial(read_trial, position_unit="deg")

ROWS = [
    row(
        "mat: cut off",
        cut_off(mat_file()),
        "a.mat: not a readable .mat file",
        "check that the file is whole",
    ),
    row(
        "mat: a cell array", mat_file(position=CELLS), "a.mat: position is not a number at sample 1"
    ),
    row(
        "mat: two channels",
        mat_file(position=np.zeros((300, 2))),
        "position (300, 2) is no single channel: name one, counted from 0, as position='position[:, 0]'",
        remedy={"position": "position[:, 0]"},
    ),
    row(
        "mat: two lengths",
        mat_file(torque=TORQUE[1:]),
        "torque has 299 samples but position has 300",
        "cut all",
    ),
    row(
        "mat: two rates",
        mat_file(sample_rate=1000.0),
        "stated as 1000 Hz, but fs runs at 500 Hz",
        remedy={"sampling_rate": None},
    ),
    row(
        "mat: a cell array of trials",
        mat_file(position=cells(POSITION, POSITION), torque=cells(TORQUE, TORQUE)),
        "a.mat: position[*] (2 of (1, 300)) is no single channel",
        "as position='position[0]'",
        remedy={"position": "position[0]", "torque": "torque[0]"},
    ),
    row(
        "mat: an element that is not there",
        mat_file(position=cells(POSITION, POSITION)),
        "a.mat: there is no variable 'position[2]'",
        "position[*] (2 of (1, 300))",
        call=partial(read_trial, position="position[2]"),
    ),
    row(
        "mat: a column that is not there",
        mat_file(data=np.column_stack([POSITION, TORQUE])),
        "a.mat: there is no variable 'data[:, 2]'",
        "data (300, 2)",
        call=partial(read_trial, position="data[:, 2]"),
    ),
    row(
        "hdf5: a single number",
        hdf5_file(position=1.0),
        "a.h5: no variable is called position or pos",
        "the file has: torque.",
        remedy={"position": None},
    ),
    row(
        "netcdf: a single number",
        netcdf_file(torque_reflex=((), 1.0)),
        "a.nc: torque_reflex has 1 sample but position has 300",
    ),
    row(
        "hdf5: cut off",
        cut_off(hdf5_file()),
        "a.h5: not a readable .h5 file",
        "check that the file is whole",
    ),
    row(
        "hdf5: degrees",
        hdf5_file("deg", position=57 * POSITION),
        "position is in 'deg'",
        "pass position_unit='deg'",
        call=in_radians,
        remedy={"position_unit": "deg"},
    ),
    row(
        "hdf5: position in V",
        hdf5_file("V"),
        "a.h5: position is in 'V'",
        "pass the rad per volt as position_unit, or convert it to rad",
        remedy={"position_unit": None},
    ),
    row(
        "hdf5: radians read as degrees",
        hdf5_file(),
        "position is in 'rad'",
        "position_unit='rad'",
        call=in_degrees,
        remedy={"position_unit": "rad"},
    ),
    row(
        "hdf5: two rates",
        hdf5_file(fs=np.array([500.0, 250.0])),
        "a.h5: there is no sampling rate",
        remedy={"sampling_rate": None},
    ),
    row(
        "netcdf: no value",
        netcdf_file(changed(POSITION, 4, np.nan)),
        "a.nc: position is not finite at sample 4",
    ),
    row(
        "netcdf: times in days",
        netcdf_file(time=DAYS),
        "a.nc: time is in",
        "write it in seconds, ms or µs",
    ),
    row(
        "hdf5: nan",
        hdf5_file(torque=changed(TORQUE, 250, np.nan)),
        "torque is not finite at sample 250",
    ),
    row(
        "hdf5: a gap", hdf5_file(time=TIME + (TIME > 0.3)), "a.h5: time is irregular at sample 151"
    ),
]
