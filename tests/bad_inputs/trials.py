"""Trials from arrays, and what is done with them before an identification."""

from functools import partial

import numpy as np
import pandas as pd
import xarray as xr

from ankleloop import identify, new_trial, segment, vaf
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import POSITION, RATE, TORQUE, changed, short_trial


def make_trial(arguments: dict) -> xr.Dataset:
    """Make a trial of these arguments."""
    return new_trial(**{"position": POSITION, "torque": TORQUE, "sampling_rate": RATE, **arguments})


row = partial(rows_of(make_trial))


def arguments(**changes):
    """Arguments of new_trial that differ from the good ones."""
    return lambda folder: changes


def trial(change=None, **changes):
    """A short trial that a function then changes."""

    def make(folder):
        data = short_trial(**changes)
        return data if change is None else change(data)

    return make


def _rows_of_arguments() -> list[BadInput]:
    return [
        row(
            "complex numbers", arguments(position=POSITION + 0j), "trial: position is of type complex128", "convert it"
        ),
        row(
            "a matrix",
            arguments(position=np.zeros((300, 2))),
            "trial: position has shape (300, 2)",
            "pass a single channel",
        ),
        row(
            "one sample more",
            arguments(torque=np.append(TORQUE, 0.0)),
            "trial: torque has 301 samples but position has 300",
            "cut all",
        ),
        row(
            "nan",
            arguments(position=changed(POSITION, 150, np.nan)),
            "trial: position is not finite at sample 150 (0.3 s)",
            "cut the trial there or repair the channel",
        ),
        row(
            "a constant position",
            arguments(position=np.full(300, 0.1)),
            "trial: position is constant (0.1 at all 300 samples)",
        ),
        row(
            "position in degrees",
            arguments(position=50 * POSITION * 180 / np.pi),
            "trial: position moves at",
            "pass position_unit='deg'",
        ),
        row("1e160 rad", arguments(position=1e160 * POSITION), "trial: position reaches 2e+158", "check its unit"),
        row(
            "a rate of 0 Hz",
            arguments(sampling_rate=0),
            "trial: sampling_rate must be",
            "between 0.001 and 1e9 Hz, got 0",
        ),
    ]


def _cut(start, stop):
    def cut_trial(data: xr.Dataset) -> None:
        segment(data, start, stop)

    return cut_trial


def _rows_of_trials() -> list[BadInput]:
    make = rows_of(identify)
    cut = partial(make)
    return [
        make(
            "not a trial but a table",
            lambda folder: pd.DataFrame({"position": POSITION}),
            "a trial is an xarray.Dataset, not DataFrame",
            "new_trial",
        ),
        make(
            "a trial without torque",
            trial(lambda data: data.drop_vars("torque")),
            "trial: there is no variable torque",
            "new_trial",
        ),
        make(
            "a trial with a hole",
            trial(lambda data: data.isel(time=np.r_[0:100, 120:300])),
            "trial: time is irregular at sample 100",
        ),
        make("a trial of 0.6 s", trial(reference=POSITION), "the record of 0.6 s is too short", "Record longer"),
        cut(
            "a segment behind the end",
            trial(),
            "the segment from 5 to 9 s has no samples",
            "the trial covers 0 to 0.598 s",
            call=_cut(5.0, 9.0),
        ),
    ]


def _rows_of_arrays() -> list[BadInput]:
    make = rows_of(lambda signals: vaf(*signals))
    vafs = partial(make)
    return [
        vafs(
            "nan in the estimate",
            lambda folder: (TORQUE, changed(TORQUE, 8, np.nan)),
            "the estimated signal is not finite at sample 8",
        ),
    ]


ROWS = [*_rows_of_arguments(), *_rows_of_trials(), *_rows_of_arrays()]
