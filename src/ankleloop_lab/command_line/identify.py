"""`ankleloop identify`: recordings from their files to pages, a table and estimates."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import click

from ankleloop_lab.command_line.check import find_advice
from ankleloop_lab.command_line.naming import map_recordings, names_option
from ankleloop_lab.command_line.reading import FILE, FOLDER, reading_options
from ankleloop_lab.command_line.terminal import (
    echo,
    find_status,
    show_correction,
    show_next,
    show_progress,
)
from ankleloop_lab.recordings.settings import Recording

EPILOG = """\b
Examples:
  ankleloop identify *.mat --torque-sign -1 --output results
  ankleloop identify S1.csv --position angle --torque moment --position-unit deg --delay estimate
  ankleloop identify *.mat --names '{subject}_{condition}'
  ankleloop identify S1.h5 --method riv --method pi-moesp --option riv.order=3
  ankleloop identify walk.mat --method ensemble --onsets onsets --condition kinds

\b
Results, in the folder of --output:
  NAME.html                     the page: recommendation, checks, methods side by side, figures
  NAME-parameters.csv           a row for each method: parameters with intervals, scores, warnings
  NAME/METHOD.nc, .mat, .csv    the estimate with its model, and a table of its torques
  NAME/figure-*.csv             the numbers that the figures of the page draw
  index.html                    of several files: their page: the answer, figures, links, what is left out and why
  recordings.csv                all rows in one table
  recordings-figure.png         a figure of the recommended methods
  comparison.csv, comparison-figure.png      of several subjects and conditions: differences within subjects

\b
Exit status: 0 if all files can be used, 3 if some can, 1 if none can.
"""
RESULTS = "Folder of the results.  [default: FILE-results, of several files ankleloop-results]"
CHOICE = (
    "Method to fit (riv, pr-moesp, pi-moesp, parallel-cascade, riv-tv, ensemble of windows, apparatus of a device "
    "without a subject, or one that another package registers), several times for several.  [default: all that are "
    "valid for a record of a joint]"
)
DELAY = "Reflex delay of every method [s]; `estimate` for the methods that can.  [default: that of each method]"
JOBS = "Files that are identified side by side.  [default: as many as there are processors]"
ONSETS = (
    "Variable of the file with the onset of the perturbation in each window [s from the start of the record], or a "
    "trigger that rises there, for the method ensemble alone. --condition is then the variable that says by a number "
    "what was commanded in each."
)
OPTION = "Option of a method, as riv.order=3; without METHOD of every method that has it. Several times for several."


@click.command(epilog=EPILOG)
@click.argument("files", nargs=-1, required=True, metavar="FILE...", type=FILE)
@click.option("--output", type=FOLDER, help=RESULTS)
@click.option("--overwrite", is_flag=True, help="Replace the results of an earlier run.")
@click.option("--method", "methods", multiple=True, metavar="METHOD", help=CHOICE)
@click.option("--jobs", type=click.IntRange(min=1), metavar="N", help=JOBS)
@click.option("--delay", metavar="S|estimate", help=DELAY)
@click.option("--option", "options", multiple=True, metavar="[METHOD.]NAME=VALUE", help=OPTION)
@click.option("--onsets", metavar="VARIABLE", help=ONSETS)
@names_option
@reading_options
@click.pass_context
def identify(
    context: click.Context,
    files: tuple[Path, ...],
    output: Path | None,
    overwrite: bool,
    methods: tuple[str, ...],
    jobs: int | None,
    delay: str | None,
    options: tuple[str, ...],
    onsets: str | None,
    names: str | None,
    **values: Any,
) -> int:
    """Identify recordings: checks, every method that is valid, pages, one table and the estimates.

    The results are those that the workflow makes of a recording. Each method is fitted to the first half and scored
    on the second, then fitted to the whole. A file that cannot be used is refused with the reason, and the others are
    identified. Files that exist are replaced with --overwrite only, or where they say no more than a refusal.
    """
    folder = output or Path("ankleloop-results" if len(files) > 1 else f"{files[0]}-results")
    named = [f"delay={'null' if delay == 'estimate' else delay}"] if delay else []
    fields = _parse_options([*named, *options])
    if onsets is not None or "ensemble" in methods:
        if onsets is None or methods != ("ensemble",):
            raise click.UsageError(
                "--method ensemble needs --onsets and --condition, and these no other method: it alone takes windows "
                "around perturbations."
            )
        from ankleloop_lab.command_line.ensembles import identify_ensembles

        kinds = values.pop("condition")
        recordings = map_recordings(files, names, values, tolerant=True)
        usable = identify_ensembles(
            recordings, folder, onsets, kinds, fields, context.obj, overwrite=overwrite
        )
        return find_status(usable)
    recordings = map_recordings(files, names, values, tolerant=True)
    status = _identify_records(
        recordings, folder, methods, fields, jobs, context.obj, overwrite=overwrite
    )
    if names is None:
        _suggest_names(files)
    return status


def _identify_records(
    recordings: Mapping[str, tuple[Recording, Path]],
    folder: Path,
    methods: Sequence[str],
    fields: Mapping[str, Any],
    jobs: int | None,
    words: Sequence[str],
    *,
    overwrite: bool,
) -> int:
    """Identify whole records, and show what comes of each and of all; `words` are those of the command."""
    from ankleloop_lab.command_line import analysis

    several = len(recordings) > 1
    analyses = [
        analysis.plan_analysis(name, path, recording, methods, fields)
        for name, (recording, path) in recordings.items()
    ]
    tables = []
    is_brief = len(analyses) > analysis.MOST_SHOWN
    corrections: dict[tuple[Any, ...], list[Path]] = {}  # files by what is advised for them
    progress = nullcontext() if several else show_progress()
    with analysis.claim_folder(folder) as claim, progress:
        if not overwrite:
            analysis.refuse_results(folder, recordings)
        analysed = analysis.identify_recordings(analyses, claim, jobs or os.cpu_count() or 1)
        for plan, table in zip(analyses, analysed, strict=True):
            recording, path = recordings[plan.name]
            tables.append(table)
            number = len(tables)
            if several and (not is_brief or number % 10 == 0 or number == len(analyses)):
                echo(f"recording {number} of {len(analyses)}: {plan.name} ({path})", err=True)
            if not several:
                analysis.show_results(table, folder)
            elif not is_brief:
                analysis.show_verdict(table)
            advice = find_advice(path, recording, table.attrs["remedy"], plan.methods)
            corrections.setdefault(tuple(advice.items()), []).append(path)
        page = folder / f"{analyses[0].name}.html"
        if several:
            page = analysis.write_summary(tables, folder)
    files = [path for _, path in recordings.values()]
    for items, concerned in corrections.items():
        others = {str(file) for file in files if file not in concerned}
        show_correction(dict(items), [word for word in words if word not in others])
    show_next(f"open {page}")
    return find_status([table["valid"].any() for table in tables])


def _suggest_names(files: Iterable[Path]) -> None:
    """Show the option that takes labels from the names of the files, if they suggest one."""
    from ankleloop_lab.recordings.labels import suggest_names

    names = suggest_names(files)
    if names:
        show_next(f"compare conditions: --names '{names}', which the names of the files suggest")


def _parse_options(texts: Iterable[str]) -> dict[str, Any]:
    """Values of options by [METHOD.]NAME."""
    import yaml

    options = {}
    for text in texts:
        name, equals, value = text.partition("=")
        try:
            options[name.strip()] = yaml.safe_load(value)
        except yaml.YAMLError:
            equals = ""
        if not equals:
            raise click.UsageError(f"--option {text}: write it as NAME=VALUE or METHOD.NAME=VALUE.")
    return options
