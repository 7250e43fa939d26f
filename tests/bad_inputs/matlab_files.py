"""MATLAB files."""

from functools import partial

import numpy as np

from ankleloop import read_trial
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import POSITION, TORQUE, cut_off, mat_file

WHOLE = "check that the file is whole"
row = rows_of(read_trial)


ROWS: list[BadInput] = [
    row("v5: the file is cut off", cut_off(mat_file()), "a.mat", "ends within a variable", WHOLE),
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
        "a.mat: the sampling rate is stated as 1000 Hz, but sample_rate and fs runs at 500 Hz",
        "pass sampling_rate",
    ),
]
