"""MATLAB files, v5 and v7.3."""

from functools import partial

import h5py
import numpy as np

from ankleloop import read_trial
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import POSITION, RATE, TORQUE, cut_off, hdf5_file, mat_file

WHOLE = "check that the file is whole"
row = rows_of(read_trial)


def matlab_73(name: str = "a.mat", change=None, **changes):
    """A file as MATLAB writes it with -v7.3: an HDF5 file of rows."""
    rows = {"position": POSITION[None], "torque": TORQUE[None], "fs": np.array([[RATE]]), **changes}
    return hdf5_file(name, change, **rows)


def _rows_of_v5() -> list[BadInput]:
    return [
        row("v5: the file is cut off", cut_off(mat_file()), "a.mat", "ends within the variable", WHOLE),
        row(
            "v5: no such variable",
            mat_file(),
            "a.mat: there is no variable 'angle'",
            "position, torque, fs",
            call=partial(read_trial, position="angle"),
        ),
        row(
            "v5: complex numbers",
            mat_file(position=POSITION + 1j),
            "a.mat: position is of type complex128",
            "convert it",
        ),
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
            "v5: channels of different lengths",
            mat_file(torque=TORQUE[:-1]),
            "a.mat: torque has 299 samples but position has 300",
            "cut all",
        ),
        row(
            "v5: two names of the rate that differ",
            mat_file(sample_rate=1000.0),
            "a.mat: sample_rate is 1000 Hz, but fs is 500 Hz",
            "pass sampling_rate",
        ),
    ]


def _rows_of_v73() -> list[BadInput]:
    return [
        row(
            "v7.3: logical values, which MATLAB stores as numbers",
            matlab_73(change=_label_as_logical),
            "a.mat: torque is of type logical",
            "convert it",
        ),
    ]


def _label_as_logical(file: h5py.File) -> None:
    del file["torque"]
    file["torque"] = (TORQUE > 0).astype(np.uint8)[None]
    file["torque"].attrs["MATLAB_class"] = np.bytes_("logical")


ROWS = [*_rows_of_v5(), *_rows_of_v73()]
