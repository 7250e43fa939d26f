"""`ankleloop check`: what can be identified from a recording, before anything is fitted."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ankleloop.command_line.reading import Reading, map_file, reading_options
from ankleloop.command_line.terminal import correct_command, echo, show_next, show_verdict

if TYPE_CHECKING:
    import xarray as xr

    from ankleloop.recordings.checks import Check

EPILOG = """\b
Examples:
  ankleloop check S1.mat
  ankleloop check S1.csv --position angle --torque moment --position-unit deg
  ankleloop check S1.h5 --position /run1/position --torque /run1/torque --start 5 --stop 65

Exit status: 0 the recording can be identified, perhaps with warnings; 1 it is refused; 2 wrong usage.
"""


@click.command(epilog=EPILOG)
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@reading_options
def check(file: Path, **values: Any) -> int:
    """Check what can be identified from a recording, before anything is fitted to it.

    FILE is a CSV (also .csv.gz), MATLAB (.mat), HDF5 (.h5), NetCDF (.nc) or FLB (.flb) file. If an FLB file has several
    cases, they are listed. Length, clipping, spikes, sign of the torque, coherence, excitation and drift are checked,
    and whether the loop is closed, which decides which methods are valid.
    """
    reading = map_file(file, **values)
    trial, result = check_file(file, reading)
    show_reading(file, reading, trial)
    echo()
    for finding in result.findings:
        show_verdict(finding.verdict, finding.name, finding.text)
    refused = result.verdict == "refused"
    show_next(*correct_command(" ".join(result.reasons), click.get_current_context().obj))
    if not refused:
        show_next(shlex.join(["ankleloop", "identify", str(file), *list_options(reading)]))
    return int(refused)


def check_file(path: Path, reading: Reading) -> tuple[xr.Dataset | None, Check]:
    """Read a recording and check it, as its analysis does."""
    from ankleloop.errors import NUMERICAL_ERRORS
    from ankleloop.recordings.analysis import largest_options
    from ankleloop.recordings.checks import check_trial
    from ankleloop.recordings.files import load_recording, refuse_recording
    from ankleloop.recordings.validity import usual_methods
    from ankleloop.recordings.variation import check_course

    methods = usual_methods(reference=reading.recording.reference is not None)
    try:
        mapping = reading.recording.model_dump()
        trial = load_recording(path, mapping)
        result = check_trial(trial, **largest_options(methods))
        return trial, replace(result, findings=[*result.findings, *check_course(trial, mapping)])
    except NUMERICAL_ERRORS as error:
        return None, refuse_recording(error).check


def show_reading(path: Path, reading: Reading, trial: xr.Dataset | None = None) -> None:
    """Show how a file is read: the variable of each channel, its unit, and where these come from."""
    recording, reasons = reading.recording, reading.reasons
    unit = f"{recording.position_unit}, {reasons['position_unit']}"
    turned = {"position": recording.position_sign, "torque": recording.torque_sign}
    echo(click.style(path.name, bold=True))
    for channel in ("position", "torque", "reference"):
        name = getattr(recording, channel)
        units = "N·m" if channel == "torque" else unit
        sign = ", turned round" if turned.get(channel) == -1 else ""
        text = f"{name} ({reasons[channel]}), in {units}{sign}" if name else f"none ({reasons.get(channel, 'option')})"
        echo(f"  {channel:<10}{text}")
    if trial is not None:
        rate, samples = float(trial.attrs["sampling_rate"]), trial.sizes["time"]
        echo(f"  {'rate':<10}{rate:g} Hz, {samples / rate:.4g} s")


def list_options(reading: Reading) -> list[str]:
    """Options that read a file in this way, with nothing left to names."""
    recording = reading.recording
    options = []
    for name, field in type(recording).model_fields.items():
        value = getattr(recording, name)
        if name != "file" and value != field.get_default():
            options += [f"--{name.replace('_', '-')}", _show_option(value)]
    return options


def _show_option(value: Any) -> str:
    """A value as the command line takes it."""
    if isinstance(value, Mapping):
        return ",".join(f"{name}={variable}" for name, variable in value.items())
    if isinstance(value, tuple):
        return " ".join(_show_option(part) for part in value)
    return f"{value:.12g}" if isinstance(value, float) else str(value)
