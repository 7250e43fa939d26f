"""The recordings of a chunk: checks, methods, exported estimates and a page of each."""

from __future__ import annotations

import logging
import multiprocessing
import shutil
import signal
import sys
from collections.abc import Callable, Iterator, Mapping
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import pandas as pd
import xarray as xr

from ankleloop.errors import NUMERICAL_ERRORS, ResourceError
from ankleloop.pages.recordings import EmbeddedFigure, embed_recording_figures, render_recording_page
from ankleloop.recordings.analysis import Analysis
from ankleloop.recordings.files import analyse_files, export_estimates, refuse_recording, tabulate_analysis
from ankleloop.recordings.recommendation import recommend
from ankleloop.studies.failures import locate_errors
from ankleloop.trials.files import atomic_file, write_csv

log = logging.getLogger(__name__)

Results = tuple[pd.DataFrame, list[str]]


def analyse_recordings(
    points: Mapping[str, Mapping[str, Any]],
    methods: Mapping[str, Mapping[str, Any]],
    folder: Path,
    window: Mapping[str, Any],
    *,
    index: str | None = None,
) -> Iterator[tuple[str, pd.DataFrame, list[str]]]:
    """Analyse recordings one after the other, and write their pages and estimates.

    A recording that cannot be used, or that fails numerically, has a page that says so; all others go on. A process
    that is killed says nothing of its recording: that is an error, and the same command tries again.
    """
    job = _Job(Path(folder), methods, window, index)
    worker = Worker(job.analyse)
    for name, mapping in points.items():
        with locate_errors(f"recording {name}, {', '.join(map(str, mapping['paths']))}"):
            results = worker.call(name, mapping)
        yield (name, *results)


class _Job:
    """What the recordings of a chunk share."""

    def __init__(
        self, folder: Path, methods: Mapping[str, Mapping[str, Any]], window: Mapping[str, Any], index: str | None
    ) -> None:
        self._folder, self._window, self._index = folder, window, index
        self._keys = {method["label"] or key: key for key, method in methods.items()}
        self._methods = {label: methods[key] for label, key in self._keys.items()}

    def analyse(self, name: str, mapping: Mapping[str, Any]) -> Results:
        """Analyse a recording, and write its files."""
        try:
            trials, analysis = analyse_files(mapping["paths"], mapping["parts"], self._methods)
            return self._write(name, mapping, trials[0] if trials else None, analysis)
        except NUMERICAL_ERRORS as error:  # of a figure or an export
            return self.refuse(name, mapping, error)

    def refuse(self, name: str, mapping: Mapping[str, Any], error: Exception) -> Results:
        """Write the page of a recording whose analysis failed, and nothing else of it."""
        shutil.rmtree(self._folder / name, ignore_errors=True)
        return self._write(name, mapping, None, refuse_recording(error))

    def _write(self, name: str, mapping: Mapping[str, Any], trial: xr.Dataset | None, analysis: Analysis) -> Results:
        log.info("%s: %s\n%s", name, analysis.check.verdict, analysis.check)
        table = tabulate_analysis(name, mapping, analysis, self._keys)
        records = {self._keys[label]: estimates for label, estimates in analysis.records.items()}
        export_estimates(records, self._folder / name, overwrite=True)
        figures = embed_recording_figures(trial, analysis, **self._window)
        if records:
            self._write_numbers(name, figures)
        page = render_recording_page(name, mapping, analysis, recommend(analysis), figures, index=self._index)
        with atomic_file(self._folder / f"{name}.html", overwrite=True) as path:
            path.write_text(page, encoding="utf-8")
        return table, [finding.text for finding in analysis.check.findings if finding.verdict == "refused"]

    def _write_numbers(self, name: str, figures: Mapping[str, EmbeddedFigure]) -> None:
        """Write the numbers that the figures of a recording draw."""
        for kind, figure in figures.items():
            if figure.data is not None:
                write_csv(figure.data, self._folder / name / f"figure-{kind}.csv", overwrite=True)


class Worker:
    """Runs a function in one child process call after call, and in a new one where the system killed it.

    Other systems than Linux cannot fork a process safely: there the function runs in the calling process.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self._child: tuple[Any, Connection] | None = None

    def call(self, *args: Any) -> Any:
        """Call the function; its results and errors are pickled."""
        if sys.platform != "linux":
            return self._function(*args)
        process, pipe = self._child = self._child or self._start()
        try:
            pipe.send(args)
            succeeded, value = pipe.recv()
        except (EOFError, ConnectionError):
            self._child = None
            process.join()
            code = process.exitcode
            end = f"it was killed by {signal.Signals(-code).name}" if code < 0 else f"it ended with code {code}"
            raise ResourceError(
                f"the process of the analysis came to no end ({end}): most often memory was short; free memory, or "
                "take a shorter part of the recording (start, stop)."
            ) from None
        if succeeded:
            return value
        raise value

    def _start(self) -> tuple[Any, Connection]:
        context = multiprocessing.get_context("fork")
        pipe, other = context.Pipe()
        process = context.Process(target=_serve, args=(self._function, other, pipe), daemon=True)
        process.start()
        other.close()
        return process, pipe


def _serve(function: Callable[..., Any], pipe: Connection, other: Connection) -> None:
    """Answer calls until the other end of the pipe is closed."""
    other.close()
    while True:
        try:
            args = pipe.recv()
        except EOFError:
            return
        try:
            answer = True, function(*args)
        except Exception as error:
            log.exception("failed")
            portable = isinstance(error, OSError) or error.args == (str(error),)
            answer = False, error if portable else RuntimeError(f"{type(error).__name__}: {error}")
        pipe.send(answer)
