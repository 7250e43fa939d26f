"""Files of this library that are loaded again: trials and estimates."""

from functools import partial
from pathlib import Path

import h5netcdf
import h5py
import numpy as np
import scipy.io

from ankleloop import load_estimate, load_trial, read_trial, save_estimate
from ankleloop.records.trial_files import load_trial_of, load_trials, save_trials
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import (
    csv_file,
    cut_off,
    fitted_estimate,
    missing,
    netcdf_file,
    nothing,
    renamed,
    short_trial,
    spoiled,
    text_file,
    trial_file,
)

TITLE = "Files of trials and of estimates"
row = rows_of(load_trial)


def changed_file(make, change):
    """A NetCDF-4 file that a function has changed through the HDF5 library."""

    def make_changed(folder: Path) -> Path:
        path = make(folder)
        with h5py.File(path, "r+") as file:
            change(file)
        return path

    return make_changed


def estimate_file(name: str = "e.nc"):
    """An estimate that save_estimate wrote."""

    def make(folder: Path) -> Path:
        save_estimate(fitted_estimate(), folder / name)
        return folder / name

    return make


def trials_file(folder: Path) -> Path:
    """A file of the trials of a study."""
    save_trials([short_trial(seed=k) for k in range(3)], folder / "0.nc", index=[("gain=2", k) for k in range(3)])
    return folder / "0.nc"


def load_all(path: Path) -> None:
    """Load all trials of a file."""
    list(load_trials(path))


def _set(name: str, sample: int, value: float):
    def change(file: h5py.File) -> None:
        file[name][sample] = value

    return change


def _remove(name: str):
    return lambda file: file.__delitem__(name)


def _attribute(name: str, value, group: str = "/"):
    return lambda file: file[group].attrs.__setitem__(name, value)


def _flip(content: bytes) -> bytes:
    """Bits in the middle of the header of the first object."""
    return content[:100] + bytes(255 - byte for byte in content[100:160]) + content[160:]


def _change_in_the_middle(content: bytes) -> bytes:
    """One bit."""
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


def _mat_of_another_program(folder: Path) -> Path:
    scipy.io.savemat(folder / "e.mat", {"estimate": 3.0})
    return folder / "e.mat"


def _netcdf_of_another_program(folder: Path) -> Path:
    with h5netcdf.File(folder / "e.nc", "w") as file:
        file.attrs["title"] = "measurements"
    return folder / "e.nc"


def _rows_of_trials() -> list[BadInput]:
    damaged = "it is damaged, or of another origin"
    return [
        row("trial: there is no file", missing("a.nc"), "a.nc: there is no such file", "check the path"),
        row("trial: the path is a folder", nothing, "this is a folder", "check the path"),
        row("trial: the file is empty", text_file("a.nc", b""), "a.nc: not a readable NetCDF-4 file", damaged),
        row("trial: a table of text", renamed(csv_file(), "a.nc"), "a.nc: not a readable NetCDF-4 file", damaged),
        row("trial: classic NetCDF", netcdf_file(engine="scipy"), "a.nc: not a readable NetCDF-4 file"),
        row("trial: the file is cut off", cut_off(trial_file()), "a.nc: not a readable NetCDF-4 file", damaged),
        row(
            "trial: flipped bits in the header",
            spoiled(trial_file(), _flip),
            "a.nc: not a readable NetCDF-4 file",
            "it is damaged",
        ),
        row(
            "trial: a sample has changed",
            spoiled(trial_file(), _change_in_the_middle),
            "a.nc: not a readable NetCDF-4 file",
            "its checksum is wrong",
            "restore it from a copy",
        ),
        row(
            "trial: a sample has changed, read as a recording",
            spoiled(trial_file(), _change_in_the_middle),
            "a.nc: bytes have changed since the file was written",
            "restore it from a copy",
            call=read_trial,
            shown="read_trial",
        ),
        row("trial: another program's NetCDF", netcdf_file(), "a.nc: there is no coordinate time"),
        row(
            "trial: the torque is removed",
            changed_file(trial_file(), _remove("torque")),
            "a.nc: there is no variable torque",
        ),
        row(
            "trial: a sample is nan",
            changed_file(trial_file(), _set("torque", 30, np.nan)),
            "a.nc: torque is not finite at sample 30 (0.06 s)",
        ),
        row(
            "trial: a time is moved",
            changed_file(trial_file(), _set("time", 30, 9.0)),
            "a.nc: time is irregular at sample 30",
        ),
        row(
            "trial: another rate",
            changed_file(trial_file(), _attribute("sampling_rate", 50.0)),
            "a.nc: the sampling rate is stated as 50 Hz, but time runs at 500 Hz",
        ),
        row(
            "trial: a rate that is a text",
            changed_file(trial_file(), _attribute("sampling_rate", "fast")),
            "a.nc: sampling_rate is 'fast'",
            "in Hz",
        ),
        row(
            "trial: the unit is set to degrees",
            changed_file(trial_file(), _attribute("units", "deg", "position")),
            "a.nc: position is in 'deg' by its attribute units",
            "convert the samples",
        ),
    ]


def _rows_of_trial_files() -> list[BadInput]:
    load = partial(rows_of(load_all), shown="load_trials")
    return [
        load("trials: there is no file", missing("0.nc"), "0.nc: there is no such file", "check the path"),
        load(
            "trials: the file is cut off",
            cut_off(trials_file),
            "0.nc: not a readable trial file",
            "it is damaged",
            "run again",
        ),
        load(
            "trials: the file is empty",
            text_file("0.nc", b""),
            "0.nc: not a readable trial file",
            "it is damaged",
            "run again",
        ),
        load(
            "trials: a file of one trial",
            trial_file("0.nc"),
            "0.nc: not a readable trial file",
            "which save_trials writes",
            "it has no variable 'number'",
            "of another origin",
        ),
        load(
            "trials: a sample has changed",
            spoiled(trials_file, _change_in_the_middle),
            "0.nc: not a readable trial file",
            "its checksum is wrong",
            "run again",
        ),
        load(
            "trials: an estimate",
            renamed(estimate_file(), "0.nc"),
            "0.nc: not a readable trial file",
            "of another origin",
        ),
        load(
            "trials: a sample of the third trial is nan",
            changed_file(trials_file, lambda file: file["torque"].__setitem__(slice(None), np.nan)),
            "0.nc, trial",
            "torque is not finite",
        ),
        load(
            "trials: no such trial",
            trials_file,
            "no trial file has trial 7 of the point 'gain=2'",
            "check the name and the number",
            call=lambda path: load_trial_of([path], "gain=2", 7),
            shown="load_trial_of",
        ),
    ]


def _rows_of_estimates() -> list[BadInput]:
    load = rows_of(load_estimate)
    newer = _attribute("format_version", 99)
    return [
        load("estimate: there is no file", missing("e.nc"), "e.nc: there is no such file", "check the path"),
        load("estimate: unknown suffix", text_file("e.json", "{}"), "e.json: the file ends in .json", ".nc or .mat"),
        load("estimate: the file is empty", text_file("e.nc", b""), "e.nc: not a readable", "damaged"),
        load("estimate: the NetCDF file is cut off", cut_off(estimate_file()), "e.nc: not a readable", "damaged"),
        load(
            "estimate: a number has changed",
            spoiled(estimate_file(), _change_in_the_middle),
            "e.nc: not a readable",
            "its checksum is wrong",
        ),
        load(
            "estimate: the MATLAB file is cut off", cut_off(estimate_file("e.mat")), "e.mat: not a readable", "damaged"
        ),
        load("estimate: a trial", trial_file("e.nc"), "e.nc: no estimate file", "save_estimate"),
        load("estimate: another program's NetCDF", _netcdf_of_another_program, "e.nc: no estimate file"),
        load(
            "estimate: another program's MATLAB file", _mat_of_another_program, "e.mat: there is no struct 'estimate'"
        ),
        load(
            "estimate: MATLAB v7.3",
            text_file("e.mat", b"MATLAB 7.3 MAT-file" + bytes(600)),
            "e.mat: a MATLAB v7.3 file: save it with -v7",
        ),
        load(
            "estimate: written by a newer version",
            changed_file(estimate_file(), newer),
            "e.nc: version 99 of the format",
            "install the newest ankleloop",
        ),
        load(
            "estimate: a group is removed",
            changed_file(estimate_file(), _remove("stiffness")),
            "e.nc: there is no group 'stiffness'",
            "damaged",
        ),
        load(
            "estimate: a field of the model is removed",
            changed_file(estimate_file(), _remove("model/A")),
            "e.nc, group model: there is no 'A'",
            "damaged",
        ),
        load(
            "estimate: a matrix with nan",
            changed_file(estimate_file(), _set("model/A", 0, np.nan)),
            "e.nc, group model: 'A' is not finite",
            "damaged",
        ),
        load(
            "estimate: a model of unknown kind",
            changed_file(estimate_file(), _attribute("kind", "neural", "model")),
            "e.nc, group model",
            "'neural'",
        ),
        load(
            "estimate: a negative rate",
            changed_file(estimate_file(), _attribute("identification_rate", -100.0, "torque")),
            "e.nc, group torque: the sampling rate is stated as -100 Hz, but time runs at 100 Hz",
            "correct the one that is wrong",
        ),
    ]


ROWS = [*_rows_of_trials(), *_rows_of_trial_files(), *_rows_of_estimates()]
