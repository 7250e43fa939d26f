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

from ankleloop import identify, new_trial, save_trial, simulate
from ankleloop.joint.estimate import Estimate

RATE = 500.0
TIME = np.arange(300) / RATE
POSITION = 0.02 * np.sin(2 * np.pi * 3 * TIME)
TORQUE = 3.0 * np.cos(2 * np.pi * 3 * TIME)
SIGNALS = {"time": TIME, "position": POSITION, "torque": TORQUE}

Make = Callable[[Path], Any]


def changed(signal: np.ndarray, sample: int, value: float) -> np.ndarray:
    """A copy of a signal with another value at one sample."""
    return np.where(np.arange(signal.size) == sample, value, signal)


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
        (folder / name).write_bytes(
            gzip.compress(content, mtime=0) if name.endswith(".gz") else content
        )
        return folder / name

    return make


def csv_text(columns: Mapping[str, Any] = SIGNALS) -> str:
    """Text of a table with these columns."""
    lines = [",".join(map(str, cells)) for cells in zip(*columns.values(), strict=True)]
    return "\n".join([",".join(columns), *lines]) + "\n"


def csv_file(name: str = "a.csv", **changes: Any) -> Make:
    """A table of the signals, some of which are others."""
    return text_file(name, csv_text({**SIGNALS, **changes}))


def mat_file(**changes: Any) -> Make:
    """A MATLAB file, v5, of the signals and their rate."""

    def make(folder: Path) -> Path:
        scipy.io.savemat(
            folder / "a.mat", {"position": POSITION, "torque": TORQUE, "fs": RATE, **changes}
        )
        return folder / "a.mat"

    return make


def hdf5_file(unit: str = "rad", **changes: Any) -> Make:
    """An HDF5 file of the signals and their rate, with a unit of the position."""

    def make(folder: Path) -> Path:
        with h5py.File(folder / "a.h5", "w") as file:
            for key, value in {
                "position": POSITION,
                "torque": TORQUE,
                "fs": RATE,
                **changes,
            }.items():
                file[key] = value
            file["position"].attrs["units"] = unit
        return folder / "a.h5"

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


def cut_off(make: Make) -> Make:
    """A file whose second half is missing."""
    return spoiled(make, lambda content: content[: len(content) // 2])
