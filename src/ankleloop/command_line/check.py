"""`ankleloop check`: what can be identified from a recording, before anything is fitted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ankleloop.command_line.reading import FILE, map_trials, reading_options
from ankleloop.command_line.terminal import COLOURS, echo, join_words, show_correction, show_next
from ankleloop.config.recording_settings import Recording, name_trials

if TYPE_CHECKING:
    import xarray as xr

    from ankleloop.recordings.checks import Check

EPILOG = """\b
Examples:
  ankleloop check S1.mat
  ankleloop check S1.csv --position angle --torque moment --position-unit deg
  ankleloop check S2.mat --position "data[:, 2]" --torque "data[:, 3]"
  ankleloop check S3.mat --position "trial[*].pos" --torque "trial[*].tq"
"""


@click.command(epilog=EPILOG)
@click.argument("file", type=FILE)
@reading_options
def check(file: Path, **values: Any) -> int:
    """Check what can be identified from a recording, before anything is fitted to it.

    FILE is a table of text (.csv, .csv.gz, .txt, .tsv), or a MATLAB (.mat), HDF5 (.h5), NetCDF (.nc) or FLB (.flb)
    file. If an FLB file has several cases, they are listed. Length, clipping, spikes, sign of the torque, coherence,
    excitation and drift are checked, and whether the loop is closed, which decides which methods are valid.
    """
    words = click.get_current_context().obj
    verdicts = set()
    for name, recording in name_trials(file.name, map_trials(file, **values)).items():
        _, result = check_file(file, recording)
        echo("" if name == file.name else f"\n{click.style(name, bold=True)}")
        for finding in result.findings:
            verdict = click.style(f"{finding.verdict:>8}", fg=COLOURS[finding.verdict])
            echo(f"{verdict}  {finding.name}: {finding.text}")
        show_correction(result.remedy, words)
        verdicts.add(result.verdict)
    if verdicts == {"refused"}:
        return 1
    show_next(join_words(["ankleloop", "identify", *words[1:]]))
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
