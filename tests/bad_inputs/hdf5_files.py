"""HDF5 files, whole and as long records."""

import os
from functools import partial
from pathlib import Path

import h5py
import numpy as np

from ankleloop import LongRecord, read_trial
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import (
    POSITION,
    RATE,
    TIME,
    TORQUE,
    changed,
    cut_off,
    hdf5_file,
)

WHOLE = "check that the file is whole"
row = rows_of(read_trial)


def open_record(path: Path, **options) -> None:
    """Open a long record of position and torque, and read all of it."""
    record = LongRecord(path, **{"reference": None, "sampling_rate": RATE, **options})
    record.read(0, record.samples)


record = partial(rows_of(open_record))


def _unit(name: str, unit):
    def change(file: h5py.File) -> None:
        file[name].attrs["units"] = unit

    return change


def _group(file: h5py.File) -> None:
    del file["position"]
    file["position/samples"] = POSITION


def _claim(folder: Path) -> Path:
    with h5py.File(folder / "a.h5", "w") as file:
        file.create_dataset("position", (2**40,), "f8", chunks=(2**20,))
        file["torque"], file["fs"] = TORQUE, RATE
    return folder / "a.h5"


def _forbidden(folder: Path) -> Path:
    path = hdf5_file()(folder)
    path.chmod(0)
    return path


def _rows_of_files() -> list[BadInput]:
    return [
        row("the file is cut off", cut_off(hdf5_file()), "a.h5: not a readable .h5 file", WHOLE),
        row(
            "a claim of 8 TiB",
            _claim,
            "a.h5: position has 1,099,511,627,776 samples by its size in the file",
            "LongRecord",
        ),
        row(
            "a group in place of a variable",
            hdf5_file(change=_group),
            "a.h5: there is no variable 'position'",
            "position/samples",
        ),
        row(
            "masked by a number that stands for missing",
            hdf5_file(position=changed(POSITION, 5, -9999.0)),
            "a.h5: position moves at",
            "look for a spike there",
        ),
    ]


def _rows_of_attributes() -> list[BadInput]:
    degrees = np.rad2deg(POSITION)
    return [
        row(
            "position in degrees, as the file says",
            hdf5_file(position=degrees, change=_unit("position", "deg")),
            "a.h5: position is in 'deg'",
            "pass position_unit='deg'",
        ),
        row(
            "position in V",
            hdf5_file(change=_unit("position", "V")),
            "a.h5: position is in 'V'",
            "convert it to rad or deg",
        ),
        row("torque in N", hdf5_file(change=_unit("torque", "N")), "a.h5: torque is in 'N'", "convert it to N·m"),
        row(
            "radians read as degrees",
            hdf5_file(change=_unit("position", "rad")),
            "a.h5: position is in 'rad'",
            "pass position_unit='rad'",
            call=partial(read_trial, position_unit="deg"),
        ),
        row(
            "a rate per minute",
            hdf5_file(fs=np.array([500.0, 500.0])),
            "a.h5: there is no sampling rate",
            "pass sampling_rate in Hz",
        ),
    ]


def _rows_of_records() -> list[BadInput]:
    return [
        record(
            "long record: no such variable",
            hdf5_file(),
            "a.h5: there is no variable 'angle'",
            "position",
            call=partial(open_record, position="angle"),
        ),
        record(
            "long record: nan",
            hdf5_file(torque=changed(TORQUE, 250, np.nan)),
            "a.h5: torque is not finite at sample 250",
            "cut the trial there or repair the channel",
        ),
        record(
            "long record: a gap in time",
            hdf5_file(time=np.where(TIME > 0.3, TIME + 1, TIME)),
            "a.h5: time is irregular at sample 151",
        ),
    ]


ROWS = [*_rows_of_files(), *_rows_of_attributes(), *_rows_of_records()]
if os.geteuid() != 0:  # the administrator may read every file
    ROWS.append(row("a file that may not be read", _forbidden, "a.h5: the file cannot be opened", "ermission"))
