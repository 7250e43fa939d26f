"""A chunk of a study whose trials are not kept: simulated and identified trial by trial, without a trial file."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal

import numpy as np
import xarray as xr

from ankleloop.joint.prepared import SHARED_CHANNELS, PreparedTrial, prepare_trials
from ankleloop.records.files import parse_precision
from ankleloop.records.trial_files import FailedTrial
from ankleloop.studies.identification import Methods, Points, Trials, identification_grids, identify_trials
from ankleloop.studies.simulation import simulate_points

__all__ = ["sweep_chunk"]

TOGETHER = 16  # trials that are prepared together, as many as are simulated in one pass
SMALL = 4  # trials of several conditions that are prepared together nevertheless

PathLike = str | os.PathLike[str]
_Numbered = tuple[xr.Dataset | FailedTrial, tuple[str, int]]  # a trial with its condition and its number there


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
    rounded = (_round(trial, parse_precision(precision)) for trial in simulated)
    prepared = _prepare(rounded, index, identification_grids(points, methods))
    identify_trials(prepared, files, study, points, methods, against=against, precision=precision, failures=failures)
    return failed


def _round(trial: xr.Dataset | FailedTrial, kind: type[np.floating]) -> xr.Dataset | FailedTrial:
    """The trial with the samples that it would have in a trial file."""
    if isinstance(trial, xr.Dataset) and kind is not np.float64:
        for name in trial.data_vars:
            variable = trial.variables[name]
            variable.values = variable.values.astype(kind).astype(float)
    return trial


def _prepare(
    trials: Iterator[xr.Dataset | FailedTrial],
    index: Iterator[tuple[str, int]],
    grids: Sequence[tuple[float, float]],
) -> Trials:
    """Prepared trials with their conditions and numbers; some that follow each other share the decimation."""
    count = max(1, TOGETHER // max(1, len(grids)))  # those of many grids take more memory
    for group in _group_alike(zip(trials, index, strict=True), count):
        prepared = deque(_prepare_alike([trial for trial, _ in group if isinstance(trial, xr.Dataset)], grids))
        while group:  # each is freed before the next trials are simulated
            trial, key = group.popleft()
            yield trial if isinstance(trial, FailedTrial) else prepared.popleft(), *key
        del trial


def _group_alike(trials: Iterator[_Numbered], count: int) -> Iterator[deque[_Numbered]]:
    """Groups of trials that follow each other and have one length and rate.

    A group ends with its condition, unless it is small: the trials of one pass of the simulation share their memory.
    """
    group: deque[_Numbered] = deque()
    previous: tuple[int, float] | None = None
    for trial, key in trials:
        form = previous
        if isinstance(trial, xr.Dataset):
            form = (trial.sizes["time"], trial.attrs["sampling_rate"])
        full = len(group) == count or (len(group) > SMALL and group[-1][1][0] != key[0])
        if group and (full or form != (previous or form)):
            yield group
            group = deque()
        previous = form
        group.append((trial, key))
    if group:
        yield group


def _prepare_alike(trials: Sequence[xr.Dataset], grids: Sequence[tuple[float, float]]) -> list[PreparedTrial]:
    """Prepare trials of one length and rate; channels that are constant in all of them are not shared."""
    if not trials:
        return []
    signals = {}
    for name in ("position", *SHARED_CHANNELS):
        if name in trials[0]:
            values = np.stack([trial.variables[name].values for trial in trials])
            if name == "position" or np.ptp(values, axis=1).any():
                signals[name] = values
    return prepare_trials(trials, signals, grids)
