"""`ankleloop identify`: a recording from its file to page, table and estimates, as the workflow makes them."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ankleloop.command_line.check import show_reading
from ankleloop.command_line.outputs import check_outputs
from ankleloop.command_line.reading import Reading, map_file, name_recording, reading_options
from ankleloop.command_line.terminal import COLOURS, echo, format_table, name_options, show_next, show_progress

if TYPE_CHECKING:
    import pandas as pd

    from ankleloop.studies.study import RecordedStudy

# Keys of `usual_methods`, which --help does not import.
METHODS = ("riv", "pr-moesp", "pi-moesp", "parallel-cascade", "riv-tv")
PARAMETERS = ("K", "B", "I", "G")
SUFFIXES = (".nc", ".mat", ".csv")
EPILOG = """\b
Examples:
  ankleloop identify S1.mat
  ankleloop identify S1.csv --position angle --torque moment --position-unit deg --torque-sign -1
  ankleloop identify S1.h5 --output results --method riv --method pi-moesp
  ankleloop identify S1.mat --variables phase=gait_phase --cycle-onsets phase

\b
Results, in the folder FILE-results or that of --output:
  NAME.html             the page: checks, methods side by side, figures
  NAME-parameters.csv   a row for each method: parameters with intervals, scores, warnings
  NAME/METHOD.nc, .mat  the estimate with its model, for ankleloop.load_estimate, MATLAB and others
  NAME/METHOD.csv       its torques
  NAME/figure-*.csv     the numbers that the figures of the page draw

Exit status: 0 done; 1 the recording is refused, or no method is valid for it (the page says why); 2 wrong usage.
"""


@click.command(epilog=EPILOG)
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option(
    "--output", type=click.Path(file_okay=False, path_type=Path), help="Folder of the results.  [default: FILE-results]"
)
@click.option("--overwrite", is_flag=True, help="Replace the results of an earlier run.")
@click.option(
    "--method",
    "methods",
    type=click.Choice(METHODS),
    multiple=True,
    help="Method to fit, several times for several.  [default: all that are valid; riv-tv with --cycle-onsets or "
    "--schedule]",
)
@reading_options
def identify(file: Path, output: Path | None, overwrite: bool, methods: tuple[str, ...], **values: Any) -> int:
    """Identify a recording: checks, every method that is valid for it, page, table and estimates.

    The results are those that the workflow makes of the recording. Each method is fitted to the first half and scored
    on the second, then fitted to the whole. Files that exist are replaced with --overwrite only.
    """
    reading = map_file(file, **values)
    show_reading(file, reading)
    folder = output or file.with_name(f"{file.name}-results")
    with show_progress():
        table, page = identify_recording(file, reading, folder, methods=methods, overwrite=overwrite)
    echo()
    status = show_results(table, page)
    show_next(f"open {page} in a browser.")
    return status


def identify_recording(
    path: Path, reading: Reading, folder: Path, *, methods: Iterable[str] = (), overwrite: bool = False
) -> tuple[pd.DataFrame, Path]:
    """Analyse a recording as the workflow does, and write its page, its table and its estimates."""
    from ankleloop.studies.recordings import analyse_recordings
    from ankleloop.trials.files import write_csv

    name = name_recording(path)
    study = _make_study(path, reading, name, tuple(methods))
    outputs = _check_outputs(folder, name, path, overwrite=overwrite)
    window = study.settings.figure.model_dump(include={"start", "length"})
    with tempfile.TemporaryDirectory(prefix="ankleloop-") as temporary:
        results = Path(temporary)
        ((_, table, _),) = analyse_recordings(study.mappings(0), study.analysed_methods, results, window)
        write_csv(table, results / f"{name}-parameters.csv")
        _move_results(results, folder, outputs, path, overwrite=overwrite)
    return table, folder / f"{name}.html"


def _make_study(path: Path, reading: Reading, name: str, methods: tuple[str, ...]) -> RecordedStudy:
    """The study of one recording, which the workflow would make of it."""
    from ankleloop.recordings.validity import usual_methods
    from ankleloop.studies.checking import check
    from ankleloop.studies.config import RecordingsStudy
    from ankleloop.studies.study import RecordedStudy

    recording = reading.recording
    changing = "riv-tv" in methods or recording.changes
    usual = usual_methods(reference=recording.reference is not None, changing=changing)
    settings = {
        "kind": "recordings",
        "folder": str(path.absolute().parent).replace("$", "$$"),
        "files": {name: recording.model_dump()},
        "methods": {key: method for key, method in usual.items() if not methods or key in methods},
    }
    return RecordedStudy(name, check(RecordingsStudy, settings, name))


def _check_outputs(folder: Path, name: str, path: Path, *, overwrite: bool) -> list[Path]:
    """Files that the results may have; refuse to replace any of them unasked, before anything is computed or made."""
    from ankleloop.pages.recordings import FIGURES

    estimates = [Path(name, f"{key}{suffix}") for key in METHODS for suffix in SUFFIXES]
    numbers = [Path(name, f"figure-{kind}.csv") for kind in FIGURES]
    outputs = [Path(f"{name}.html"), Path(f"{name}-parameters.csv"), *estimates, *numbers]
    existing = next(parent for parent in (folder / name).absolute().parents if parent.exists())
    if not existing.is_dir() or not os.access(existing, os.W_OK):
        raise click.UsageError(f"{folder}: the folder cannot be made or written to: name another one by --output.")
    targets = [folder / output for output in outputs if (folder / output).parent.is_dir()]
    remedy = "--overwrite replaces results, --output names another folder."
    check_outputs(targets, remedy, overwrite=overwrite, inputs=[path])
    return outputs


def _move_results(results: Path, folder: Path, outputs: Iterable[Path], path: Path, *, overwrite: bool) -> None:
    """Move results to their names; remove what an earlier run made and this one did not."""
    from ankleloop.trials.files import atomic_file

    folder.mkdir(parents=True, exist_ok=True)
    made = {output for output in outputs if (results / output).exists()}
    for output in made:
        (folder / output).parent.mkdir(exist_ok=True)
        with atomic_file(folder / output, overwrite=overwrite, inputs=[path]) as partial:
            shutil.copyfile(results / output, partial)
    for output in {*outputs} - made:
        (folder / output).unlink(missing_ok=True)


def show_results(table: pd.DataFrame, page: Path) -> int:
    """Show the recommendation, the methods side by side, and where the results are."""
    from ankleloop.quantities import QUANTITIES
    from ankleloop.recordings.recommendation import format_with_interval, select_valid_methods

    first, valid = table.iloc[0], select_valid_methods(table)
    echo(f"{click.style(first['verdict'], fg=COLOURS[first['verdict']])}: {first['recommendation']}")
    if not valid.empty:
        columns = [name for name in ("vaf_unseen", *PARAMETERS) if name in valid]
        heading = ["method", *(QUANTITIES[name].label for name in columns), ""]
        rows = [
            [row["label"], *(format_with_interval(row, name) for name in columns), "" if row["trusted"] else "warning"]
            for _, row in valid.iterrows()
        ]
        echo(f"\n{format_table([heading, *rows])}")
        absent = table[~table.index.isin(valid.index)]
        for _, row in absent.iterrows():
            echo(f"not fitted: {row['label']}: {row['warnings']}")
    elif first["verdict"] == "refused":
        echo(first["reasons"])
        show_next(*name_options(first["reasons"]))
    echo(f"\npage       {page}\ntable      {page.with_name(f'{page.stem}-parameters.csv')}")
    if not valid.empty:
        echo(f"estimates  {page.with_suffix('')}")
    return int(valid.empty)
