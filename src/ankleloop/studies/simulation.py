"""Simulation of the trials of a chunk."""

from __future__ import annotations

import logging
import zlib
from collections.abc import Iterator, Mapping
from typing import Any, Literal

import numpy as np
import xarray as xr
from numpy.random import SeedSequence

from ankleloop.errors import NUMERICAL_ERRORS
from ankleloop.simulation.simulate import simulate
from ankleloop.studies.failures import describe_error, locate_errors
from ankleloop.trials.files import parse_precision
from ankleloop.trials.trial_files import FailedTrial

log = logging.getLogger(__name__)

Conditions = Mapping[str, Mapping[str, Any]]
Trials = Iterator[tuple[str, int, xr.Dataset | FailedTrial]]  # condition and number of each


def trial_entropy(seed: int, study: str, point: str, number: int) -> list[int]:
    """Entropy of a trial for `numpy.random.SeedSequence`, so that any part of a study gives the same bits alone."""
    return [seed, zlib.crc32(study.encode()), zlib.crc32(point.encode()), number]


def simulate_trials(
    study: str,
    seed: int,
    conditions: Conditions,
    *,
    failures: Literal["stop", "count"] = "count",
    precision: str = "double",
) -> Trials:
    """Simulate trials one after the other, with the samples that they would have in a trial file.

    `conditions` have `settings` and the numbers of the trials, from `first` to `stop` without it.
    """
    kind = parse_precision(precision)
    for condition, part in conditions.items():
        for number in range(part["first"], part["stop"]):
            trial: xr.Dataset | FailedTrial
            with locate_errors(f"study {study}, point {condition}, trial {number}"):
                try:
                    entropy = trial_entropy(seed, study, condition, number)
                    trial = _round(simulate(seed=SeedSequence(entropy), **part["settings"]), kind)
                except NUMERICAL_ERRORS as error:
                    if failures == "stop":
                        raise
                    trial = FailedTrial(condition, number, describe_error(error))
                    log.warning("%s: trial %d failed: %s", condition, number, trial.reason)
            yield condition, number, trial
            log.info("%s: simulated trial %d", condition, number)


def _round(trial: xr.Dataset, kind: type[np.floating]) -> xr.Dataset:
    if kind is not np.float64:
        for name in trial.data_vars:
            variable = trial.variables[name]
            variable.values = variable.values.astype(kind).astype(float)
    return trial
