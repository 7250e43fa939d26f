"""Identification of a chunk of trials by all methods of a study, and its scores."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from contextlib import nullcontext
from functools import cache
from itertools import product
from typing import Any, Literal

import pyarrow as pa

from ankleloop.assessment.scores import parameter_row, score_torques
from ankleloop.errors import NUMERICAL_ERRORS, describe_error, locate_errors
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.methods.registry import identify
from ankleloop.quantities import point_column
from ankleloop.trials.files import PathLike
from ankleloop.trials.trial_files import Trials, load_rows
from ankleloop_workflow.tables.estimate_tables import write_estimates
from ankleloop_workflow.tables.trial_tables import ENDS, as_table, save_table

log = logging.getLogger(__name__)

COLUMN_TYPES = {
    "number": pa.float64(),
    "count": pa.int64(),
    "flag": pa.bool_(),
    "text": pa.string(),
}

Mappings = Mapping[str, Mapping[str, Any]]  # by the names of conditions, or the keys of methods
Row = dict[str, Any]
Result = tuple[Estimate | None, Row]  # no estimate where the identification failed


def read_trials(path: PathLike, conditions: Mappings) -> Trials:
    """Trials of a file, those of each condition from `first` to `stop` without it."""
    rows = [
        (condition, number)
        for condition, part in conditions.items()
        for number in range(part["first"], part["stop"])
    ]
    return load_rows(path, rows)


def identify_trials(
    trials: Trials,
    files: Mapping[str, PathLike],
    study: str,
    conditions: Mappings,
    methods: Mappings,
    kinds: Mapping[str, str],
    *,
    against: Literal["measured"] | None = None,
    precision: str = "double",
) -> pa.Table:
    """Identify trials by every method, score the estimates, and write the rows of all trials to `files["scores"]`.

    `conditions` have `points`, each with its `values` (columns) and `options` by method. Points of one condition share
    its trials, and a method whose options are the same at several of them identifies a trial once. `files["estimates"]`
    is optional.
    """
    types = {point_column(name): COLUMN_TYPES[kind] for name, kind in kinds.items()}
    rows: list[Row] = []
    path = files.get("estimates")
    writing: Any = write_estimates(path, precision, overwrite=True) if path else nullcontext()
    with writing as estimates:
        for condition, number, trial in trials:
            prepared = trial if isinstance(trial, str) else PreparedTrial(trial)
            # By method and its options.
            results: dict[tuple[str, str], Result] = {}
            points = conditions[condition]["points"]
            for (point, part), (name, method) in product(points.items(), methods.items()):
                options = {**method["options"], **part["options"].get(name, {})}
                key = (name, repr(options))
                place = f"study {study}, point {point}, trial {number}, method {name}"
                if key not in results:
                    with locate_errors(place):
                        results[key] = _identify(prepared, method["method"], options, against)
                estimate, row = results[key]
                if "failure" in row:
                    log.warning("%s, trial %d, %s failed: %s", point, number, name, row["failure"])
                if estimate is not None and estimates is not None:
                    estimates.add(estimate, point=point, name=name, number=number)
                values = {point_column(column): value for column, value in part["values"].items()}
                keys = {"study": study, "point": point, **values, "method": name, "trial": number}
                rows.append(keys | row)
            log.info("%s: identified trial %d", condition, number)
    table = as_table(rows, types)
    save_table(table, files["scores"])
    return table


@cache
def _score_columns(torque: str, target: str) -> list[str]:
    """Columns of a VAF and of the ends of its interval; the rows of all trials share their names."""
    return [f"vaf_{torque}_{target}{end}" for end in ("", *ENDS)]


def _identify(
    trial: PreparedTrial | str, method: str, options: Mapping[str, Any], against: Any
) -> Result:
    """Estimate of a trial with its scores and parameters as a row, or without it the reason of the failure."""
    if isinstance(trial, str):
        return None, {"failure": f"the trial could not be simulated: {trial}"}
    row: Row = {}
    try:
        estimate = identify(trial, method, **options)
        for torque, target, *values in score_torques([trial], estimate, against):
            row |= zip(_score_columns(torque, target), values, strict=True)
        return estimate, row | parameter_row(trial, estimate)
    except NUMERICAL_ERRORS as error:
        return None, {"failure": describe_error(error)}
