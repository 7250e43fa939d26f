"""Recordings from their files to tables and exports; a file that cannot be used gives a refused analysis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import xarray as xr

from ankleloop.checks.course import check_slow_movement
from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.estimate_files import save_estimate
from ankleloop.joint.prepared import prepare
from ankleloop.joint.regressors import TORQUES
from ankleloop.joint.time_varying_course import make_course
from ankleloop.methods.registry import find_method
from ankleloop.trials.files import PathLike, write_csv
from ankleloop.trials.trial import remove_drift, segment
from ankleloop_lab.files.reading import read_trial
from ankleloop_lab.files.reading_options import ReadingOptions
from ankleloop_lab.recordings.analysis import (
    Analysis,
    Specification,
    describe_failure,
    refused_analysis,
)
from ankleloop_lab.recordings.checks import Check, CheckOptions, Finding
from ankleloop_lab.recordings.labels import GROUPS
from ankleloop_lab.recordings.recommendation import recommend

SUFFIXES = (".nc", ".mat", ".csv")

# Options that say what parameters are functions of.
COURSE = ("cycle_onsets", "schedule")

RecordingValues = Mapping[str, Any]  # of `ankleloop_lab.recordings.settings.Recording`, by name


def load_recording(path: PathLike, mapping: RecordingValues) -> xr.Dataset:
    """Read a recording, take the part of it that is to be analysed, and remove the drift."""
    options = {name: mapping[name] for name in ReadingOptions.model_fields if name in mapping}
    trial = read_trial(path, **options)
    start = mapping.get("start")
    stop = mapping.get("stop")
    end = trial.sizes["time"] / trial.attrs["sampling_rate"]
    if start is not None or stop is not None:
        trial = segment(trial, start or 0.0, end + 1.0 if stop is None else stop)
    if stop is not None and stop > end + 1e-9:
        raise DataError(
            f"{Path(path).name}: stop is {stop:g} s, and the record ends at {end:g} s: give a time within it, or leave "
            "stop out.",
            remedy={"stop": None},
        )
    return remove_drift(trial, mapping["drift"]) if mapping.get("drift") else trial


def merge_courses(parts: Sequence[RecordingValues]) -> RecordingValues:
    """What the parameters of a recording are functions of: of merged trials, onsets of cycles for each."""
    courses = [{name: part.get(name) for name in COURSE} for part in parts]
    if all(course == courses[0] for course in courses):
        return courses[0]
    onsets = [course["cycle_onsets"] for course in courses]
    if not all(isinstance(times, (list, tuple)) for times in onsets):
        raise DataError(
            "cycle_onsets or schedule differ between the trials that are merged: give all rows of a batch the same "
            "variable, or times of onsets in each of them."
        )
    return {"cycle_onsets": onsets}


def add_course(
    methods: Mapping[str, Specification], mapping: RecordingValues
) -> dict[str, Specification]:
    """Give methods what the parameters of a recording are functions of."""
    course = {name: mapping[name] for name in COURSE if mapping.get(name) is not None}
    result = dict(methods)
    for label, method in methods.items():
        options = method.get("options", {})
        takes_course = course.keys() <= find_method(method["method"]).options.model_fields.keys()
        has_none = all(options.get(name) is None for name in COURSE)
        if course and takes_course and has_none:
            result[label] = {**method, "options": {**options, **course}}
    return result


def check_course(trial: xr.Dataset, mapping: RecordingValues) -> list[Finding]:
    """Check whether the onsets of cycles, or the scheduling variable, can be used with a recording."""
    onsets, schedule = (mapping.get(name) for name in COURSE)
    if onsets is None and schedule is None:
        return []
    name = "cycles" if schedule is None else "schedule"
    prepared = prepare(trial)
    options = CheckOptions().at_rate(prepared.rate)
    try:
        grid = prepared.grid(options.identification_rate, options.delay)
        course = make_course([prepared], [grid], onsets, schedule)
    except DataError as error:
        return [Finding(name, "warning", str(error), error.remedy)]
    position = prepared.motion(grid)[0]
    return check_slow_movement(position, course, options.identification_rate, schedule)


def refuse_recording(error: Exception) -> Analysis:
    """Analysis of a recording that cannot be used."""
    finding = Finding("file", "refused", describe_failure(error), getattr(error, "remedy", {}))
    return refused_analysis(Check([finding], "undecided", {}))


def tabulate_analysis(
    name: str, mapping: RecordingValues, analysis: Analysis, keys: Mapping[str, str]
) -> pd.DataFrame:
    """Rows of an analysis for a table of many recordings; `attrs` of the table has the remedy."""
    groups = {group: mapping[group] for group in GROUPS}
    label, text = recommend(analysis)
    labels = analysis.table.reindex(columns=["label"])["label"].astype(object)
    table = analysis.table.assign(
        key=labels.map(keys), recommended=labels.eq(label), recommendation=text
    )
    table.attrs["remedy"] = analysis.remedy
    for place, (column, value) in enumerate({"recording": name, **groups}.items()):
        table.insert(place, column, value)
    return table


def export_estimates(estimates: Mapping[str, Estimate], folder: PathLike) -> None:
    """Write estimates as NetCDF, MATLAB and CSV files."""
    for key, estimate in estimates.items():
        Path(folder).mkdir(parents=True, exist_ok=True)
        for suffix in SUFFIXES:
            export_estimate(estimate, Path(folder, f"{key}{suffix}"), overwrite=True)


def export_estimate(estimate: Estimate, path: PathLike, *, overwrite: bool = False) -> None:
    """Write one estimate to a file for another program.

    `.nc` and `.mat` are the files of `ankleloop.save_estimate`, with torques, model, parameters, intervals and
    diagnostics; `.csv` is a table of the torques over time, with the number of the trial where trials were merged.

    Parameters
    ----------
    estimate : Estimate
        The estimate.
    path : path-like
        A file ending in .nc, .mat or .csv, in a folder that exists; it appears when it is complete.
    overwrite : bool
        Whether to replace a file of this name; without it an existing file is refused.

    Raises
    ------
    DataError
        For another suffix, if the file exists or the estimate is read from it, or if it cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> import scipy.io
    >>> from ankleloop.methods.registry import identify
    >>> from ankleloop.simulation.simulate import simulate
    >>> estimate = identify(simulate(seed=1, duration=20.0), "riv")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     export_estimate(estimate, f"{folder}/estimate.mat")
    ...     exported = scipy.io.loadmat(f"{folder}/estimate.mat", simplify_cells=True)["estimate"]
    >>> exported["stiffness"]["K"] == estimate.stiffness["K"], exported["model"]["A"].shape
    (True, (2, 2))
    """
    if Path(path).suffix != ".csv":
        save_estimate(estimate, path, overwrite=overwrite)
        return
    columns = {"time_s": estimate.torque["time"].values}
    if "trial" in estimate.torque.coords:
        columns = {"trial": estimate.torque["trial"].values, **columns}
    for name in TORQUES:
        columns[f"torque_{name}_nm"] = estimate.torque[name].values
    write_csv(pd.DataFrame(columns), path, overwrite=overwrite)
