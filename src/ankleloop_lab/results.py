"""What is written of recordings: a page, figures with their numbers, estimates and a table of each."""

from __future__ import annotations

import logging
import shutil
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
import xarray as xr

from ankleloop.errors import NUMERICAL_ERRORS, locate_errors
from ankleloop.trials.files import atomic_file, write_csv
from ankleloop_lab.pages.recordings import draw_figures, render_recording_page
from ankleloop_lab.recordings import files
from ankleloop_lab.recordings.analysis import Analysis, analyse
from ankleloop_lab.recordings.processes import run_each

log = logging.getLogger(__name__)

WINDOW = {"start": 10.0, "length": 5.0}  # s, of the torques that are drawn
Mappings = Mapping[str, Mapping[str, Any]]  # by the names of recordings, or the keys of methods


def analyse_recordings(
    recordings: Mappings,
    methods: Mappings,
    folder: Path,
    window: Mapping[str, Any],
    *,
    index: str | None = None,
) -> Iterator[tuple[str, pd.DataFrame]]:
    """Analyse recordings one after the other, and write their pages and estimates; name and table of each.

    A recording that cannot be used, or that fails numerically, has a page that says so; all others go on. They are
    analysed in a child process, which the system may kill: that says nothing of the recording, so it is an error, and
    the same command tries again. Other systems than Linux cannot fork a process safely: there this one analyses them.
    """
    analyse_one = partial(
        analyse_recording, methods=methods, folder=folder, window=window, index=index
    )
    tables = run_each(analyse_one, list(recordings.items()))
    for name, mapping in recordings.items():
        with locate_errors(f"recording {name}, {', '.join(map(str, mapping['paths']))}"):
            table = next(tables)
        yield name, table


def analyse_recording(
    recording: tuple[str, Mapping[str, Any]],
    methods: Mappings,
    folder: Path,
    window: Mapping[str, Any] = WINDOW,
    index: str | None = None,
) -> pd.DataFrame:
    """Table of a recording, given by its name and mapping; its page and its estimates are written."""
    name, mapping = recording
    keys = {method["label"] or key: key for key, method in methods.items()}

    def write(trials: Sequence[xr.Dataset], analysis: Analysis) -> pd.DataFrame:
        log.info("%s: %s\n%s", name, analysis.check.verdict, analysis.check)
        estimates = {keys[label]: estimate for label, estimate in analysis.estimates.items()}
        files.export_estimates(estimates, folder / name)
        figures = draw_figures(trials, analysis, window)
        for kind, figure in figures.items() if estimates else ():  # the numbers that they draw
            if figure.data is not None:
                write_csv(figure.data, folder / name / f"figure-{kind}.csv", overwrite=True)
        page = render_recording_page(name, mapping, analysis, figures, index=index)
        with atomic_file(folder / f"{name}.html", overwrite=True) as path:
            path.write_text(page, encoding="utf-8")
        return files.tabulate_analysis(name, mapping, analysis, keys)

    try:
        trials = list(map(files.load_recording, mapping["paths"], mapping["parts"]))
        named = {label: methods[key] for label, key in keys.items()}
        course = files.merge_courses(mapping["parts"])
        return write(trials, analyse(trials, files.add_course(named, course)))
    except NUMERICAL_ERRORS as error:
        shutil.rmtree(folder / name, ignore_errors=True)
        return write([], files.refuse_recording(error))
