"""Trials from arrays, and what is done with them before an identification."""

from functools import partial

import numpy as np
import pandas as pd
import xarray as xr

from ankleloop import identify, new_trial, segment, vaf
from ankleloop.records.drift import remove_drift
from ankleloop.signals.decimation import decimate
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import POSITION, RATE, TIME, TORQUE, changed, short_trial

TITLE = "Trials from arrays"


def make_trial(arguments: dict) -> xr.Dataset:
    """Make a trial of these arguments."""
    return new_trial(**{"position": POSITION, "torque": TORQUE, "sampling_rate": RATE, **arguments})


row = partial(rows_of(make_trial), shown="new_trial")


def arguments(**changes):
    """Arguments of new_trial that differ from the good ones."""
    return lambda folder: changes


def trial(change=None, **changes):
    """A short trial that a function then changes."""

    def make(folder):
        data = short_trial(**changes)
        return data if change is None else change(data)

    return make


def _units(data: xr.Dataset) -> xr.Dataset:
    data["position"].attrs["units"] = "deg"
    return data


def _rows_of_arguments() -> list[BadInput]:
    masked = np.ma.masked_array(POSITION, TIME[17] == TIME)
    return [
        row("no position", arguments(position=None), "trial: there is no position", "pass it as a 1-D array"),
        row("an empty position", arguments(position=[]), "trial: position is empty", "record it"),
        row(
            "complex numbers", arguments(position=POSITION + 0j), "trial: position is of type complex128", "convert it"
        ),
        row("true and false", arguments(torque=TORQUE > 0), "trial: torque is of type bool", "convert it"),
        row("numbers as text", arguments(torque=["1", "2"]), "trial: torque is of type", "convert it"),
        row(
            "a list of lists of different lengths",
            arguments(torque=[[1.0], [1.0, 2.0]]),
            "trial: torque is of type object",
            "convert it",
        ),
        row("a dictionary", arguments(torque={"a": 1}), "trial: torque is of type object", "convert it"),
        row("dates", arguments(torque=pd.date_range("2024-01-01", periods=300)), "trial: torque is of type datetime64"),
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
        row("a single sample", arguments(position=[0.0], torque=[0.0]), "trial: time has 1 sample", "at least 2"),
        row(
            "nan",
            arguments(position=changed(POSITION, 150, np.nan)),
            "trial: position is not finite at sample 150 (0.3 s)",
            "cut the trial there or repair the channel",
        ),
        row("-inf", arguments(reference=changed(POSITION, 3, -np.inf)), "trial: reference is not finite at sample 3"),
        row("a masked sample", arguments(position=masked), "trial: position is not finite at sample 17"),
        row(
            "a constant position",
            arguments(position=np.full(300, 0.1)),
            "trial: position is constant (0.1 at all 300 samples)",
        ),
        row(
            "a position constant but for rounding",
            arguments(position=0.1 + 1e-17 * TORQUE),
            "trial: position is constant",
        ),
        row(
            "position in degrees",
            arguments(position=50 * POSITION * 180 / np.pi),
            "trial: position moves at",
            "pass position_unit='deg'",
        ),
        row("1e160 rad", arguments(position=1e160 * POSITION), "trial: position reaches 2e+158", "check its unit"),
        row(
            "1e-160 rad",
            arguments(position=1e-160 * POSITION),
            "trial: position varies by 4e-162",
            "check its unit and its scale",
        ),
        row(
            "1e200 N·m",
            arguments(torque=1e200 * TORQUE),
            "trial: torque reaches 3e+200",
            "check its unit and its scale",
        ),
        row(
            "integers that fit no float",
            arguments(torque=[10**400] * 300),
            "trial: torque is of type object",
            "convert it",
        ),
        row(
            "a rate of 0 Hz",
            arguments(sampling_rate=0),
            "trial: sampling_rate must be",
            "between 0.001 and 1e9 Hz, got 0",
        ),
        row(
            "a negative rate",
            arguments(sampling_rate=-500.0),
            "trial: sampling_rate must be",
            "between 0.001 and 1e9 Hz, got -500.0",
        ),
        row("no rate", arguments(sampling_rate=None), "trial: sampling_rate is None", "pass a single number in Hz"),
        row("a rate as text", arguments(sampling_rate="500"), right=_at_500_hz),
        row("a rate that is true", arguments(sampling_rate=True), "trial: sampling_rate must be", "got True"),
        row("a complex rate", arguments(sampling_rate=500j), "trial: sampling_rate is 500j"),
        row("two rates", arguments(sampling_rate=[500.0, 500.0]), "trial: sampling_rate is [500.0, 500.0]"),
        row(
            "a further channel of another length",
            arguments(emg=TORQUE[:5]),
            "trial: emg has 5 samples but position has 300",
        ),
        row(
            "a further channel with nan",
            arguments(emg=changed(TORQUE, 4, np.nan)),
            "trial: emg is not finite at sample 4",
        ),
        row(
            "an attribute in bytes", arguments(subject=b"S1"), "trial: the attribute subject is b'S1'", "pass a string"
        ),
        row("times beside the rate", arguments(time=TIME), "trial: time is made from sampling_rate", "do not pass it"),
        row("an attribute that no file keeps", arguments(subject={"name": "S1"}), "trial: the attribute subject"),
        row("an attribute beyond 64 bits", arguments(seed=2**80), "trial: the attribute seed is", "64-bit integer"),
    ]


def _cut(start, stop):
    def cut_trial(data: xr.Dataset) -> None:
        segment(data, start, stop)

    return cut_trial


def _whole(data: xr.Dataset) -> None:
    assert data.sizes["time"] == 300


def _rows_of_trials() -> list[BadInput]:
    make = rows_of(identify)
    cut, drift = partial(make, shown="segment"), partial(make, shown="remove_drift")
    return [
        make(
            "not a trial but a table",
            lambda folder: pd.DataFrame({"position": POSITION}),
            "a trial is an xarray.Dataset, not DataFrame",
            "new_trial",
        ),
        make("nothing at all", lambda folder: None, "a trial is an xarray.Dataset, not NoneType", "new_trial"),
        make(
            "a path in place of a trial",
            lambda folder: "trial.csv",
            "a trial is an xarray.Dataset, not str",
            "new_trial",
        ),
        make(
            "a trial without torque",
            trial(lambda data: data.drop_vars("torque")),
            "trial: there is no variable torque",
            "new_trial",
        ),
        make(
            "a trial without a rate",
            trial(lambda data: data.drop_attrs()),
            "trial: the attribute sampling_rate is missing",
            "in Hz",
        ),
        make(
            "a trial whose units were set to degrees",
            trial(_units),
            "trial: position is in 'deg' by its attribute units",
            "convert the samples",
        ),
        make(
            "single precision", trial(lambda data: data.astype("f4")), "trial: position is of type float32", "new_trial"
        ),
        make(
            "a torque over another dimension",
            trial(lambda data: data.assign(torque=("x", TORQUE))),
            "trial: torque has shape (300,) over ('x',)",
        ),
        make(
            "a trial with every other sample",
            trial(lambda data: data.isel(time=slice(None, None, 2))),
            "trial: the sampling rate is stated as 500 Hz, but time runs at 250 Hz",
        ),
        make(
            "a trial with a hole",
            trial(lambda data: data.isel(time=np.r_[0:100, 120:300])),
            "trial: time is irregular at sample 100",
        ),
        make(
            "a trial put together out of order",
            trial(lambda data: data.isel(time=np.r_[150:300, 0:150])),
            "trial: time is irregular at sample 150",
        ),
        make("a trial of 0.6 s", trial(reference=POSITION), "the record of 0.6 s is too short", "Record longer"),
        make("an empty list of trials", lambda folder: [], "there are no trials to merge"),
        cut(
            "a segment behind the end",
            trial(),
            "the segment from 5 to 9 s has no samples",
            "the trial covers 0 to 0.598 s",
            call=_cut(5.0, 9.0),
        ),
        cut(
            "a segment that ends before it starts",
            trial(),
            "the segment from 0.4 to 0.2 s has no samples",
            call=_cut(0.4, 0.2),
        ),
        cut(
            "a segment from nan",
            trial(),
            "start must be a finite number [s], got nan",
            call=_cut(float("nan"), 0.5),
            error=ValueError,
        ),
        cut("a segment longer than the trial", trial(), call=lambda data: segment(data, 0.0, 50.0), right=_whole),
        cut(
            "a segment between texts",
            trial(),
            "start must be a finite number [s], got '0'",
            call=_cut("0", "1"),
            error=ValueError,
        ),
        drift(
            "drift of degree 0.5",
            trial(),
            "degree must be a whole number between 0 and 10, got 0.5",
            call=lambda data: remove_drift(data, 0.5),
            error=ValueError,
        ),
        drift(
            "drift of degree 99",
            trial(),
            "degree must be a whole number between 0 and 10, got 99",
            call=lambda data: remove_drift(data, 99),
            error=ValueError,
        ),
        drift(
            "a torque that is nothing but drift",
            trial(torque=TIME),
            "there is nothing but drift in it",
            call=lambda data: remove_drift(data, 1),
        ),
    ]


def _at_500_hz(trial: xr.Dataset) -> None:
    assert trial.attrs["sampling_rate"] == RATE


def _vaf_of_small_signals(value: float) -> None:
    assert abs(value - vaf(TORQUE, TORQUE + POSITION)) < 1e-9


def _rows_of_arrays() -> list[BadInput]:
    make = rows_of(lambda signals: vaf(*signals))
    vafs = partial(make, shown="vaf")
    decimated = partial(make, shown="decimate")
    return [
        vafs(
            "signals of different lengths",
            lambda folder: (TORQUE, TORQUE[1:]),
            "(300,)",
            "(299,)",
            "cut both to the same samples",
        ),
        vafs("a constant signal", lambda folder: (np.ones(300), TORQUE), "the measured signal is constant"),
        vafs(
            "nan in the estimate",
            lambda folder: (TORQUE, changed(TORQUE, 8, np.nan)),
            "the estimated signal is not finite at sample 8",
        ),
        vafs("empty signals", lambda folder: ([], []), "VAF needs signals of at least 2 samples, got 0"),
        vafs("complex signals", lambda folder: (TORQUE + 1j, TORQUE), "must be an array of real numbers"),
        vafs("signals of true and false", lambda folder: (TORQUE > 0, TORQUE), "must be an array of real numbers"),
        vafs(
            "signals as text",
            lambda folder: (["1", "2"], ["1", "2"]),
            "the measured signal must be an array of real numbers",
        ),
        vafs("matrices", lambda folder: (np.eye(3), np.eye(3)), "(3, 3)", "1-D"),
        vafs(
            "signals of 1e200",
            lambda folder: (1e200 * TORQUE, 1e200 * (TORQUE + POSITION)),
            right=_vaf_of_small_signals,
        ),
        decimated(
            "a factor of 0",
            lambda folder: TORQUE,
            "factor must be between 1 and 10000 samples, got 0",
            call=lambda x: decimate(x, 0, 100, 5),
            error=ValueError,
        ),
        decimated(
            "a factor of 2.5",
            lambda folder: TORQUE,
            "factor must be a whole number between 1 and 10000 samples, got 2.5",
            call=lambda x: decimate(x, 2.5, 100, 5),
            error=ValueError,
        ),
        decimated(
            "a signal shorter than the filter",
            lambda folder: TORQUE[:9],
            "a record of 9 samples is too short: decimation by 10",
            "Record longer",
            call=lambda x: decimate(x, 10, 0, 1),
        ),
    ]


ROWS = [*_rows_of_arguments(), *_rows_of_trials(), *_rows_of_arrays()]
