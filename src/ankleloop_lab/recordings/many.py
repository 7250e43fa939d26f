"""Many trials: each identified on its own, to a table with a row for each."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import pandas as pd

from ankleloop.assessment.scores import parameter_row
from ankleloop.errors import NUMERICAL_ERRORS, DataError
from ankleloop.joint.prepared import PreparedTrial, prepare
from ankleloop.methods.method import Method, Trial
from ankleloop.methods.registry import DEFAULT, find_method, identify
from ankleloop.methods.selection import check_selection
from ankleloop.quantities import PARAMETERS
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.trials.files import PathLike
from ankleloop_lab.files.reading import read_trial
from ankleloop_lab.files.reading_options import ReadingOptions
from ankleloop_lab.recordings.analysis import describe_failure, mean_levels
from ankleloop_lab.recordings.labels import read_labels
from ankleloop_lab.recordings.processes import run_each

PATH = (str, os.PathLike)
Item = Trial | PathLike | Sequence[Trial | PathLike]
Labels = dict[str, Any]

# Attributes that the library gives a trial: how it was read, with `NAME_variable` of each channel, and what was
# simulated.
READ = {
    "sampling_rate",
    "position_sign",
    "torque_sign",
    "position_unit",
    "position_unit_of_file",
    "torque_unit_of_file",
    "reference_unit_of_file",
    "gaps",
    "jitter",
    "resample",
    "onset",
    "window_start",
    "window_end",
    "apparatus",
}
SIMULATED = {
    "seed",
    "load_inertia",
    "load_viscosity",
    "load_stiffness",
    *SimulationSettings.model_fields,
}


def identify_each(
    trials: Iterable[Item],
    method: str | Method | None = None,
    jobs: int = 1,
    *,
    names: str | None = None,
    progress: bool = False,
    **options: Any,
) -> pd.DataFrame:
    """Identify each of many trials, to a table with a row for each.

    Parameters
    ----------
    trials : sequence of xarray.Dataset, path-like or list of those
        The trials, or their files, which `ankleloop.read_trial` reads by the names of their variables. A list within
        the list are trials that are merged into one estimate.
    method : str or Method, optional
        As in `ankleloop.identify`.
    jobs : int
        Number of processes side by side. The results do not depend on it. A script needs no ``if __name__`` for them,
        and a notebook can start them.
    names : str, optional
        Pattern of the names of the files with labels in braces, such as "{subject}_{condition}".
    progress : bool
        Whether to show on the standard error how many are done.
    **options
        Those of `ankleloop.identify`, and of files those of `ankleloop.read_trial`. `reference` is the variable of the
        files, but for "position", which takes the measured position for it.

    Returns
    -------
    pandas.DataFrame
        `recording`, a number from 1; the labels of the trial, from its attributes and the name of its file, where
        trials that are merged have them alike, a label with the name of a parameter or of another column as
        `NAME_label`; how many `trials` are merged; the `method`; its parameters with the ends of their 95 % intervals
        (such as `K`, `K_low`, `K_high`) and its diagnostics; `warnings` and `remarks`, and whether it is `trusted`,
        which an estimate with a warning about the fit is not. `mean_torque` [N·m] and `mean_position` [rad] say where
        the joint was held. Where a trial is refused, or its file cannot be read, `refused` has the reason, and the
        parameters are missing. Settings of a trial that `ankleloop.simulate` made are no labels.

    Raises
    ------
    ValueError, TypeError
        For an unknown method or option, or one outside its range.
    DataError
        If there are no trials, or a file has another name than `names`.
    ResourceError
        If the system killed a process.

    See Also
    --------
    ankleloop.compare : Differences of conditions, from this table.

    Examples
    --------
    >>> from ankleloop import new_trial, simulate
    >>> trials = [simulate(seed=seed, duration=20.0).assign_attrs(subject=f"S{seed}") for seed in (1, 2)]
    >>> trials.append(trials[0].drop_vars("reference").assign_attrs(subject="S3"))
    >>> table = identify_each(trials, "riv")
    >>> table[["recording", "subject", "trusted"]].values.tolist()
    [[1, 'S1', True], [2, 'S2', True], [3, 'S3', False]]
    >>> print(table["refused"][2][:37])
    the trial has no variable 'reference'
    """
    groups = [list(item) if isinstance(item, (list, tuple)) else [item] for item in trials]
    if not groups or not all(groups):
        raise DataError("there are no trials to identify.")
    labels = [_label_group(group, names) for group in groups]
    has_files = any(isinstance(part, PATH) for group in groups for part in group)
    reading = _take_reading(options) if has_files else {}
    _check_options(method, options)
    identify_one = partial(_identify_group, method=method, reading=reading, options=options)
    found = map(identify_one, groups) if jobs == 1 else run_each(identify_one, groups, jobs)
    rows = []
    for number, row in enumerate(found, 1):
        rows.append(row)
        if progress:
            print(f"trial {number} of {len(groups)}", file=sys.stderr)
    results = pd.DataFrame(rows)
    results.insert(0, "trials", [len(group) for group in groups])
    own = {name: f"{name}_label" for name in ("recording", *PARAMETERS, *results)}
    table = pd.DataFrame(labels, index=results.index).rename(columns=own).join(results)
    table.insert(0, "recording", range(1, len(groups) + 1))
    return table


def _take_reading(options: dict[str, Any]) -> dict[str, Any]:
    """Options of reading, which are taken out of others, and checked."""
    names = options.keys() & ReadingOptions.model_fields.keys()
    if options.get("reference") == "position":
        names.discard("reference")
    reading = {name: options.pop(name) for name in names}
    ReadingOptions.parse("identify_each", **reading)
    return reading


def _check_options(method: str | Method | None, options: Mapping[str, Any]) -> None:
    """Refuse wrong options before anything is identified."""
    entry = find_method(DEFAULT if method is None else method)
    fixed = dict(options)
    select = fixed.pop("select", None)
    criterion = fixed.pop("criterion", None)
    check_selection(f"method {entry.name!r}", entry.options, fixed, select, criterion)


def _label_group(parts: Sequence[Any], names: str | None) -> Labels:
    """Labels that all of some trials have alike."""
    first, *others = [_label(part, names) for part in parts]
    return {
        name: value
        for name, value in first.items()
        if all(other.get(name) == value for other in others)
    }


def _label(part: Any, names: str | None) -> Labels:
    """Labels of a trial: its attributes, but those that the library gives it, and what the name of its file holds."""
    if isinstance(part, PATH):
        labels: Labels = {"source": os.fspath(part)}
    else:
        trial = part.trial if isinstance(part, PreparedTrial) else part
        given = READ | {f"{name}_variable" for name in trial.variables}
        if "integration_rate" in trial.attrs:
            given |= SIMULATED
        labels = {str(name): value for name, value in trial.attrs.items() if name not in given}
    if names and "source" in labels:
        labels |= read_labels(labels["source"], names)
    return labels


def _identify_group(
    parts: Sequence[Any],
    method: str | Method | None,
    reading: Mapping[str, Any],
    options: Mapping[str, Any],
) -> dict[str, Any]:
    """What becomes of a trial, or of several that are merged."""
    try:
        trials = [
            prepare(read_trial(part, **reading) if isinstance(part, PATH) else part)
            for part in parts
        ]
        estimate = identify(trials if len(trials) > 1 else trials[0], method, **options)
    except NUMERICAL_ERRORS as error:
        return {"trusted": False, "refused": describe_failure(error)}
    return {
        "method": estimate.method,
        "trusted": estimate.trusted,
        "remarks": " ".join(estimate.remarks),
        "refused": "",
        **parameter_row(trials, estimate),
        **mean_levels(trials),
    }
