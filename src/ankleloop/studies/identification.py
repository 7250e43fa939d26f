"""Identification of a chunk of trials by all methods of a study, and its scores."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import pandas as pd

from ankleloop.assessment.scores import SCORE_COLUMNS, parameter_row, score_rows
from ankleloop.errors import NUMERICAL_ERRORS, DataError
from ankleloop.joint.estimate_files import EstimateCollection
from ankleloop.joint.prepared import PreparedTrial, prepare_trials
from ankleloop.methods.registry import identify, method_options
from ankleloop.records.trial_files import load_chunks

__all__ = ["ChunkResults", "identify_chunk"]

log = logging.getLogger(__name__)

Methods = Mapping[str, Mapping[str, Any]]
Rows = dict[tuple[str, str], list[dict[str, Any]]]


@dataclass(frozen=True)
class ChunkResults:
    """Results of a chunk.

    Parameters
    ----------
    estimates : dict of str to EstimateCollection
        Estimates of all trials by method, without methods that could identify none.
    scores : pandas.DataFrame
        VAF with its interval: a row for each trial, method and torque.
    parameters : pandas.DataFrame
        Estimated parameters and diagnostics: a row for each trial and method.
    """

    estimates: dict[str, EstimateCollection]
    scores: pd.DataFrame
    parameters: pd.DataFrame


def identify_chunk(
    path: str | os.PathLike[str],
    study: str,
    points: Mapping[str, Mapping[str, Any]],
    methods: Methods,
    *,
    against: Literal["measured"] | None = None,
    precision: str = "double",
    failures: Literal["stop", "count"] = "count",
) -> ChunkResults:
    """Identify all trials of a file by every method, and score the estimates.

    Parameters
    ----------
    path : path-like
        Trial file of the chunk.
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
        a result, with the error in the column `failure` of the parameters and no scores. Mistakes in the program, such
        as a `TypeError`, are raised in any case.

    Returns
    -------
    ChunkResults
        Rows are ordered by point, then by method, then by trial.

    Raises
    ------
    ValueError, ArithmeticError
        If a method cannot identify a trial, and failures stop.
    """
    estimates = {name: EstimateCollection(precision=precision) for name in methods}
    scores: Rows = {}
    parameters: Rows = {}
    for trial, point, number in _prepared_trials(path, methods):
        for name, method in methods.items():
            row = {"study": study, "point": point, **points[point], "method": name, "trial": number}
            try:
                estimate = identify(trial, method["method"], **method["options"])
                values = score_rows(trial, estimate, against=against, intervals=True)
                details = parameter_row(trial, estimate)
            except NUMERICAL_ERRORS as error:
                if failures == "stop":
                    raise
                log.warning("%s, trial %d, %s failed: %s", point, number, name, error)
                parameters.setdefault((point, name), []).append({**row, "failure": _describe(error)})
                continue
            estimates[name].add(estimate, point, number)
            scores.setdefault((point, name), []).extend(
                {**row, **dict(zip(SCORE_COLUMNS, part, strict=True))} for part in values
            )
            parameters.setdefault((point, name), []).append({**row, **details})
        log.info("%s: identified trial %d", point, number)
    varied = dict.fromkeys(name for settings in points.values() for name in settings)
    columns = ["study", "point", *varied, "method", "trial"]
    return ChunkResults(
        {name: collection for name, collection in estimates.items() if len(collection)},
        _tabulate(scores, points, methods, [*columns, *SCORE_COLUMNS]),
        _tabulate(parameters, points, methods, columns),
    )


def _describe(error: Exception) -> str:
    """The message of an error, with its type where that says more than the message."""
    return str(error) if isinstance(error, DataError) else f"{type(error).__name__}: {error}"


def _prepared_trials(path: str | os.PathLike[str], methods: Methods) -> Iterator[tuple[PreparedTrial, str, int]]:
    """Trials with their points and numbers; those of one pass share the decimation of each signal."""
    grids = _grids(methods)
    for chunk in load_chunks(path):
        trials = prepare_trials(chunk.trials, chunk.signals, grids)
        yield from zip(trials, chunk.points, chunk.numbers, strict=True)


def _grids(methods: Methods) -> list[tuple[float, float]]:
    """Identification rates and delays of those methods that have both."""
    options = [method_options(method["method"]) | method["options"] for method in methods.values()]
    pairs = [(values.get("identification_rate"), values.get("delay")) for values in options]
    return [(rate, delay) for rate, delay in dict.fromkeys(pairs) if rate is not None and delay is not None]


def _tabulate(rows: Rows, points: Mapping[str, Any], methods: Methods, columns: list[str]) -> pd.DataFrame:
    """One table of all rows, or an empty one with the columns; each method adds the columns that it has."""
    order = [(point, name) for point in points for name in methods if (point, name) in rows]
    if not order:
        return pd.DataFrame(columns=columns)
    return pd.concat([pd.DataFrame(rows[key]) for key in order], ignore_index=True)
