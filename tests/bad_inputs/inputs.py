"""Good signals, trials and files, which the rows of the table spoil."""

from __future__ import annotations

import gzip
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.io
import xarray as xr

from ankleloop import identify, simulate
from ankleloop.joint.estimate import Estimate
from ankleloop.trials.trial import new_trial, save_trial

RATE = 500.0
TIME = np.arange(300) / RATE
POSITION = 0.02 * np.sin(2 * np.pi * 3 * TIME)
TORQUE = 3.0 * np.cos(2 * np.pi * 3 * TIME)
SIGNALS = {"time": TIME, "position": POSITION, "torque": TORQUE}

Make = Callable[[Path], Any]


def changed(signal: np.ndarray, sample: int, value: float) -> np.ndarray:
    """A copy of a signal with another value at one sample."""
    copy = signal.copy()
    copy[sample] = value
    return copy


def short_trial(**changes: Any) -> xr.Dataset:
    """A valid trial of 0.6 s, with other arguments of new_trial."""
    return new_trial(**{"position": POSITION, "torque": TORQUE, "sampling_rate": RATE, **changes})


@cache
def simulated_trial(**settings: Any) -> xr.Dataset:
    """A simulated trial of 20 s; nobody may change it."""
    return simulate(**{"seed": 1, "duration": 20.0, **settings})


def good_trial(folder: Path) -> xr.Dataset:
    """The simulated trial, for rows where something else is wrong."""
    return simulated_trial()


@cache
def fitted_estimate(method: str = "pr-moesp") -> Estimate:
    """An estimate of the simulated trial."""
    return identify(simulated_trial(), method)


# --- makers of files: each returns a function of the folder, which returns the path


def missing(name: str) -> Make:
    """A path where there is no file."""
    return lambda folder: folder / name


def text_file(name: str, text: str | bytes) -> Make:
    """A file of this text, compressed if its name says so."""

    def make(folder: Path) -> Path:
        content = text if isinstance(text, bytes) else text.encode()
        (folder / name).write_bytes(gzip.compress(content, mtime=0) if name.endswith(".gz") else content)
        return folder / name

    return make


def csv_text(columns: Mapping[str, Any] | None = None, **changes: Any) -> str:
    """Text of a table with the columns time, position and torque, and others that replace or follow them."""
    table = {**SIGNALS, **changes} if columns is None else columns
    lines = [
        ",".join(map(str, cells)) for cells in zip(*(map(_cell, column) for column in table.values()), strict=True)
    ]
    return "\n".join([",".join(table), *lines]) + "\n"


def _cell(value: Any) -> str:
    return value if isinstance(value, str) else repr(float(value))


def csv_file(name: str = "a.csv", **changes: Any) -> Make:
    """A table of the signals."""
    return text_file(name, csv_text(**changes))


def mat_file(name: str = "a.mat", **changes: Any) -> Make:
    """A MATLAB file, v5, of the signals and their rate; None leaves a variable out."""

    def make(folder: Path) -> Path:
        variables = {"position": POSITION, "torque": TORQUE, "fs": RATE, **changes}
        scipy.io.savemat(folder / name, {key: value for key, value in variables.items() if value is not None})
        return folder / name

    return make


def hdf5_file(name: str = "a.h5", change: Callable[[h5py.File], Any] | None = None, **changes: Any) -> Make:
    """An HDF5 file of the signals and their rate, which a function then changes; None leaves a variable out."""

    def make(folder: Path) -> Path:
        variables = {"position": POSITION, "torque": TORQUE, "fs": RATE, **changes}
        with h5py.File(folder / name, "w") as file:
            for key, value in variables.items():
                if value is not None:
                    file[key] = value
            if change is not None:
                change(file)
        return folder / name

    return make


def netcdf_file(name: str = "a.nc", engine: str = "h5netcdf", encoding: Any = None, **changes: Any) -> Make:
    """A NetCDF file of the signals over t, in the classic format with the engine "scipy"; tuples have attributes."""

    def make(folder: Path) -> Path:
        columns = {"position": POSITION, "torque": TORQUE, **changes}
        variables = {
            key: ("t", *value) if isinstance(value, tuple) else ("t", value)
            for key, value in columns.items()
            if value is not None
        }
        data = xr.Dataset(variables, attrs={"sampling_rate": RATE})
        data.to_netcdf(folder / name, engine=engine, encoding=encoding)
        return folder / name

    return make


def trial_file(name: str = "a.nc", **changes: Any) -> Make:
    """A trial that save_trial wrote."""

    def make(folder: Path) -> Path:
        save_trial(short_trial(**changes), folder / name)
        return folder / name

    return make


def spoiled(make: Make, change: Callable[[bytes], bytes]) -> Make:
    """A file with other bytes."""

    def make_spoiled(folder: Path) -> Path:
        path = make(folder)
        path.write_bytes(change(path.read_bytes()))
        return path

    return make_spoiled


def cut_off(make: Make, share: float = 0.5) -> Make:
    """A file whose end is missing."""
    return spoiled(make, lambda content: content[: int(share * len(content))])
