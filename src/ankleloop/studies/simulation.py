"""Simulation of a chunk of trials into a trial file."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator, Mapping
from typing import Any

import xarray as xr
from numpy.random import SeedSequence

from ankleloop.errors import UnstableLoopError
from ankleloop.records.trial_files import save_trials
from ankleloop.simulation.simulate import simulate_trials
from ankleloop.studies.seeds import trial_entropy

__all__ = ["simulate_chunk"]

log = logging.getLogger(__name__)


def simulate_chunk(
    path: str | os.PathLike[str],
    study: str,
    seed: int,
    points: Mapping[str, Mapping[str, Any]],
    precision: str = "double",
) -> None:
    """Simulate the trials of a chunk, and write them to one file.

    Parameters
    ----------
    path : path-like
        File to write.
    study : str
        Name of the study.
    seed : int
        Seed of the study.
    points : mapping of str to mapping
        For each point its `settings`, and the trials of it that the chunk holds: from `first` to `stop`, without
        `stop`.
    precision : {"double", "single"}
        Floating-point numbers on disk.

    Raises
    ------
    UnstableLoopError
        If a loop diverges; the message names the point and the trial. Then there is no file, also not of the other
        points of the chunk: a study without some of its points would have other means than it says.
    """
    index = [(point, number) for point, part in points.items() for number in range(part["first"], part["stop"])]
    save_trials(_simulate(study, seed, points), path, precision, index)


def _simulate(study: str, seed: int, points: Mapping[str, Mapping[str, Any]]) -> Iterator[xr.Dataset]:
    for point, part in points.items():
        numbers = range(part["first"], part["stop"])
        seeds = [SeedSequence(trial_entropy(seed, study, point, number)) for number in numbers]
        trials = simulate_trials(seeds, **part["settings"])
        for number in numbers:
            try:
                trial = next(trials)
            except UnstableLoopError as error:
                raise UnstableLoopError(
                    f"study {study}, point {point}, trial {number}: {error} Nothing of this chunk is written: change "
                    "the settings of the point, or leave it out."
                ) from None
            yield trial
            log.info("%s: simulated trial %d", point, number)
