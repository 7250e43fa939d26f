"""Calls that write a file."""

from functools import partial
from pathlib import Path

import numpy as np

from ankleloop import LongRecord, identify_file, load_trial, save_trial
from ankleloop.trials.trial_files import save_trials
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import (
    POSITION,
    TORQUE,
    changed,
    hdf5_file,
    missing,
    short_trial,
    simulated_trial,
    text_file,
    trial_file,
)


def save_good_trial(path: Path) -> None:
    """Save a valid trial."""
    save_trial(short_trial(), path)


def save_again(path: Path) -> None:
    """Load a trial, and save it to the file that it is from."""
    save_trial(load_trial(path), path)


def _record(folder: Path) -> Path:
    """A record of 20 s."""
    save_trial(simulated_trial(), folder / "record.nc")
    return folder


def _spoiled_record(folder: Path) -> Path:
    """A record with nan in the torque."""
    trial = simulated_trial()
    torque = changed(trial["torque"].values, 15_000, np.nan)
    hdf5_file("record.h5", position=trial["position"], torque=torque, reference=trial["reference"], fs=None)(folder)
    return folder


def identify_record(folder: Path, record: str = "record.nc", output: str = "torques.nc", rate=None, **options) -> None:
    """Identify a long record, and write its torques."""
    identify_file(LongRecord(folder / record, rate), folder / output, **options)


def _rows_of_saving() -> list[BadInput]:
    trial = partial(rows_of(save_good_trial))
    exists = "the file exists already"
    return [
        trial("a trial over another file", text_file("a.nc", "irreplaceable"), "a.nc", exists, "overwrite=True"),
        trial("a trial over the file that it is from", trial_file(), "a.nc", exists, call=save_again),
        trial(
            "a trial into a folder that does not exist", missing("results/a.nc"), "there is no folder", "make it first"
        ),
    ]


def _rows_of_trial_files() -> list[BadInput]:
    def save(*trials, **options):
        return lambda path: save_trials(trials, path, **options)

    row = partial(rows_of(save_trials))
    longer = short_trial(position=np.tile(POSITION, 2), torque=np.tile(TORQUE, 2))
    return [
        row(
            "trials of two lengths",
            missing("0.nc"),
            "trial 1 of only differs from the first trial",
            "save it in a file of its own",
            call=save(short_trial(), longer),
        ),
    ]


def _rows_of_records() -> list[BadInput]:
    row = partial(rows_of(identify_record))
    onto = partial(identify_record, output="record.nc")
    return [
        row(
            "the record itself as output",
            _record,
            "record.nc: the file is being read",
            "write to another name",
            call=onto,
        ),
        row(
            "nan in the second half of the record",
            _spoiled_record,
            "record.h5: torque is not finite at sample 15000",
            "cut the trial there or repair the channel",
            call=partial(identify_record, record="record.h5", rate=1000.0),
        ),
    ]


ROWS = [*_rows_of_saving(), *_rows_of_trial_files(), *_rows_of_records()]
