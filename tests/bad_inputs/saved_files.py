"""Files of this library that are loaded again: trials and estimates."""

from functools import partial
from pathlib import Path

import h5py

from ankleloop import load_estimate, load_trial, save_estimate
from ankleloop.trials.trial_files import load_trials, save_trials
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import (
    cut_off,
    fitted_estimate,
    netcdf_file,
    short_trial,
    spoiled,
    trial_file,
)

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


def _remove(name: str):
    return lambda file: file.__delitem__(name)


def _attribute(name: str, value, group: str = "/"):
    return lambda file: file[group].attrs.__setitem__(name, value)


def _change_in_the_middle(content: bytes) -> bytes:
    """One bit."""
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


def _rows_of_trials() -> list[BadInput]:
    damaged = "it is damaged, or of another origin"
    return [
        row("trial: the file is cut off", cut_off(trial_file()), "a.nc: not a readable NetCDF-4 file", damaged),
        row(
            "trial: a sample has changed",
            spoiled(trial_file(), _change_in_the_middle),
            "a.nc: not a readable NetCDF-4 file",
            "its checksum is wrong",
            "restore it from a copy",
        ),
        row("trial: another program's NetCDF", netcdf_file(), "a.nc: there is no coordinate time"),
    ]


def _rows_of_trial_files() -> list[BadInput]:
    load = partial(rows_of(load_all))
    return [
        load(
            "trials: a sample has changed",
            spoiled(trials_file, _change_in_the_middle),
            "0.nc: not a readable trial file",
            "its checksum is wrong",
            "run again",
        ),
    ]


def _rows_of_estimates() -> list[BadInput]:
    load = rows_of(load_estimate)
    newer = _attribute("format_version", 99)
    return [
        load("estimate: the NetCDF file is cut off", cut_off(estimate_file()), "e.nc: not a readable", "damaged"),
        load("estimate: a trial", trial_file("e.nc"), "e.nc: no estimate file", "save_estimate"),
        load(
            "estimate: written by a newer version",
            changed_file(estimate_file(), newer),
            "e.nc: version 99 of the format",
            "install the newest one",
        ),
        load(
            "estimate: a field of the model is removed",
            changed_file(estimate_file(), _remove("model/A")),
            "e.nc, group model: there is no 'A'",
            "damaged",
        ),
    ]


ROWS = [*_rows_of_trials(), *_rows_of_trial_files(), *_rows_of_estimates()]
