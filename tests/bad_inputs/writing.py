"""Calls that write a file."""

from functools import partial
from pathlib import Path

import numpy as np

from ankleloop import LongRecord, identify_file, load_trial, save_estimate, save_trial
from ankleloop.records.trial_files import save_trials
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import (
    POSITION,
    RATE,
    TORQUE,
    changed,
    fitted_estimate,
    hdf5_file,
    missing,
    short_trial,
    simulated_trial,
    text_file,
    trial_file,
)

TITLE = "Writing files"


def save_good_trial(path: Path) -> None:
    """Save a valid trial."""
    save_trial(short_trial(), path)


def save_good_estimate(path: Path) -> None:
    """Save a good estimate."""
    save_estimate(fitted_estimate(), path)


def save_again(path: Path) -> None:
    """Load a trial, and save it to the file that it is from."""
    save_trial(load_trial(path), path)


def _record(folder: Path) -> Path:
    """A record of 20 s."""
    save_trial(simulated_trial(), folder / "record.nc")
    return folder


def _other_name(folder: Path) -> Path:
    """A record, and a link to it."""
    _record(folder)
    (folder / "torques.nc").symlink_to(folder / "record.nc")
    return folder


def _hard_link(folder: Path) -> Path:
    _record(folder)
    (folder / "torques.nc").hardlink_to(folder / "record.nc")
    return folder


def _earlier_result(folder: Path) -> Path:
    _record(folder)
    (folder / "torques.nc").write_text("the torques of last week")
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
    trial = partial(rows_of(save_good_trial), shown="save_trial")
    estimate = partial(rows_of(save_good_estimate), shown="save_estimate")
    exists = "the file exists already"
    return [
        trial("a trial over another file", text_file("a.nc", "irreplaceable"), "a.nc", exists, "overwrite=True"),
        trial("a trial over a recording", hdf5_file("a.nc"), "a.nc", exists, "overwrite=True"),
        trial("a trial over the file that it is from", trial_file(), "a.nc", exists, call=save_again),
        trial(
            "a trial into a folder that does not exist", missing("results/a.nc"), "there is no folder", "make it first"
        ),
        trial("a trial over a folder", lambda folder: folder, "this is a folder", "write to a file in it"),
        trial("a trial under a name that is too long", missing("a" * 300 + ".nc"), "cannot be written", "name"),
        trial("a trial with nan", missing("a.nc"), "a.nc: torque is not finite at sample 3", call=_save_nan),
        trial(
            "a trial that is a number",
            missing("a.nc"),
            "a.nc: a trial is an xarray.Dataset, not float",
            call=lambda path: save_trial(1.0, path),
        ),
        estimate("an estimate over another file", text_file("e.nc", "irreplaceable"), "e.nc", exists, "overwrite=True"),
        estimate(
            "an estimate over another MATLAB file",
            text_file("e.mat", "irreplaceable"),
            "e.mat",
            exists,
            "overwrite=True",
        ),
        estimate("an estimate with an unknown suffix", missing("e.txt"), "e.txt: the file ends in .txt", ".nc or .mat"),
        estimate(
            "an estimate into a folder that does not exist",
            missing("results/e.nc"),
            "there is no folder",
            "make it first",
        ),
        estimate(
            "a trial in place of an estimate",
            missing("e.nc"),
            "estimate must be an Estimate",
            call=lambda path: save_estimate(short_trial(), path),
            error=TypeError,
        ),
    ]


def _save_nan(path: Path) -> None:
    trial = short_trial()
    trial["torque"][3] = np.nan
    save_trial(trial, path)


def _rows_of_trial_files() -> list[BadInput]:
    def save(*trials, **options):
        return lambda path: save_trials(trials, path, **options)

    row = partial(rows_of(save_trials), shown="save_trials")
    longer = short_trial(position=np.tile(POSITION, 2), torque=np.tile(TORQUE, 2))
    other_rate = short_trial(sampling_rate=2 * RATE)
    return [
        row("no trials", missing("0.nc"), "there are no trials to save", call=save()),
        row(
            "trials over another file",
            text_file("0.nc", "irreplaceable"),
            "0.nc",
            "the file exists already",
            call=save(short_trial()),
        ),
        row(
            "trials of two lengths",
            missing("0.nc"),
            "trial 1 of only differs from the first trial",
            "save it in a file of its own",
            call=save(short_trial(), longer),
        ),
        row(
            "trials of two rates",
            missing("0.nc"),
            "trial 1 of only differs from the first trial",
            call=save(short_trial(), other_rate),
        ),
        row(
            "unknown precision",
            missing("0.nc"),
            "unknown precision 'half'; known: double, single",
            call=save(short_trial(), precision="half"),
            error=ValueError,
        ),
    ]


def _rows_of_records() -> list[BadInput]:
    row = partial(rows_of(identify_record), shown="identify_file")
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
            "the record itself, asked to overwrite",
            _record,
            "record.nc: the file is being read",
            call=partial(onto, overwrite=True),
        ),
        row(
            "a link to the record as output", _other_name, "torques.nc: the file is being read", "write to another name"
        ),
        row(
            "a link to the record, asked to overwrite",
            _other_name,
            "torques.nc: the file is being read",
            call=partial(identify_record, overwrite=True),
        ),
        row(
            "another name of the record as output",
            _hard_link,
            "torques.nc: the file is being read",
            call=partial(identify_record, overwrite=True),
        ),
        row("an earlier result as output", _earlier_result, "torques.nc: the file exists already", "overwrite=True"),
        row(
            "an output in a folder that does not exist",
            _record,
            "there is no folder",
            "make it first",
            call=partial(identify_record, output="results/t.nc"),
        ),
        row(
            "nan in the second half of the record",
            _spoiled_record,
            "record.h5: torque is not finite at sample 15000",
            "cut the trial there or repair the channel",
            call=partial(identify_record, record="record.h5", rate=1000.0),
        ),
        row(
            "a method that long records do not have",
            _record,
            "long records are identified by pr-moesp",
            "not by the method 'riv'",
            call=partial(identify_record, method="riv"),
        ),
        row(
            "an unknown option",
            _record,
            "no option 'blok_rows'",
            call=partial(identify_record, blok_rows=3),
            error=TypeError,
        ),
        row(
            "chunks of 0 samples",
            _record,
            "chunk must be between 1 and 1e9 samples, got 0",
            call=partial(identify_record, chunk=0),
            error=ValueError,
        ),
        row(
            "chunks of half a sample",
            _record,
            "chunk must be a whole number",
            call=partial(identify_record, chunk=0.5),
            error=ValueError,
        ),
        row(
            "a path in place of a record",
            _record,
            "record must be an ankleloop.LongRecord",
            "got PosixPath",
            call=lambda folder: identify_file(folder / "record.nc", folder / "t.nc"),
            error=TypeError,
        ),
    ]


ROWS = [*_rows_of_saving(), *_rows_of_trial_files(), *_rows_of_records()]
