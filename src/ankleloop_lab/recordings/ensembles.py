"""Ensembles of windows around the perturbations of a recording, whose file says where they are."""

from __future__ import annotations

from typing import Any

import numpy as np

from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.methods.registry import identify
from ankleloop.trials.files import PathLike
from ankleloop_lab.files.reading_process import read_channels
from ankleloop_lab.recordings.files import load_recording
from ankleloop_lab.recordings.settings import Recording


def identify_windows(
    path: PathLike, recording: Recording, onsets: str, condition: str, **options: Any
) -> Estimate:
    """Estimate of the windows of a recording by the method `ensemble`.

    `onsets` and `condition` are variables of the file: the time of each onset [s] and the number of its condition; or
    channels over time, a trigger that rises at each onset, and the number of the condition there.
    """
    marks = _read_marks(path, recording, onsets, condition)
    trial = load_recording(path, recording.model_dump())
    if marks["onsets"].size == marks["position"].size:
        first = round(float(trial["time"].values[0]) * trial.attrs["sampling_rate"])
        inside = slice(first, first + trial.sizes["time"])
        trial = trial.assign(
            {name: ("time", marks[name][inside]) for name in ("onsets", "condition")}
        )
        return identify(trial, "ensemble", onsets="onsets", condition="condition", **options)
    return identify(
        trial, "ensemble", onsets=marks["onsets"], condition=marks["condition"], **options
    )


def _read_marks(
    path: PathLike, recording: Recording, onsets: str, condition: str
) -> dict[str, np.ndarray]:
    """Onsets and conditions of a file, as many of one as of the other, and its position."""
    names = {**recording.names, "onsets": onsets, "condition": condition}
    variables = read_channels(path, recording.case, variables=names)
    marks = {name: variables[name].read() for name in ("position", "onsets", "condition")}
    sizes = [marks[name].size for name in ("onsets", "condition")]
    if sizes[0] != sizes[1]:
        raise DataError(
            f"{recording.file}: {onsets} has {sizes[0]} values and {condition} {sizes[1]}: give one condition for each "
            "onset, or both as channels over time."
        )
    return marks
