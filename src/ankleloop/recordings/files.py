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
from ankleloop.records.drift import remove_drift
from ankleloop.records.readers import read_trial
from ankleloop.records.reading_options import ReadingOptions
from ankleloop.records.trial import segment

__all__ = ["analyse_files", "export_estimates", "load_recording", "refuse_recording", "tabulate_analysis"]

SUFFIXES = (".nc", ".mat", ".csv")
GROUPS = ("subject", "condition", "trial")

log = logging.getLogger(__name__)


def load_recording(path: str | os.PathLike[str], mapping: Mapping[str, Any]) -> xr.Dataset:
    """Read a recording, take the part of it that is to be analysed, and remove the drift.

    Parameters
    ----------
    path : path-like
        The file.
    mapping : dict
        Options of `ankleloop.read_trial` by name; `start` and `stop` [s] of the part, None for the ends of the
        recording; `drift`, the degree of `ankleloop.records.drift.remove_drift`, None for no removal. Other keys are
        ignored.

    Returns
    -------
    xarray.Dataset
        The trial.

    Raises
    ------
    DataError
        If there is no such file, or it holds no valid trial.

    Examples
    --------
    >>> load_recording("nowhere.csv", {})
    Traceback (most recent call last):
      ...
    ankleloop.errors.DataError: there is no file nowhere.csv in the folder of the recordings.
    """
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
    """Load the files of a recording, and analyse it.

    Parameters
    ----------
    paths : sequence of path-like
        Files of the recording: one, or one for each trial that is merged.
    mappings : sequence of dict
        Mapping of each file, for `load_recording`; `cycle_onsets` or `schedule` of the first is what the parameters of
        methods for joints that change are functions of.
    methods : dict of str to dict
        Methods by label, for `ankleloop.recordings.analysis.analyse`.

    Returns
    -------
    trials : list of xarray.Dataset
        Trials of the recording; none if they cannot be used.
    analysis : Analysis
        Its analysis; if the trials cannot be used, one that is refused with the reason.
    """
    try:
        trials = [load_recording(path, mapping) for path, mapping in zip(paths, mappings, strict=True)]
        return trials, analyse(trials, add_course(methods, mappings[0]))
    except NUMERICAL_ERRORS as error:
        return [], refuse_recording(error)


def refuse_recording(error: Exception) -> Analysis:
    """Analysis of a recording that cannot be used.

    Parameters
    ----------
    error : Exception
        What is wrong with it: a `DataError` says it in words; other errors are those of a numerical routine.

    Returns
    -------
    Analysis
        One that is refused, with the reason.

    Examples
    --------
    >>> refuse_recording(FloatingPointError("overflow")).check.reasons
    ['the analysis failed numerically (FloatingPointError: overflow).']
    """
    log.warning("refused", exc_info=error)
    reason = str(error)
    if not isinstance(error, DataError):
        reason = f"the analysis failed numerically ({type(error).__name__}: {error})."
    check = Check([Finding("file", "refused", reason)], "undecided", {})
    return Analysis(check, {}, {}, pd.DataFrame([{"verdict": "refused", "reasons": reason}]))


def tabulate_analysis(
    name: str, mapping: Mapping[str, Any], analysis: Analysis, keys: Mapping[str, str]
) -> pd.DataFrame:
    """Rows of an analysis for a table of many recordings.

    Parameters
    ----------
    name : str
        Name of the recording.
    mapping : dict
        `subject`, `condition` and `trial` of the recording.
    analysis : Analysis
        Its analysis.
    keys : dict of str to str
        Key of each method by its label.

    Returns
    -------
    pandas.DataFrame
        `recording`, `subject`, `condition`, `trial`, the columns of `Analysis.table`, `key`, that of the method,
        `recommended`, whether it is the method to take, and `recommendation`, the text of that.
    """
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
    """Write estimates as NetCDF, MATLAB and CSV files.

    Parameters
    ----------
    estimates : dict of str to sequence of Estimate
        Estimates by the key of their method, one for each trial; `Analysis.records` by key instead of label.
    folder : path-like
        Folder of the files; it is made if there is anything to write. The names of the files are the keys, with the
        number of the trial where there are several.
    overwrite : bool
        Whether to replace files of these names; without it existing files are refused.

    Raises
    ------
    DataError
        If a file exists, or cannot be written.
    """
    folder = Path(folder)
    for key, trials in estimates.items():
        folder.mkdir(parents=True, exist_ok=True)
        stems = [key] if len(trials) == 1 else [f"{key}-{number}" for number in range(1, len(trials) + 1)]
        for stem, estimate in zip(stems, trials, strict=True):
            for suffix in SUFFIXES:
                export_estimate(estimate, folder / f"{stem}{suffix}", overwrite=overwrite)
