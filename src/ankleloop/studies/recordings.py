"""The recordings of a chunk: checks, methods, exported estimates and a page of each."""

from __future__ import annotations

import logging
import multiprocessing
import shutil
import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import pandas as pd
import xarray as xr

from ankleloop.errors import NUMERICAL_ERRORS, ResourceError, locate_errors
from ankleloop.pages.recordings import embed_recording_figures, render_recording_page
from ankleloop.recordings.analysis import Analysis
from ankleloop.recordings.files import analyse_files, export_estimates, refuse_recording, tabulate_analysis
from ankleloop.recordings.recommendation import recommend
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
    keys = {method["label"] or key: key for key, method in methods.items()}
    methods_by_label = {label: methods[key] for label, key in keys.items()}

    def write(name: str, mapping: Mapping[str, Any], trials: Sequence[xr.Dataset], analysis: Analysis) -> Results:
        log.info("%s: %s\n%s", name, analysis.check.verdict, analysis.check)
        records = {keys[label]: estimates for label, estimates in analysis.records.items()}
        export_estimates(records, folder / name, overwrite=True)
        figures = embed_recording_figures(trials[0] if trials else None, analysis, **window)
        for kind, figure in figures.items() if records else ():  # the numbers that they draw
            if figure.data is not None:
                write_csv(figure.data, folder / name / f"figure-{kind}.csv", overwrite=True)
        page = render_recording_page(name, mapping, analysis, recommend(analysis), figures, index=index)
        with atomic_file(folder / f"{name}.html", overwrite=True) as path:
            path.write_text(page, encoding="utf-8")
        refusals = [finding.text for finding in analysis.check.findings if finding.verdict == "refused"]
        return tabulate_analysis(name, mapping, analysis, keys), refusals

    def analyse(name: str, mapping: Mapping[str, Any]) -> Results:
        try:
            return write(name, mapping, *analyse_files(mapping["paths"], mapping["parts"], methods_by_label))
        except NUMERICAL_ERRORS as error:  # of a figure or an export
            shutil.rmtree(folder / name, ignore_errors=True)
            return write(name, mapping, [], refuse_recording(error))

    with run_in_child(analyse) as call:
        for name, mapping in points.items():
            with locate_errors(f"recording {name}, {', '.join(map(str, mapping['paths']))}"):
                results = call(name, mapping)
            yield (name, *results)


@contextmanager
def run_in_child(function: Callable[..., Any]) -> Iterator[Callable[..., Any]]:
    """A function that runs in one child process, which the system may kill; its results and errors are pickled.

    Other systems than Linux cannot fork a process safely: there the function runs in the calling process.
    """
    if sys.platform != "linux":
        yield function
        return
    context = multiprocessing.get_context("fork")
    pipe, other = context.Pipe()
    process = context.Process(target=_serve, args=(function, other, pipe), daemon=True)
    process.start()
    other.close()

    def call(*args: Any) -> Any:
        try:
            pipe.send(args)
            succeeded, value = pipe.recv()
        except (EOFError, ConnectionError):
            process.join()
            code = process.exitcode or 0
            end = f"it was killed by {signal.Signals(-code).name}" if code < 0 else f"it ended with code {code}"
            raise ResourceError(
                f"the process of the analysis came to no end ({end}): most often memory was short; free memory, or "
                "take a shorter part of the recording (start, stop)."
            ) from None
        if succeeded:
            return value
        raise value

    with pipe:  # closed, it ends the child
        yield call


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
