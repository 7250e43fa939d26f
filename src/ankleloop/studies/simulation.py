"""Simulation of a chunk of trials into a trial file."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator, Mapping
from typing import Any, Literal

import xarray as xr
from numpy.random import SeedSequence

from ankleloop.errors import NUMERICAL_ERRORS
from ankleloop.simulation.simulate import simulate
from ankleloop.studies.failures import describe_error, locate_errors
from ankleloop.studies.seeds import trial_entropy
from ankleloop.trials.trial_files import FailedTrial, save_trials

log = logging.getLogger(__name__)

Trials = Iterator[xr.Dataset | FailedTrial]


def simulate_chunk(
    path: str | os.PathLike[str],
    study: str,
    seed: int,
    points: Mapping[str, Mapping[str, Any]],
    precision: str = "double",
    failures: Literal["stop", "count"] = "count",
) -> list[FailedTrial]:
    """Simulate the trials of a chunk, and write them to one file as they are made."""
    failed: list[FailedTrial] = []
    index = [(point, number) for point, part in points.items() for number in range(part["first"], part["stop"])]
    with locate_errors(str(path)):
        save_trials(simulate_points(study, seed, points, failed, failures), path, precision, index, overwrite=True)
    return failed


def simulate_points(
    study: str,
    seed: int,
    points: Mapping[str, Mapping[str, Any]],
    failed: list[FailedTrial],
    failures: Literal["stop", "count"] = "count",
) -> Trials:
    """Simulate trials one after the other."""
    trials = (trial for point, part in points.items() for trial in _simulate_point(seed, study, point, part, failures))
    yield from _list_failures(trials, failed)


def _list_failures(trials: Trials, failed: list[FailedTrial]) -> Trials:
    for trial in trials:
        if isinstance(trial, FailedTrial):
            log.warning("%s: trial %d failed: %s", trial.point, trial.number, trial.reason)
            failed.append(trial)
        yield trial


def _simulate_point(seed: int, study: str, point: str, part: Mapping[str, Any], failures: str) -> Trials:
    """Simulate the trials of a point."""
    for number in range(part["first"], part["stop"]):
        trial: xr.Dataset | FailedTrial
        with locate_errors(f"study {study}, point {point}, trial {number}"):
            try:
                trial = simulate(seed=SeedSequence(trial_entropy(seed, study, point, number)), **part["settings"])
            except NUMERICAL_ERRORS as error:
                if failures == "stop":
                    raise
                trial = FailedTrial(point, number, describe_error(error))
        yield trial
        log.info("%s: simulated trial %d", point, number)
