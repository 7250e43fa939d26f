"""`ankleloop identify`: recordings from their files to pages, a table and estimates."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import click

from ankleloop.command_line.check import show_reading
from ankleloop.command_line.outputs import check_outputs
from ankleloop.command_line.reading import map_file, name_recordings, reading_options
from ankleloop.command_line.terminal import correct_command, echo, show_next, show_progress
from ankleloop.errors import DataError
from ankleloop.studies.recording_settings import Recording

METHODS = ("riv", "pr-moesp", "pi-moesp", "parallel-cascade", "riv-tv")  # keys of `usual_methods`
EPILOG = """\b
Examples:
  ankleloop identify S1.mat
  ankleloop identify *.mat --torque-sign -1 --output results
  ankleloop identify S1.csv --position angle --torque moment --position-unit deg --delay estimate
  ankleloop identify S1.h5 --method riv --method pi-moesp --option riv.order=3
  ankleloop identify S1.mat --variables phase=gait_phase --cycle-onsets phase

\b
Results, in the folder of --output:
  recordings.csv        of several files: a row for each recording and method
  recordings-figure.png of several files: K, B, I and G of all with their intervals
  NAME.html             the page: recommendation, checks, methods side by side, figures
  NAME-parameters.csv   a row for each method: parameters with intervals, scores, warnings
  NAME/METHOD.nc, .mat  the estimate with its model, for ankleloop.load_estimate, MATLAB and others
  NAME/METHOD.csv       its torques
  NAME/figure-*.csv     the numbers that the figures of the page draw

Exit status: 0 done; 1 a recording is refused, or no method is valid for it (the page says why); 2 wrong usage.
"""


@click.command(epilog=EPILOG)
@click.argument(
    "files", nargs=-1, required=True, metavar="FILE...", type=click.Path(exists=True, dir_okay=False, path_type=Path)
)
@click.option(
    "--output",
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder of the results.  [default: FILE-results, of several files ankleloop-results]",
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
@click.option(
    "--delay",
    metavar="S|estimate",
    help="Reflex delay of every method [s]; `estimate` for the methods that can.  [default: that of each method]",
)
@click.option(
    "--option",
    "options",
    multiple=True,
    metavar="[METHOD.]NAME=VALUE",
    help="Option of a method, as riv.order=3; without METHOD of every method that has it. Several times for several.",
)
@reading_options
def identify(
    files: tuple[Path, ...],
    output: Path | None,
    overwrite: bool,
    methods: tuple[str, ...],
    delay: str | None,
    options: tuple[str, ...],
    **values: Any,
) -> int:
    """Identify recordings: checks, every method that is valid, pages, one table and the estimates.

    The results are those that the workflow makes of a recording. Each method is fitted to the first half and scored
    on the second, then fitted to the whole. A file that cannot be used is refused with the reason, and the others are
    identified. Files that exist are replaced with --overwrite only, or where they say no more than a refusal.
    """
    from ankleloop.command_line import analysis

    folder = output or (Path("ankleloop-results") if len(files) > 1 else Path(f"{files[0]}-results"))
    named = [f"delay={'null' if delay == 'estimate' else delay}"] if delay else []
    fields, recordings, tables = _parse_options([*named, *options]), name_recordings(files), []
    if len(files) > 1:
        summary = [analysis.TABLE, f"{analysis.FIGURE}.png"]
        check_outputs(folder, summary, analysis.REMEDY, overwrite=overwrite, inputs=files)
    for name, path in recordings.items():
        study = analysis.make_study(name, path, _map_file(path, values, alone=len(files) == 1), methods, fields)
        with show_progress():
            table, page = analysis.identify_recording(study, folder, overwrite=overwrite)
        echo()
        analysis.show_results(table, page)
        if table["verdict"].iloc[0] == "refused":
            others = {str(file) for file in files if file != path}
            words = [word for word in click.get_current_context().obj if word not in others]
            show_next(*correct_command(table["reasons"].iloc[0], words))
        echo()
        tables.append(table)
    show_next(f"open {analysis.write_summary(tables, folder) if len(files) > 1 else page}")
    return int(any(analysis.select_valid_methods(table).empty for table in tables))


def _map_file(path: Path, values: Mapping[str, Any], *, alone: bool) -> Recording:
    """How a file is read; one of several that is damaged is refused later, with a page that says why."""
    try:
        reading = map_file(path, **values)
    except DataError:
        if alone:
            raise
        echo(click.style(path.name, bold=True))
        return Recording(file=path.name)
    show_reading(path, reading)
    return reading.recording


def _parse_options(texts: Iterable[str]) -> dict[str, Any]:
    """Values of options by [METHOD.]NAME."""
    import yaml

    options = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise click.UsageError(f"--option {text}: write it as NAME=VALUE or METHOD.NAME=VALUE.")
        options[name.strip()] = yaml.safe_load(value)
    return options
