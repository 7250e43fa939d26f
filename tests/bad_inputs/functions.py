"""Functions of submodules that the documentation names."""

from functools import partial

from ankleloop import DataError, identify
from ankleloop.methods.selection import select_options
from ankleloop.recordings.files import export_estimate, load_recording
from bad_inputs.bad_input import BadInput
from bad_inputs.inputs import (
    fitted_estimate,
    mat_file,
    missing,
    simulated_trial,
)


def row(wrong, call, *says, make=lambda folder: None, error=DataError, **outcome) -> BadInput:
    """A row of a call that takes what `make` returns."""
    return BadInput(wrong, make, call, says, error=error, **outcome)


def _a_trial(folder):
    return simulated_trial()


def _rows_of_identification() -> list[BadInput]:
    fit = partial(identify, method="pr-moesp")
    return [
        row(
            "folds shorter than a selection needs",
            lambda trial: select_options(trial, fit, {"order": [1, 2]}),
            "a selection needs 8 s",
            "Record longer",
            make=lambda folder: simulated_trial(duration=6.0),
        ),
        row(
            "a prediction by a method without a model",
            lambda trial: fitted_estimate("real-time").predict(trial),
            "real-time has no fixed model to predict with",
            make=_a_trial,
        ),
    ]


def _rows_of_files() -> list[BadInput]:
    return [
        row(
            "an export with an unknown suffix",
            lambda path: export_estimate(fitted_estimate(), path),
            "e.txt",
            ".mat",
            make=missing("e.txt"),
        ),
        row(
            "a recording whose part has no samples",
            lambda path: load_recording(path, {"file": "a.mat", "start": 5.0, "stop": 9.0}),
            "a.mat: the segment from 5 to 9 s has no samples",
            "the trial covers 0 to 0.598 s",
            make=mat_file(),
        ),
    ]


ROWS = [*_rows_of_identification(), *_rows_of_files()]
