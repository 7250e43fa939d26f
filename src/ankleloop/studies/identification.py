"""Identification of a chunk of trials by all methods of a study, and its scores."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

import xarray as xr

from ankleloop.assessment.scores import SCORE_COLUMNS, parameter_row, score_rows
from ankleloop.errors import NUMERICAL_ERRORS
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.estimate_files import EstimateTable
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.methods.registry import identify
from ankleloop.studies.failures import describe_error, locate_errors
from ankleloop.studies.table_files import TableRows
from ankleloop.trials.trial_files import FailedTrial, load_chunks

log = logging.getLogger(__name__)

FILES = ("estimates", "scores", "parameters")  # that a chunk gives

PathLike = str | os.PathLike[str]
Methods = Mapping[str, Mapping[str, Any]]
# For each condition its points, each with `values` (columns of tables) and `options` by the name of a method.
Points = Mapping[str, Mapping[str, Mapping[str, Any]]]
Trials = Iterator[tuple[PreparedTrial | FailedTrial, str, int]]  # each with its condition and its number there


def identify_chunk(
    path: PathLike,
    files: Mapping[str, PathLike],
    study: str,
    points: Points,
    methods: Methods,
    *,
    trials: Mapping[str, Sequence[int]] | None = None,
    against: Literal["measured"] | None = None,
    precision: str = "double",
    failures: Literal["stop", "count"] = "count",
) -> None:
    """Identify the trials of a chunk by every method, score the estimates, and write all to files."""
    prepared = _read_trials(path, trials, points)
    with locate_errors(str(path)):
        identify_trials(
            prepared, files, study, points, methods, against=against, precision=precision, failures=failures
        )


def identify_trials(
    trials: Trials,
    files: Mapping[str, PathLike],
    study: str,
    points: Points,
    methods: Methods,
    *,
    against: Literal["measured"] | None = None,
    precision: str = "double",
    failures: Literal["stop", "count"] = "count",
) -> None:
    """Identify prepared trials by every method, score the estimates, and write all to files.

    Points of one condition share its trials. A method whose options are the same at several of them identifies each
    trial once. Rows of the tables are ordered by point, then by method, then by trial. All of them wait in temporary
    files beside those that are written, so that memory does not grow with the trials.
    """
    results = _ChunkResults(study, points, methods, precision, files)
    variants = {condition: _list_variants(alike, methods) for condition, alike in points.items()}
    for trial, condition, number in trials:
        for variant in variants[condition]:
            with locate_errors(f"study {study}, point {variant.points[0]}, trial {number}, method {variant.name}"):
                if isinstance(trial, FailedTrial):
                    results.add_failure(variant, number, f"the trial could not be simulated: {trial.reason}")
                    continue
                try:
                    estimate = identify(trial, variant.method, **variant.options)
                    scores = score_rows(trial, estimate, against=against, intervals=True)
                    parameters = parameter_row(trial, estimate)
                except NUMERICAL_ERRORS as error:
                    if failures == "stop":
                        raise
                    results.add_failure(variant, number, describe_error(error))
                    continue
                results.add(variant, number, estimate, scores, parameters)
        if isinstance(trial, PreparedTrial):
            trial.clear()
        log.info("%s: identified trial %d", condition, number)
    results.write(files)


class _Variant(NamedTuple):
    """A method with its options, and the points of a condition at which it has these options."""

    name: str
    method: str
    options: Mapping[str, Any]
    points: list[str]


def _list_variants(points: Mapping[str, Mapping[str, Any]], methods: Methods) -> list[_Variant]:
    """Methods with all options that they have at the points of a condition."""
    if not points:
        raise ValueError("a condition has no points: its trials would be left out.")
    variants: dict[tuple[str, str], _Variant] = {}
    for point, parts in points.items():
        for name, method in methods.items():
            varied = parts["options"].get(name, {})
            options = {**method["options"], **varied}
            key = (name, repr(sorted(varied.items())))
            variants.setdefault(key, _Variant(name, method["method"], options, [])).points.append(point)
    return list(variants.values())


class _ChunkResults:
    """Estimates, scores and parameters of a chunk, as they are made."""

    def __init__(
        self, study: str, points: Points, methods: Methods, precision: str, files: Mapping[str, PathLike]
    ) -> None:
        self._values = {name: point["values"] for alike in points.values() for name, point in alike.items()}
        self._varied = dict.fromkeys(name for values in self._values.values() for name in values)
        columns = ["study", "point", *self._varied, "method", "trial"]
        folder = Path(files["parameters"]).parent
        self._study, self._methods = study, list(methods)
        self._estimates = EstimateTable(precision, folder) if "estimates" in files else None
        self._scores = TableRows([*columns, *SCORE_COLUMNS], folder)
        self._parameters = TableRows(columns, folder)

    def add(
        self,
        variant: _Variant,
        number: int,
        estimate: Estimate,
        scores: list[tuple[Any, ...]],
        parameters: Mapping[str, Any],
    ) -> None:
        """Add the estimate of a trial, its scores and its parameters, at every point of the variant."""
        parameters = {self._column(name): value for name, value in parameters.items()}
        for point in variant.points:
            row, group = self._row(point, variant.name, number), (point, variant.name)
            if self._estimates is not None:
                self._estimates.add(estimate, point=point, name=variant.name, number=number)
            for values in scores:
                self._scores.add(group, {**row, **dict(zip(SCORE_COLUMNS, values, strict=True))})
            self._parameters.add(group, {**row, **parameters})

    def add_failure(self, variant: _Variant, number: int, reason: str) -> None:
        """Add a trial without an estimate."""
        for point in variant.points:
            log.warning("%s, trial %d, %s failed: %s", point, number, variant.name, reason)
            row = self._row(point, variant.name, number)
            self._parameters.add((point, variant.name), {**row, "failure": reason})

    def write(self, files: Mapping[str, PathLike]) -> None:
        """Write all files."""
        order = [(point, method) for point in self._values for method in self._methods]
        if self._estimates is not None:
            self._estimates.write(files["estimates"], overwrite=True)
        self._scores.write(files["scores"], order)
        self._parameters.write(files["parameters"], order)

    def _column(self, name: str) -> str:
        """Column of an estimated quantity: one that the points vary by name has the value of the point there."""
        quantity = name.removesuffix("_low").removesuffix("_high")
        return f"{quantity}_estimated{name.removeprefix(quantity)}" if quantity in self._varied else name

    def _row(self, point: str, method: str, number: int) -> dict[str, Any]:
        return {"study": self._study, "point": point, **self._values[point], "method": method, "trial": number}


def _read_trials(path: PathLike, trials: Mapping[str, Sequence[int]] | None, conditions: Iterable[str]) -> Trials:
    """Trials of a file, prepared, and those that failed, by condition and number."""
    ranks = {condition: rank for rank, condition in enumerate(conditions)}
    count = 0
    try:
        for chunk in load_chunks(path, trials):
            rows: list[tuple[xr.Dataset | FailedTrial, str, int]]
            rows = list(zip(chunk.trials, chunk.points, chunk.numbers, strict=True))
            rows += [(failure, failure.point, failure.number) for failure in chunk.failures]
            for trial, condition, number in sorted(rows, key=lambda row: (ranks[row[1]], row[2])):
                yield (
                    trial if isinstance(trial, FailedTrial) else PreparedTrial(trial, validated=True),
                    condition,
                    number,
                )
                count += 1
    except MemoryError as error:
        error.add_note(f"reading of trials from row {count} on, {path}")
        raise
