"""MATLAB files, v5 and v7.3."""

from functools import partial
from pathlib import Path

import h5py
import numpy as np
import scipy.io

from ankleloop import read_trial
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import POSITION, RATE, TORQUE, cut_off, hdf5_file, mat_file, renamed, spoiled, text_file

TITLE = "MATLAB files: v5 and v7.3"
WHOLE = "check that the file is whole"
row = rows_of(read_trial)


def matlab_73(name: str = "a.mat", change=None, **changes):
    """A file as MATLAB writes it with -v7.3: an HDF5 file of rows."""
    rows = {"position": POSITION[None], "torque": TORQUE[None], "fs": np.array([[RATE]]), **changes}
    return hdf5_file(name, change, **rows)


def _claim_gigabytes(content: bytes) -> bytes:
    """The first variable of a v5 file says that it takes 2 GiB."""
    return content[:132] + (2**31 - 1).to_bytes(4, "little") + content[136:]


def _flip(content: bytes) -> bytes:
    """Bits of the tag of the first variable are flipped."""
    return content[:128] + bytes(255 - byte for byte in content[128:144]) + content[144:]


def _chunked_claim(folder: Path) -> Path:
    """A v7.3 file whose position claims 2^40 samples, and stores none."""
    with h5py.File(folder / "a.mat", "w") as file:
        file.create_dataset("position", (1, 2**40), "f8", chunks=(1, 2**20))
        file["torque"], file["fs"] = TORQUE[None], [[RATE]]
    return folder / "a.mat"


def _timetable(folder: Path) -> Path:
    """What MATLAB stores of an object: references that only MATLAB reads."""
    opaque = np.array([[3707764736, 2, 1, 1, 1, 1]], dtype=np.uint32)
    scipy.io.savemat(folder / "a.mat", {"data": opaque, "fs": RATE})
    return folder / "a.mat"


def _stored_apart(file: h5py.File) -> None:
    file["position"].attrs["MATLAB_empty"] = np.uint8(1)


def _rows_of_v5() -> list[BadInput]:
    return [
        row("v5: the file is empty", text_file("a.mat", b""), "a.mat", "0 bytes", WHOLE),
        row(
            "v5: text under the name of a MATLAB file",
            text_file("a.mat", "1 2 3\n" * 99),
            "a.mat: cannot be read",
            WHOLE,
        ),
        row("v5: the file is cut off", cut_off(mat_file()), "a.mat", "ends within the variable", WHOLE),
        row("v5: flipped bits in a tag", spoiled(mat_file(), _flip), "a.mat: cannot be read as .mat", WHOLE),
        row(
            "v5: a claim of 2 GiB",
            spoiled(mat_file(), _claim_gigabytes),
            "a.mat: cannot be read as .mat",
            "ends within the variable at byte 128",
        ),
        row(
            "v5: no such variable",
            mat_file(),
            "a.mat: there is no variable 'angle'",
            "position, torque, fs",
            call=partial(read_trial, position="angle"),
        ),
        row("v5: an empty variable", mat_file(torque=[]), "a.mat: torque is empty", "record it"),
        row(
            "v5: complex numbers",
            mat_file(position=POSITION + 1j),
            "a.mat: position is of type complex128",
            "convert it",
        ),
        row("v5: logical values", mat_file(torque=TORQUE > 0), "a.mat: torque is of type", "logical"),
        row("v5: text", mat_file(position="text"), "a.mat: position is not a number at sample 0", "'text'"),
        row(
            "v5: a cell array",
            mat_file(position=np.array([1.0, "b"], dtype=object)),
            "a.mat: position is not a number at sample 1",
        ),
        row(
            "v5: two channels in one variable",
            mat_file(position=np.zeros((300, 2))),
            "a.mat: position has shape (300, 2)",
            "pass a single channel",
        ),
        row(
            "v5: three dimensions",
            mat_file(position=POSITION.reshape(3, 10, 10)),
            "a.mat: position has shape (3, 10, 10)",
            "pass a single channel",
        ),
        row(
            "v5: channels of different lengths",
            mat_file(torque=TORQUE[:-1]),
            "a.mat: torque has 299 samples but position has 300",
            "cut all",
        ),
        row(
            "v5: a struct array",
            mat_file(position=None, r=np.array([{"position": 1.0}, {"position": 2.0}])),
            "a.mat: there is no variable 'position'",
        ),
        row("v5: a timetable", _timetable, "a.mat: there is no variable 'position'", "the file has: data, fs"),
        row("v5: a rate of 0 Hz", mat_file(fs=0.0), "a.mat: sampling_rate must be", "between 0.001 and 1e9 Hz"),
        row(
            "v5: a rate that is not a number",
            mat_file(fs=np.nan),
            "a.mat: sampling_rate must be",
            "between 0.001 and 1e9 Hz",
            "nan",
        ),
        row(
            "v5: a rate as text",
            mat_file(fs="fast"),
            "a.mat: sampling_rate is 'fast' (fs)",
            "pass a single number in Hz",
        ),
        row(
            "v5: two names of the rate that differ",
            mat_file(sample_rate=1000.0),
            "a.mat: sample_rate is 1000 Hz, but fs is 500 Hz",
            "pass sampling_rate",
        ),
        row(
            "v5: nan in the torque",
            mat_file(torque=np.where(np.arange(300) == 9, np.nan, TORQUE)),
            "a.mat: torque is not finite at sample 9",
        ),
    ]


def _rows_of_v73() -> list[BadInput]:
    return [
        row("v7.3: the file is cut off", cut_off(matlab_73()), "a.mat: cannot be read as .mat", WHOLE),
        row(
            "v7.3: an empty array, which MATLAB stores as its size",
            matlab_73(change=_stored_apart),
            "a.mat: position is empty",
        ),
        row(
            "v7.3: complex numbers",
            matlab_73(position=(POSITION + 1j)[None]),
            "a.mat: position is of type complex128",
            "convert it",
        ),
        row(
            "v7.3: characters, which MATLAB stores as numbers",
            matlab_73(change=_label_as_text),
            "a.mat: position is of type char",
            "convert it",
        ),
        row(
            "v7.3: logical values, which MATLAB stores as numbers",
            matlab_73(change=_label_as_logical),
            "a.mat: torque is of type logical",
            "convert it",
        ),
        row(
            "v7.3: a cell array",
            matlab_73(change=_store_references),
            "a.mat: position is not a number at sample 0",
            "correct the file",
        ),
        row(
            "v7.3: a claim of 8 TiB",
            _chunked_claim,
            "a.mat: position has 1,099,511,627,776 samples by its size in the file",
            "LongRecord",
        ),
        row(
            "v7.3: two channels in one variable",
            matlab_73(position=np.zeros((2, 300))),
            "a.mat: position has shape (2, 300)",
        ),
        row("v7.3 named .nc", renamed(matlab_73(), "a.nc"), right=_same_signals),
    ]


def _same_signals(trial) -> None:
    np.testing.assert_array_equal(trial["position"], POSITION)
    np.testing.assert_array_equal(trial["torque"], TORQUE)


def _label_as_text(file: h5py.File) -> None:
    del file["position"]
    file["position"] = np.full((1, 300), 65, dtype=np.uint16) + np.arange(300, dtype=np.uint16) % 2
    file["position"].attrs["MATLAB_class"] = np.bytes_("char")


def _label_as_logical(file: h5py.File) -> None:
    del file["torque"]
    file["torque"] = (TORQUE > 0).astype(np.uint8)[None]
    file["torque"].attrs["MATLAB_class"] = np.bytes_("logical")


def _store_references(file: h5py.File) -> None:
    del file["position"]
    file["#refs#/a"] = POSITION[None]
    file["position"] = np.full((1, 300), file["#refs#/a"].ref, dtype=h5py.ref_dtype)
    file["position"].attrs["MATLAB_class"] = np.bytes_("cell")


ROWS = [*_rows_of_v5(), *_rows_of_v73()]
