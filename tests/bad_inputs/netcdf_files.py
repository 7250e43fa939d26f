"""NetCDF files, classic and 4."""

from functools import partial
from pathlib import Path

import h5netcdf
import numpy as np

from ankleloop import read_trial
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import POSITION, RATE, TIME, TORQUE, changed, cut_off, netcdf_file, spoiled, text_file

TITLE = "NetCDF files: classic and 4"
WHOLE = "check that the file is whole"
row = rows_of(read_trial)
classic = partial(netcdf_file, engine="scipy")


def _invalid_packing(folder: Path) -> Path:
    """Integers with a scale that is a text."""
    with h5netcdf.File(folder / "a.nc", "w") as file:
        file.dimensions = {"t": 300}
        for name in ("position", "torque"):
            file.create_variable(name, ("t",), "i4")[:] = np.arange(300) % 7
        file["position"].attrs["scale_factor"] = "small"
        file.attrs["fs"] = RATE
    return folder / "a.nc"


def _claim_samples(content: bytes) -> bytes:
    """The dimension t, the first of the header, has 2^31 - 1 samples."""
    place = content.index((300).to_bytes(4, "big"))
    return content[:place] + (2**31 - 1).to_bytes(4, "big") + content[place + 4 :]


def _at_500_hz(trial) -> None:
    assert trial.attrs["sampling_rate"] == RATE


def _packed_as_its_numbers(trial) -> None:
    np.testing.assert_allclose(trial["position"], POSITION, atol=1e-9)


ROWS: list[BadInput] = [
    row("the file is empty", text_file("a.nc", b""), "a.nc", "0 bytes", WHOLE),
    row(
        "text under the name of a NetCDF file", text_file("a.nc", "netcdf a { }"), "a.nc: cannot be read as .nc", WHOLE
    ),
    row("classic: the file is cut off", cut_off(classic()), "a.nc: cannot be read as .nc", WHOLE),
    row("4: the file is cut off", cut_off(netcdf_file()), "a.nc: cannot be read as .nc", WHOLE),
    row(
        "classic: a dimension of 2 147 483 647 samples",
        spoiled(classic(), _claim_samples),
        "a.nc: cannot be read as .nc",
        "check that the file is whole",
    ),
    row(
        "classic: version byte 9",
        spoiled(classic(), lambda content: b"CDF\x09" + content[4:]),
        "a.nc: cannot be read as .nc",
        WHOLE,
    ),
    row(
        "classic: characters as a channel",
        classic(torque=np.array([b"a"] * 300)),
        "a.nc: torque is not a number at sample 0 but b'a'",
        "correct the file",
    ),
    row("4: text as a channel", netcdf_file(torque=np.array(["a"] * 300)), "a.nc: torque is not a number at sample 0"),
    row("no torque", netcdf_file(torque=None), "a.nc: there is no variable 'torque'", "Name one of these"),
    row(
        "samples that are missing by _FillValue",
        netcdf_file(position=changed(POSITION, 4, np.nan), encoding={"position": {"_FillValue": -1e9}}),
        "a.nc: position is not finite at sample 4",
    ),
    row(
        "integers with a scale_factor",
        netcdf_file(encoding={"position": {"dtype": "int32", "scale_factor": 1e-9, "_FillValue": -(2**31)}}),
        right=_packed_as_its_numbers,
    ),
    row(
        "a scale_factor that is a text",
        _invalid_packing,
        "a.nc: scale_factor of position is no finite number",
        "correct the file",
    ),
    row(
        "position in degrees, as the file says",
        netcdf_file(position=(np.rad2deg(POSITION), {"units": "degrees"})),
        "a.nc: position is in 'degrees'",
        "pass position_unit='deg'",
    ),
    row("torque in kg·m", netcdf_file(torque=(TORQUE, {"units": "kg m"})), "a.nc: torque is in 'kg m'", "N·m"),
    row("times in ms", netcdf_file(time=(1000 * TIME, {"units": "ms"})), right=_at_500_hz),
    row(
        "times in hours since a date",
        netcdf_file(time=(TIME, {"units": "hours since 2024-01-01"})),
        "a.nc: time is in",
        "write it in seconds, ms or µs",
    ),
    row(
        "a rate that the times contradict",
        netcdf_file(time=(2 * TIME, {"units": "s"})),
        "a.nc: the sampling rate is stated as 500 Hz, but time runs at 250 Hz",
    ),
    row(
        "a reference that the file does not have",
        netcdf_file(),
        "a.nc: there is no variable 'command'",
        "Name one of these",
        call=partial(read_trial, reference="command"),
    ),
]
