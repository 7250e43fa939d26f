"""A chunk of a study whose trials are not kept: simulated and identified trial by trial, without a trial file."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
import xarray as xr

from ankleloop.joint.prepared import PreparedTrial
from ankleloop.studies.identification import Methods, Points, identify_trials
from ankleloop.studies.simulation import simulate_points
from ankleloop.trials.files import parse_precision
from ankleloop.trials.trial_files import FailedTrial

PathLike = str | os.PathLike[str]


def sweep_chunk(
    files: Mapping[str, PathLike],
    study: str,
    seed: int,
    conditions: Mapping[str, Mapping[str, Any]],
    points: Points,
    methods: Methods,
    *,
    against: Literal["measured"] | None = None,
    precision: str = "double",
    failures: Literal["stop", "count"] = "count",
) -> list[FailedTrial]:
    """Simulate the trials of a chunk, identify each by every method, and keep scores and parameters.

    The numbers are those of `simulate_chunk` followed by `identify_chunk`, to the last bit: with single precision the
    samples are rounded as they would be in a trial file.
    """
    failed: list[FailedTrial] = []
    simulated = simulate_points(study, seed, conditions, failed, failures)
    index = ((name, number) for name, part in conditions.items() for number in range(part["first"], part["stop"]))
    kind = parse_precision(precision)
    prepared = (
        (trial if isinstance(trial, FailedTrial) else PreparedTrial(_round(trial, kind), validated=True), *key)
        for trial, key in zip(simulated, index, strict=True)
    )
    identify_trials(prepared, files, study, points, methods, against=against, precision=precision, failures=failures)
    return failed


def _round(trial: xr.Dataset, kind: type[np.floating]) -> xr.Dataset:
    """The trial with the samples that it would have in a trial file."""
    if kind is not np.float64:
        for name in trial.data_vars:
            variable = trial.variables[name]
            variable.values = variable.values.astype(kind).astype(float)
    return trial
