"""NetCDF files, classic and 4."""

from functools import partial

import numpy as np

from ankleloop import read_trial
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import POSITION, TIME, changed, cut_off, netcdf_file

WHOLE = "check that the file is whole"
row = rows_of(read_trial)
classic = partial(netcdf_file, engine="scipy")


ROWS: list[BadInput] = [
    row("classic: the file is cut off", cut_off(classic()), "a.nc: not a readable .nc file", WHOLE),
    row("no torque", netcdf_file(torque=None), "a.nc: there is no variable 'torque'", "Name one of these"),
    row(
        "samples that are missing by _FillValue",
        netcdf_file(position=changed(POSITION, 4, np.nan), encoding={"position": {"_FillValue": -1e9}}),
        "a.nc: position is not finite at sample 4",
    ),
    row(
        "times in hours since a date",
        netcdf_file(time=(TIME, {"units": "hours since 2024-01-01"})),
        "a.nc: time is in",
        "write it in seconds, ms or µs",
    ),
]
