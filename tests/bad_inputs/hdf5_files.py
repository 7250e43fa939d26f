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
    csv_file,
    cut_off,
    hdf5_file,
    missing,
    nothing,
    renamed,
    spoiled,
    text_file,
)

TITLE = "HDF5 files and long records"
WHOLE = "check that the file is whole"
row = rows_of(read_trial)


def open_record(path: Path, **options) -> None:
    """Open a long record of position and torque, and read all of it."""
    record = LongRecord(path, **{"reference": None, "sampling_rate": RATE, **options})
    record.read(0, record.samples)


record = partial(rows_of(open_record), shown="LongRecord")


def read_record(path: Path):
    """All of a long record."""
    record = LongRecord(path, RATE, reference=None)
    return record.read(0, record.samples)


def _same_torque(piece) -> None:
    np.testing.assert_array_equal(piece["torque"], TORQUE)


def _at_500_hz(trial) -> None:
    assert trial.attrs["sampling_rate"] == RATE


def _scaled(trial) -> None:
    np.testing.assert_allclose(trial["position"], 0.001 * POSITION, rtol=1e-12)


def _unit(name: str, unit):
    def change(file: h5py.File) -> None:
        file[name].attrs["units"] = unit

    return change


def _scale(file: h5py.File) -> None:
    file["position"].attrs["scale_factor"] = 0.001


def _scaled_position(trial) -> None:
    np.testing.assert_allclose(trial["position"], 0.001 * POSITION, rtol=1e-15)


def _link(name: str, link) -> None:
    def change(file: h5py.File) -> None:
        del file[name]
        file[name] = link

    return change


def _link_outside(folder: Path) -> Path:
    """The position is a link to another file, which has it."""
    hdf5_file("b.h5")(folder)
    return hdf5_file(change=_link("position", h5py.ExternalLink("b.h5", "position")))(folder)


def _group(file: h5py.File) -> None:
    del file["position"]
    file["position/samples"] = POSITION


def _loop(file: h5py.File) -> None:
    file["group/again"] = file["/"]


def _claim(folder: Path) -> Path:
    with h5py.File(folder / "a.h5", "w") as file:
        file.create_dataset("position", (2**40,), "f8", chunks=(2**20,))
        file["torque"], file["fs"] = TORQUE, RATE
    return folder / "a.h5"


def _not_written(folder: Path) -> Path:
    """Samples that were reserved and never written read as zeros."""
    with h5py.File(folder / "a.h5", "w") as file:
        file.create_dataset("position", (300,), "f8", chunks=(100,))[:100] = POSITION[:100]
        file["torque"], file["fs"] = TORQUE, RATE
    return folder / "a.h5"


def _flip(content: bytes) -> bytes:
    return content[:40] + bytes(255 - byte for byte in content[40:120]) + content[120:]


def _forbidden(folder: Path) -> Path:
    path = hdf5_file()(folder)
    path.chmod(0)
    return path


def _compound(file: h5py.File) -> None:
    del file["position"]
    file["position"] = np.zeros(300, dtype=[("x", "f8"), ("y", "f8")])


def _rows_of_files() -> list[BadInput]:
    return [
        row("the file is empty", text_file("a.h5", b""), "a.h5", "0 bytes", WHOLE),
        row("the file is cut off", cut_off(hdf5_file()), "a.h5: cannot be read as .h5", WHOLE),
        row("flipped bits in the header", spoiled(hdf5_file(), _flip), "a.h5: cannot be read as .h5", WHOLE),
        row("a table of text named .h5", renamed(csv_file(), "a.h5"), "a.h5: cannot be read as .h5", WHOLE),
        row(
            "a claim of 8 TiB",
            _claim,
            "a.h5: position has 1,099,511,627,776 samples by its size in the file",
            "LongRecord",
        ),
        row(
            "a link to nothing",
            hdf5_file(change=_link("position", h5py.SoftLink("/nowhere"))),
            "a.h5: position is a link to '/nowhere', which is not in the file",
            "name another variable",
        ),
        row(
            "a link to another file",
            _link_outside,
            "a.h5: position is a link to position in another file, b.h5",
            "read that",
        ),
        row(
            "a group in place of a variable",
            hdf5_file(change=_group),
            "a.h5: there is no variable 'position'",
            "position/samples",
        ),
        row("complex numbers", hdf5_file(position=POSITION + 1j), "a.h5: position is of type complex128"),
        row("true and false", hdf5_file(torque=TORQUE > 0), "a.h5: torque is of type bool"),
        row("text", hdf5_file(position=["a", "b"]), "a.h5: position is not a number at sample 0"),
        row("records of several fields", hdf5_file(change=_compound), "a.h5: position is of type"),
        row(
            "a single number as a channel", hdf5_file(torque=1.0), "a.h5: torque has shape ()", "pass a single channel"
        ),
        row("an empty variable", hdf5_file(torque=np.empty(0)), "a.h5: torque is empty", "record it"),
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
            "position in degrees, in bytes",
            hdf5_file(position=degrees, change=_unit("position", b"degree")),
            "a.h5: position is in 'degree'",
            "pass position_unit='deg'",
        ),
        row(
            "position in mrad", hdf5_file(change=_unit("position", "mrad")), "a.h5: position is in 'mrad'", "convert it"
        ),
        row(
            "position in V",
            hdf5_file(change=_unit("position", "V")),
            "a.h5: position is in 'v'",
            "convert it to rad or deg",
        ),
        row(
            "speed in place of the position",
            hdf5_file(change=_unit("position", "rad/s")),
            "a.h5: position is in 'rad/s'",
            "convert it",
        ),
        row(
            "torque in N·mm",
            hdf5_file(change=_unit("torque", "N·mm")),
            "a.h5: torque is in 'N·mm'",
            "convert it to N·m",
        ),
        row("torque in N", hdf5_file(change=_unit("torque", "N")), "a.h5: torque is in 'N'", "convert it to N·m"),
        row("times in ms", hdf5_file(fs=None, time=1000.0 * TIME, change=_unit("time", "ms")), right=_at_500_hz),
        row("a scale_factor that HDF5 does not apply", hdf5_file(change=_scale), right=_scaled),
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
        row(
            "a rate without end", hdf5_file(fs=np.inf), "a.h5: sampling_rate must be", "between 0.001 and 1e9 Hz", "inf"
        ),
    ]


def _rows_of_records() -> list[BadInput]:
    return [
        record("long record: there is no file", missing("a.h5"), "a.h5", "there is no such file"),
        record(
            "long record: the path is a folder",
            lambda folder: nothing(folder),
            "long records are read from .h5, .hdf5, .nc",
            "convert it first",
        ),
        record(
            "long record: a MATLAB file",
            text_file("a.mat", b""),
            "a.mat: long records are read from .h5, .hdf5, .nc",
            "convert it first",
        ),
        record("long record: the file is cut off", cut_off(hdf5_file()), "a.h5", WHOLE),
        record(
            "long record: no such variable",
            hdf5_file(),
            "a.h5: there is no variable 'angle'",
            "position",
            call=partial(open_record, position="angle"),
        ),
        record("long record: a single row", hdf5_file(torque=TORQUE[None]), call=read_record, right=_same_torque),
        record(
            "long record: channels of different lengths",
            hdf5_file(torque=TORQUE[:-1]),
            "a.h5: torque has 299 samples but position has 300",
            "cut all",
        ),
        record("long record: true and false", hdf5_file(torque=TORQUE > 0), "a.h5: torque is of type bool"),
        record("long record: complex numbers", hdf5_file(torque=TORQUE + 1j), "a.h5: torque is of type complex128"),
        record("long record: text", hdf5_file(torque=["1"] * 300), "a.h5: torque is of type object", "convert it"),
        record(
            "long record: nan",
            hdf5_file(torque=changed(TORQUE, 250, np.nan)),
            "a.h5: torque is not finite at sample 250",
            "cut the trial there or repair the channel",
        ),
        record(
            "long record: no rate",
            hdf5_file(fs=None),
            "a.h5: there is no sampling rate",
            "pass sampling_rate in Hz",
            call=partial(open_record, sampling_rate=None),
        ),
        record(
            "long record: a rate of 0 Hz",
            hdf5_file(),
            "a.h5: sampling_rate must be",
            "between 0.001 and 1e9 Hz, got 0.0",
            call=partial(open_record, sampling_rate=0.0),
        ),
        record(
            "long record: position in degrees, as the file says",
            hdf5_file(change=_unit("position", "deg")),
            "a.h5: position is in 'deg'",
            "pass position_unit='deg'",
        ),
        record("long record: a scale_factor", hdf5_file(change=_scale), call=read_record, right=_scaled),
        record(
            "long record: a rate that the times contradict",
            hdf5_file(time=TIME),
            "a.h5: the sampling rate is stated as 1000 Hz, but time runs at 500 Hz",
            call=partial(open_record, sampling_rate=1000.0),
        ),
        record(
            "long record: a gap in time",
            hdf5_file(time=np.where(TIME > 0.3, TIME + 1, TIME)),
            "a.h5: time is irregular at sample 151",
        ),
        record("long record: empty", hdf5_file(position=np.empty(0), torque=np.empty(0)), "a.h5: position is empty"),
    ]


ROWS = [*_rows_of_files(), *_rows_of_attributes(), *_rows_of_records()]
if os.geteuid() != 0:  # the administrator may read every file
    ROWS.append(row("a file that may not be read", _forbidden, "a.h5: cannot be read", "ermission"))
