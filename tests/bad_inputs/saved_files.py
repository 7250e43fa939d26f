"""Files of this library that are loaded again, and calls that write a file."""

from pathlib import Path

import h5py

from ankleloop import (
    load_estimate,
    load_trial,
    save_estimate,
    save_trial,
)
from ankleloop.trials.trial_files import load_trials, save_trials
from ankleloop_lab.recordings.files import export_estimate, load_recording
from bad_inputs.bad_input import rows_of
from bad_inputs.inputs import (
    cut_off,
    fitted_estimate,
    mat_file,
    missing,
    short_trial,
    spoiled,
    text_file,
    trial_file,
)


def estimate_file(folder: Path) -> Path:
    """An estimate that save_estimate wrote."""
    save_estimate(fitted_estimate(), folder / "e.nc")
    return folder / "e.nc"


def newer_file(folder: Path) -> Path:
    """An estimate of a version that is yet to come."""
    with h5py.File(estimate_file(folder), "r+") as file:
        file.attrs["format_version"] = 99
    return folder / "e.nc"


def trials_file(folder: Path) -> Path:
    """A file of the trials of a study."""
    save_trials(
        [short_trial(seed=k) for k in range(3)],
        folder / "0.nc",
        index=[("gain=2", k) for k in range(3)],
    )
    return folder / "0.nc"


def flip_a_bit(content: bytes) -> bytes:
    """One bit in the middle."""
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


row = rows_of(load_trial)
trials = rows_of(lambda path: list(load_trials(path)))
estimate = rows_of(load_estimate)
saved = rows_of(lambda path: save_trial(short_trial(), path))
exported = rows_of(lambda path: export_estimate(fitted_estimate(), path))
loaded = rows_of(lambda path: load_recording(path, {"file": path.name, "start": 5.0, "stop": 9.0}))

ROWS = [
    row(
        "trial: cut off",
        cut_off(trial_file()),
        "a.nc: not a readable NetCDF-4 file",
        "it is damaged",
    ),
    row(
        "trial: a sample has changed",
        spoiled(trial_file(), flip_a_bit),
        "a.nc",
        "checksum is wrong",
        "a copy",
    ),
    row("trial: an estimate", estimate_file, "e.nc: there is no variable position", "new_trial"),
    trials(
        "trials: a sample has changed",
        spoiled(trials_file, flip_a_bit),
        "0.nc",
        "checksum is wrong",
        "run again",
    ),
    estimate("estimate: cut off", cut_off(estimate_file), "e.nc: not a readable", "damaged"),
    estimate("estimate: a trial", trial_file("e.nc"), "e.nc: no estimate file", "save_estimate"),
    estimate(
        "estimate: a newer version",
        newer_file,
        "e.nc: version 99 of the format",
        "install the newest",
    ),
    saved(
        "a trial over another file",
        text_file("a.nc", "irreplaceable"),
        "a.nc",
        "exists already",
        "overwrite=True",
        remedy={"overwrite": True},
    ),
    saved("a trial into no folder", missing("results/a.nc"), "there is no folder", "make it first"),
    exported("an export with an unknown suffix", missing("e.txt"), "e.txt", ".mat"),
    loaded(
        "a part without samples",
        mat_file(),
        "a.mat: the segment from 5 to 9 s has no samples",
        "0 to 0.598 s",
    ),
]
