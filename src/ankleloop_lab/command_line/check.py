"""`ankleloop check`: what can be identified from a recording, before anything is fitted."""

from __future__ import annotations

import traceback
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import ZIP_DEFLATED, ZipFile

import click

from ankleloop_lab.command_line.reading import FILE, map_trials, reading_options
from ankleloop_lab.command_line.terminal import (
    COLOURS,
    echo,
    join_words,
    list_words,
    show_correction,
    show_next,
)
from ankleloop_lab.recordings.settings import Recording, name_trials

if TYPE_CHECKING:
    import xarray as xr

    from ankleloop_lab.recordings.checks import Check

EPILOG = """\b
Examples:
  ankleloop check S1.mat
  ankleloop check S1.csv --position angle --torque moment --position-unit deg
  ankleloop check S2.mat --position "data[:, 2]" --torque "data[:, 3]"
  ankleloop check S3.mat --position "trial[*].pos" --torque "trial[*].tq"
  ankleloop check S4.mat --bundle report.zip
"""
BUNDLE = "Write what a report of a fault needs: the command, versions, how the file was read, and what was found."
# Of a copy of the repository, in which the packages lie; an installation has none.
REPOSITORY = Path(__file__).parents[3]
SAMPLES = "Put the file with its samples into the bundle as well."


def _check_bundle(
    context: click.Context, option: click.Parameter, path: Path | None
) -> Path | None:
    """Refuse to replace a file, and another kind of file."""
    if path is not None and (path.exists() or path.suffix != ".zip"):
        raise click.BadParameter(f"{path} is no new file whose name ends in .zip.")
    return path


@click.command(epilog=EPILOG)
@click.argument("file", type=FILE)
@click.option(
    "--bundle",
    type=click.Path(path_type=Path),
    callback=_check_bundle,
    metavar="NEW.zip",
    help=BUNDLE,
)
@click.option("--bundle-samples", "samples", is_flag=True, help=SAMPLES)
@reading_options
def check(file: Path, bundle: Path | None, samples: bool, **values: Any) -> int:
    """Check what can be identified from a recording, before anything is fitted to it.

    FILE is a table of text (.csv, .csv.gz, .txt, .tsv, .sto, .mot), or a MATLAB (.mat), HDF5 (.h5, .hdf5), NetCDF
    (.nc), FLB (.flb), C3D (.c3d) or TDMS (.tdms) file. If an FLB file has several cases, they are listed. Length,
    clipping, spikes, sign of the torque, coherence, excitation and drift are checked, and whether the loop is closed,
    which decides which methods are valid.
    """
    if samples and bundle is None:
        raise click.UsageError("--bundle-samples needs --bundle NEW.zip.")
    report: dict[str, Any] = {"command": click.get_current_context().obj}
    try:
        return _show_checks(file, values, report)
    finally:  # also if the file cannot be read
        if bundle is not None:
            _write_bundle(bundle, report, [file] if samples else [])


def _show_checks(file: Path, values: dict[str, Any], report: dict[str, Any]) -> int:
    """Check each recording of a file, and show what is found, which goes into a report as well; the exit status."""
    verdicts = set()
    for name, recording in name_trials(file.name, map_trials(file, **values)).items():
        trial, result = check_file(file, recording)
        report[name] = {"options": recording.model_dump(), "findings": result.findings}
        if trial is not None:
            report[name]["read"] = trial.attrs | trial.to_dataframe().describe().to_dict()
        echo("" if name == file.name else f"\n{click.style(name, bold=True)}")
        for finding in result.findings:
            verdict = click.style(f"{finding.verdict:>8}", fg=COLOURS[finding.verdict])
            echo(f"{verdict}  {finding.name}: {finding.text}")
        show_correction(find_advice(file, recording, result.remedy), report["command"])
        verdicts.add(result.verdict)
    if verdicts == {"refused"}:
        return 1
    show_next(join_words(["ankleloop", "identify", str(file), *list_words(values)]))
    return 0


def _write_bundle(path: Path, report: dict[str, Any], files: Sequence[Path]) -> None:
    """Write a report with the error that ends the command and all versions, and files as they are."""
    from pydantic_core import to_json

    from ankleloop.trials.files import atomic_file
    from ankleloop_lab.provenance import read_provenance

    report |= {"error": traceback.format_exc(), "versions": read_provenance(REPOSITORY)}
    with atomic_file(path) as partial, ZipFile(partial, "w", ZIP_DEFLATED) as archive:
        archive.writestr("report.json", to_json(report, indent=2, fallback=str))
        for file in files:
            archive.write(file, file.name)
    show_next(f"look through report.json in {path}, then add {path} to your report")


def check_file(path: Path, recording: Recording) -> tuple[xr.Dataset | None, Check]:
    """Read a recording and check it, as its analysis does; without a trial if it cannot be used."""
    from ankleloop.errors import NUMERICAL_ERRORS
    from ankleloop_lab.recordings.analysis import largest_options
    from ankleloop_lab.recordings.checks import check_trial
    from ankleloop_lab.recordings.files import check_course, load_recording, refuse_recording
    from ankleloop_lab.recordings.validity import usual_methods

    methods = usual_methods(reference="reference" in recording.channels)
    mapping = recording.model_dump()
    try:
        trial = load_recording(path, mapping)
        result = check_trial(trial, **largest_options(methods))
        findings = [*result.findings, *check_course(trial, mapping)]
        return trial, replace(result, findings=findings)
    except NUMERICAL_ERRORS as error:
        return None, refuse_recording(error).check


def find_advice(
    path: Path,
    recording: Recording,
    remedy: Mapping[str, Any],
    methods: Mapping[str, Mapping[str, Any]] | None = None,
) -> Mapping[str, Any]:
    """What of a remedy is advised: values with which the verdict improves, or all of it where only the user knows one.

    They are tried on the file, with those that are then asked for in turn. With methods the estimates count, too.
    """
    is_tried = remedy.keys() <= Recording.model_fields.keys() and None not in remedy.values()
    if not remedy or not is_tried:
        return remedy
    before, _ = _rank(path, recording, methods)
    values: dict[str, Any] = {}
    while remedy:
        values |= remedy
        after, remedy = _rank(path, recording.model_copy(update=values), methods)
        if after < before:
            return _leave_out(path, recording, values, methods, after)
        if None in remedy.values() or remedy.keys() & values.keys():
            break
    return {}


def _leave_out(
    path: Path,
    recording: Recording,
    values: Mapping[str, Any],
    methods: Mapping[str, Mapping[str, Any]] | None,
    rank: tuple[int, int, int],
) -> Mapping[str, Any]:
    """Those of several values without which a recording would be worse."""
    for name in values if len(values) > 1 else ():
        others = {other: value for other, value in values.items() if other != name}
        if _rank(path, recording.model_copy(update=others), methods)[0] <= rank:
            return _leave_out(path, recording, others, methods, rank)
    return values


def _rank(
    path: Path, recording: Recording, methods: Mapping[str, Mapping[str, Any]] | None
) -> tuple[tuple[int, int, int], Mapping[str, Any]]:
    """How bad a recording is, by its reading and verdict, then by its estimates and findings; and its remedy."""
    from ankleloop.checks.findings import VERDICTS
    from ankleloop_lab.recordings.analysis import analyse
    from ankleloop_lab.recordings.files import add_course

    trial, check = check_file(path, recording)
    if trial is None:
        return (len(VERDICTS), 0, 0), check.remedy
    if check.verdict == "refused":  # by whatever was looked at first
        return (VERDICTS.index("refused"), 0, 0), check.remedy
    remedy = check.remedy
    doubtful = 0
    findings = sum(finding.verdict != "ok" for finding in check.findings)
    if methods:
        analysis = analyse(trial, add_course(methods, recording.model_dump()))
        remedy |= analysis.remedy
        doubtful = int((~analysis.table["trusted"].astype(bool)).sum())
    return (VERDICTS.index(check.verdict), doubtful, findings), remedy
