"""Simulation of the trials of a chunk."""

from __future__ import annotations

import logging
import zlib
from collections.abc import Mapping
from typing import Any

import xarray as xr
from numpy.random import SeedSequence

from ankleloop.errors import NUMERICAL_ERRORS, describe_error, locate_errors
from ankleloop.simulation.simulate import simulate
from ankleloop.trials.trial_files import Trials

log = logging.getLogger(__name__)


def trial_entropy(seed: int, study: str, point: str, number: int) -> list[int]:
    """Entropy of a trial for `numpy.random.SeedSequence`, so that any part of a study gives the same bits alone."""
    return [seed, zlib.crc32(study.encode()), zlib.crc32(point.encode()), number]


def simulate_trials(
    study: str, seed: int, conditions: Mapping[str, Mapping[str, Any]], *, precision: str = "double"
) -> Trials:
    """Simulate trials one after the other, with the samples that they would have in a trial file.

    `conditions` have `settings` and the numbers of the trials, from `first` to `stop` without it.
    """
    for condition, part in conditions.items():
        for number in range(part["first"], part["stop"]):
            trial: xr.Dataset | str
            with locate_errors(f"study {study}, point {condition}, trial {number}"):
                try:
                    seeds = SeedSequence(trial_entropy(seed, study, condition, number))
                    trial = simulate(seed=seeds, **part["settings"])
                    if precision != "double":
                        trial = trial.astype(precision).astype(float)
                except NUMERICAL_ERRORS as error:
                    trial = describe_error(error)
                    log.warning("%s: trial %d failed: %s", condition, number, trial)
            yield condition, number, trial
            log.info("%s: simulated trial %d", condition, number)
