"""Identification of a chunk of trials by all methods of a study, and its scores."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

from ankleloop.assessment.scores import SCORE_COLUMNS, parameter_row, score_rows
from ankleloop.errors import NUMERICAL_ERRORS
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.estimate_files import EstimateCollection, save_estimates
from ankleloop.joint.prepared import PreparedTrial, prepare_trials
from ankleloop.methods.registry import identify, method_options
from ankleloop.records.trial_files import FailedTrial, load_chunks
from ankleloop.studies.failures import describe_error, locate_errors
from ankleloop.studies.table_files import TableRows

__all__ = ["FILES", "identify_chunk"]

log = logging.getLogger(__name__)

FILES = ("estimates", "scores", "parameters")  # that a chunk gives

PathLike = str | os.PathLike[str]
Methods = Mapping[str, Mapping[str, Any]]


def identify_chunk(
    path: PathLike,
    files: Mapping[str, PathLike],
    study: str,
    points: Mapping[str, Mapping[str, Any]],
    methods: Methods,
    *,
    against: Literal["measured"] | None = None,
    precision: str = "double",
    failures: Literal["stop", "count"] = "count",
) -> None:
    """Identify all trials of a file by every method, score the estimates, and write all to files.

    Rows of the tables are ordered by point, then by method, then by trial. All of them wait in temporary files beside
    those that are written, so that memory does not grow with the trials.

    Parameters
    ----------
    path : path-like
        Trial file of the chunk.
    files : mapping of str to path-like
        Files to write, which replace others of their names:

        - `estimates`: NetCDF, a group for each method that could identify any trial;
        - `scores`: CSV, VAF with its interval, a row for each trial, method and torque;
        - `parameters`: CSV, estimated parameters and diagnostics, a row for each trial and method.
    study : str
        Name of the study, for the tables.
    points : mapping of str to mapping
        Settings that make each point, by its name; they are columns of the tables.
    methods : mapping of str to mapping
        By the name that tables use, the `method` and its `options`, as `ankleloop.identify` takes them.
    against : {"measured"}, optional
        As of `ankleloop.evaluate`.
    precision : {"double", "single"}
        Floating-point numbers of the estimated torques.
    failures : {"stop", "count"}
        What a trial that a method cannot identify or whose estimate cannot be scored does: raise its error, or count as
        a result, with the error in the column `failure` of the parameters and no scores. So does a trial that could not
        be simulated. Mistakes in the program, such as a `TypeError`, are raised in any case.

    Raises
    ------
    ValueError, ArithmeticError
        If a method cannot identify a trial, and failures stop; its notes name study, point, trial, method and file.
    DataError
        If the trial file is missing or damaged, or a file cannot be written.
    """
    results = _ChunkResults(study, points, methods, precision, Path(files["estimates"]).parent)
    for trial, point, number in _prepared_trials(path, points, methods):
        for name, method in methods.items():
            with locate_errors(f"study {study}, point {point}, trial {number}, method {name}, {path}"):
                if isinstance(trial, FailedTrial):
                    results.add_failure(point, name, number, f"the trial could not be simulated: {trial.reason}")
                    continue
                try:
                    estimate = identify(trial, method["method"], **method["options"])
                    scores = score_rows(trial, estimate, against=against, intervals=True)
                    parameters = parameter_row(trial, estimate)
                except NUMERICAL_ERRORS as error:
                    if failures == "stop":
                        raise
                    results.add_failure(point, name, number, describe_error(error))
                    continue
                results.add(point, name, number, estimate, scores, parameters)
        log.info("%s: identified trial %d", point, number)
        del trial  # before others are read: it holds the signals of all that were read with it
    results.write(files)


class _ChunkResults:
    """Estimates, scores and parameters of a chunk, as they are made."""

    def __init__(
        self, study: str, points: Mapping[str, Mapping[str, Any]], methods: Methods, precision: str, folder: Path
    ) -> None:
        varied = dict.fromkeys(name for settings in points.values() for name in settings)
        columns = ["study", "point", *varied, "method", "trial"]
        self._study, self._points = study, points
        self._estimates = {name: EstimateCollection(precision=precision, folder=folder) for name in methods}
        self._scores = TableRows([*columns, *SCORE_COLUMNS], folder)
        self._parameters = TableRows(columns, folder)

    def add(
        self,
        point: str,
        method: str,
        number: int,
        estimate: Estimate,
        scores: list[tuple[Any, ...]],
        parameters: Mapping[str, Any],
    ) -> None:
        """Add the estimate of a trial, its scores and its parameters."""
        row = self._row(point, method, number)
        self._estimates[method].add(estimate, point, number)
        for values in scores:
            self._scores.add((point, method), {**row, **dict(zip(SCORE_COLUMNS, values, strict=True))})
        self._parameters.add((point, method), {**row, **parameters})

    def add_failure(self, point: str, method: str, number: int, reason: str) -> None:
        """Add a trial without an estimate."""
        log.warning("%s, trial %d, %s failed: %s", point, number, method, reason)
        self._parameters.add((point, method), {**self._row(point, method, number), "failure": reason})

    def write(self, files: Mapping[str, PathLike]) -> None:
        """Write all files."""
        order = [(point, method) for point in self._points for method in self._estimates]
        present = {name: collection for name, collection in self._estimates.items() if len(collection)}
        save_estimates(present, files["estimates"], overwrite=True)
        self._scores.write(files["scores"], order)
        self._parameters.write(files["parameters"], order)

    def _row(self, point: str, method: str, number: int) -> dict[str, Any]:
        return {"study": self._study, "point": point, **self._points[point], "method": method, "trial": number}


def _prepared_trials(
    path: PathLike, points: Iterable[str], methods: Methods
) -> Iterator[tuple[PreparedTrial | FailedTrial, str, int]]:
    """Trials with their points and numbers; those of one pass share the decimation of each signal."""
    grids, ranks = _grids(methods), {point: rank for rank, point in enumerate(points)}
    done = 0
    try:
        for chunk in load_chunks(path):
            prepared = prepare_trials(chunk.trials, chunk.signals, grids) if chunk.trials else []
            trials: list[tuple[PreparedTrial | FailedTrial, str, int]]
            trials = list(zip(prepared, chunk.points, chunk.numbers, strict=True))
            if chunk.failures:
                trials += [(failure, failure.point, failure.number) for failure in chunk.failures]
                trials.sort(key=lambda row: (ranks[row[1]], row[2]))
            del chunk, prepared
            trials.reverse()
            while trials:  # a trial holds what methods compute from it: none is kept after its turn
                yield trials.pop()
                done += 1
    except MemoryError as error:
        error.add_note(f"reading of trials from row {done} on, {path}")
        raise


def _grids(methods: Methods) -> list[tuple[float, float]]:
    """Identification rates and delays of those methods that have both."""
    options = [method_options(method["method"]) | method["options"] for method in methods.values()]
    pairs = [(values.get("identification_rate"), values.get("delay")) for values in options]
    return [(rate, delay) for rate, delay in dict.fromkeys(pairs) if rate is not None and delay is not None]
