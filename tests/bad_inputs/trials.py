"""Trials from arrays, and what is done with them before an identification."""

import numpy as np
import pandas as pd

from ankleloop import identify, segment, vaf
from bad_inputs.bad_input import rows_of
from bad_inputs.inputs import POSITION, TORQUE, changed, short_trial

WITH_HOLE = np.r_[0:100, 120:300]


def in_unit(name, unit):
    trial = short_trial()
    trial[name].attrs["units"] = unit
    return trial


row = rows_of(lambda arguments: short_trial(**arguments))
identified = rows_of(identify)
cut = rows_of(lambda trial: segment(trial, 5.0, 9.0))
scored = rows_of(lambda estimated: vaf(TORQUE, estimated))

ROWS = [
    row(
        "a matrix",
        {"position": np.zeros((300, 2))},
        "trial: position has shape (300, 2)",
        "pass a single channel",
    ),
    row(
        "one sample more",
        {"torque": np.zeros(301)},
        "trial: torque has 301 samples but position has 300",
        "cut all",
    ),
    row(
        "nan",
        {"position": changed(POSITION, 150, np.nan)},
        "position is not finite at sample 150 (0.3 s)",
    ),
    row(
        "a constant position",
        {"position": np.full(300, 0.1)},
        "position is constant (0.1 at all 300 samples)",
    ),
    row(
        "position in degrees",
        {"position": 2865 * POSITION},
        "trial: position moves at",
        "pass position_unit='deg'",
        remedy={"position_unit": "deg"},
    ),
    row("times", {"time": POSITION}, "trial: time is made from sampling_rate", "do not pass it"),
    row(
        "a rate of 0 Hz",
        {"sampling_rate": 0},
        "trial: sampling_rate must be",
        "between 0.001 and 1e9 Hz, got 0",
    ),
    identified(
        "a table",
        pd.DataFrame({"position": POSITION}),
        "a trial is an xarray.Dataset, not DataFrame",
    ),
    identified(
        "no torque",
        short_trial().drop_vars("torque"),
        "trial: there is no variable torque",
        "new_trial",
    ),
    identified(
        "a hole", short_trial().isel(time=WITH_HOLE), "trial: time is irregular at sample 100"
    ),
    identified(
        "a torque in N·mm",
        in_unit("torque", "N·mm"),
        "torque is in 'N·mm'",
        "convert it to N·m",
    ),
    identified(
        "0.6 s",
        short_trial(reference=POSITION),
        "the record of 0.6 s is too short",
        "Record longer",
    ),
    cut(
        "a segment behind the end",
        short_trial(),
        "the segment from 5 to 9 s has no samples",
        "covers 0 to 0.598 s",
    ),
    scored(
        "nan in the estimate",
        changed(TORQUE, 8, np.nan),
        "the estimated signal is not finite at sample 8",
    ),
]
