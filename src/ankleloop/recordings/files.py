"""Recordings from their files to tables and exports; a file that cannot be used gives a refused analysis."""

from __future__ import annotations

import logging
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import xarray as xr

from ankleloop.errors import NUMERICAL_ERRORS, DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.recordings.analysis import Analysis, analyse
from ankleloop.recordings.checks import Check, Finding
from ankleloop.recordings.export import export_estimate
from ankleloop.recordings.recommendation import recommend
from ankleloop.recordings.variation import add_course
from ankleloop.trials.readers import read_trial
from ankleloop.trials.reading_options import ReadingOptions
from ankleloop.trials.trial import remove_drift, segment

SUFFIXES = (".nc", ".mat", ".csv")
GROUPS = ("subject", "condition", "trial")

log = logging.getLogger(__name__)


def load_recording(path: str | os.PathLike[str], mapping: Mapping[str, Any]) -> xr.Dataset:
    """Read a recording, take the part of it that is to be analysed, and remove the drift."""
    try:
        os.stat(path)
    except FileNotFoundError:
        raise DataError(f"there is no file {Path(path).name} in the folder of the recordings.") from None
    except (OSError, ValueError):  # read_trial says what is wrong
        pass
    trial = read_trial(path, **{name: mapping[name] for name in ReadingOptions.model_fields if name in mapping})
    start, stop = mapping.get("start"), mapping.get("stop")
    if start is not None or stop is not None:
        trial = segment(trial, start or 0.0, float(trial["time"][-1]) + 1.0 if stop is None else stop)
    return remove_drift(trial, mapping["drift"]) if mapping.get("drift") else trial


def analyse_files(
    paths: Sequence[str | os.PathLike[str]],
    mappings: Sequence[Mapping[str, Any]],
    methods: Mapping[str, Mapping[str, Any]],
) -> tuple[list[xr.Dataset], Analysis]:
    """Load the files of a recording, and analyse it."""
    try:
        trials = [load_recording(path, mapping) for path, mapping in zip(paths, mappings, strict=True)]
        return trials, analyse(trials, add_course(methods, mappings[0]))
    except NUMERICAL_ERRORS as error:
        return [], refuse_recording(error)


def refuse_recording(error: Exception) -> Analysis:
    """Analysis of a recording that cannot be used."""
    log.warning("refused", exc_info=error)
    reason = str(error)
    if not isinstance(error, DataError):
        reason = f"the analysis failed numerically ({type(error).__name__}: {error})."
    check = Check([Finding("file", "refused", reason)], "undecided", {})
    return Analysis(check, {}, {}, pd.DataFrame([{"verdict": "refused", "reasons": reason}]))


def tabulate_analysis(
    name: str, mapping: Mapping[str, Any], analysis: Analysis, keys: Mapping[str, str]
) -> pd.DataFrame:
    """Rows of an analysis for a table of many recordings."""
    recommendation = recommend(analysis)
    labels = analysis.table.get("label", pd.Series(index=analysis.table.index, dtype=object))
    groups = {"recording": name, **{group: mapping[group] for group in GROUPS}}
    table = analysis.table.assign(
        **groups,
        key=labels.map(keys),
        recommended=labels.eq(recommendation.label) & labels.notna(),
        recommendation=recommendation.text,
    )
    return table[[*groups, *[column for column in table if column not in groups]]]


def export_estimates(
    estimates: Mapping[str, Sequence[Estimate]], folder: str | os.PathLike[str], *, overwrite: bool = False
) -> None:
    """Write estimates as NetCDF, MATLAB and CSV files."""
    folder = Path(folder)
    for key, trials in estimates.items():
        folder.mkdir(parents=True, exist_ok=True)
        stems = [key] if len(trials) == 1 else [f"{key}-{number}" for number in range(1, len(trials) + 1)]
        for stem, estimate in zip(stems, trials, strict=True):
            for suffix in SUFFIXES:
                export_estimate(estimate, folder / f"{stem}{suffix}", overwrite=overwrite)
