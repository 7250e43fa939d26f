"""`ankleloop check`: what can be identified from a recording, before anything is fitted."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ankleloop.command_line.reading import FILE, map_file, reading_options
from ankleloop.command_line.terminal import COLOURS, echo, show_correction, show_next

if TYPE_CHECKING:
    import xarray as xr

    from ankleloop.config.recording_settings import Recording
    from ankleloop.recordings.checks import Check

EPILOG = """\b
Examples:
  ankleloop check S1.mat
  ankleloop check S1.csv --position angle --torque moment --position-unit deg
"""


@click.command(epilog=EPILOG)
@click.argument("file", type=FILE)
@reading_options
def check(file: Path, **values: Any) -> int:
    """Check what can be identified from a recording, before anything is fitted to it.

    FILE is a CSV (also .csv.gz), MATLAB (.mat), HDF5 (.h5), NetCDF (.nc) or FLB (.flb) file. If an FLB file has several
    cases, they are listed. Length, clipping, spikes, sign of the torque, coherence, excitation and drift are checked,
    and whether the loop is closed, which decides which methods are valid.
    """
    _, result = check_file(file, map_file(file, **values))
    echo()
    for finding in result.findings:
        echo(
            f"{click.style(f'{finding.verdict:>8}', fg=COLOURS[finding.verdict])}  {finding.name}: {finding.text}"
        )
    words = click.get_current_context().obj
    show_correction(result.remedy, words)
    if result.verdict == "refused":
        return 1
    show_next(shlex.join(["ankleloop", "identify", *words[1:]]))
    return 0


def check_file(path: Path, recording: Recording) -> tuple[xr.Dataset | None, Check]:
    """Read a recording and check it, as its analysis does; without a trial if it cannot be used."""
    from ankleloop.errors import NUMERICAL_ERRORS
    from ankleloop.recordings.analysis import largest_options
    from ankleloop.recordings.checks import check_trial
    from ankleloop.recordings.files import check_course, load_recording, refuse_recording
    from ankleloop.recordings.validity import usual_methods

    methods = usual_methods(reference="reference" in recording.channels)
    mapping = recording.model_dump()
    try:
        trial = load_recording(path, mapping)
        result = check_trial(trial, **largest_options(methods))
        findings = [*result.findings, *check_course(trial, mapping)]
        return trial, replace(result, findings=findings)
    except NUMERICAL_ERRORS as error:
        return None, refuse_recording(error).check
