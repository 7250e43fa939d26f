"""What `identify` and `demo` make of a recording: the results of the workflow, in a folder and on the terminal."""

from __future__ import annotations

import os
import shutil
import textwrap
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import NoneType
from typing import Any, get_args

import click
import numpy as np
import pandas as pd

from ankleloop.methods.registry import METHODS, find_method
from ankleloop.plotting.style import save_figure
from ankleloop.quantities import QUANTITIES
from ankleloop.trials.files import atomic_file, write_csv
from ankleloop_lab.checking import ConfigError, check
from ankleloop_lab.command_line.reading import list_choices
from ankleloop_lab.command_line.terminal import COLOURS, echo, refuse_existing
from ankleloop_lab.pages.recordings import render_recordings_page
from ankleloop_lab.plotting.recordings import comparison_figure, levels_figure, recordings_figure
from ankleloop_lab.recordings.comparison import compare, describe_differences, select_comparable
from ankleloop_lab.recordings.files import SUFFIXES
from ankleloop_lab.recordings.method_settings import settings_of
from ankleloop_lab.recordings.processes import run_each
from ankleloop_lab.recordings.recommendation import PARAMETERS, format_parameters
from ankleloop_lab.recordings.settings import Recording, describe_parts
from ankleloop_lab.recordings.validity import usual_methods
from ankleloop_lab.results import analyse_recording

# Of several recordings; figures are `NAME-figure.png`.
PAGE, TABLE, COMPARISON = "index.html", "recordings.csv", "comparison.csv"
MOST_CHARACTERS = 110  # of a reason
MOST_SHOWN = 12  # recordings of which a terminal has a line each


@dataclass(frozen=True)
class RecordingAnalysis:
    """What is analysed of a recording, as `ankleloop_lab.results.analyse_recording` takes it."""

    name: str
    mapping: Mapping[str, Any]
    methods: Mapping[str, Mapping[str, Any]]


def plan_analysis(
    name: str,
    path: Path,
    recording: Recording,
    methods: Sequence[str],
    options: Mapping[str, Any],
) -> RecordingAnalysis:
    """What is analysed of a file, with options by [METHOD.]NAME."""
    has_reference = "reference" in recording.channels
    try:
        chosen = usual_methods(reference=has_reference, changing=recording.changes, names=methods)
    except ValueError as error:  # a name that nobody has registered
        raise click.UsageError(f"--method: {error}") from None
    for method in methods:
        if method not in chosen:
            known = ", ".join(usual_methods(reference=has_reference, changing=True))
            raise click.UsageError(
                f"--method: {method!r} is not offered here; methods are {known}."
            )
    for option, value in options.items():
        _set_option(chosen, option, value)
    try:
        settings = {
            key: check(settings_of(find_method(key).options, key), values, name, "methods", key)
            for key, values in chosen.items()
        }
    except ConfigError as error:
        raise click.UsageError(str(error)) from None
    return RecordingAnalysis(
        name=name,
        mapping=describe_parts([recording], path.absolute().parent),
        methods={key: method.analysed for key, method in settings.items()},
    )


def _set_option(methods: dict[str, dict[str, Any]], name: str, value: Any) -> None:
    """Set an option of one method, or of all that have it and can take the value."""
    key, _, field = name.rpartition(".")
    fields = {label: find_method(label).options.model_fields for label in methods}
    concerned = [label for label in methods if key in ("", label) and field in fields[label]]
    if not key:  # those that have a single value have no choice
        free = [label for label in concerned if len(list_choices(fields[label][field])) != 1]
        concerned = free or concerned
    if value is None and not key:  # only some can estimate what others have to be told
        concerned = [
            label for label in concerned if NoneType in get_args(fields[label][field].annotation)
        ]
    if not concerned:
        raise click.UsageError(
            f"--option {name}: none of the methods {', '.join(methods)} has this option."
        )
    for label in concerned:
        methods[label]["options"][field] = value
        methods[label]["select"].pop(field, None)


def refuse_results(folder: Path, names: Collection[str]) -> None:
    """Refuse to replace results of recordings, unless they say no more than why a recording is refused."""
    if len(names) > 1 and Path(PAGE).stem in {name.lower() for name in names}:
        raise click.UsageError(
            f"{PAGE} is the page of all recordings: rename the file of that name."
        )
    tables = {f"{name}-parameters.csv": f"{name}.html" for name in names}
    if len(names) > 1:
        tables[TABLE] = PAGE
    for table, other in tables.items():
        try:
            verdicts = set(pd.read_csv(folder / table, usecols=["verdict"])["verdict"])
        except (OSError, ValueError):  # there is none, or it is something else
            verdicts = set()
        if verdicts != {"refused"}:
            refuse_existing([folder / other, folder / table])


@contextmanager
def claim_folder(folder: Path) -> Iterator[Path]:
    """A folder within that of the results, where these are until they are complete: one command at a time has it."""
    claim = folder / ".ankleloop"
    folder.mkdir(parents=True, exist_ok=True)
    try:
        claim.mkdir()
    except FileExistsError:
        raise click.UsageError(
            f"{claim}: another command is writing its results: wait for it, or write elsewhere by --output. If none "
            "runs any more, because it was killed, delete this folder."
        ) from None
    try:
        yield claim
    finally:
        shutil.rmtree(claim)


def identify_recordings(
    analyses: Sequence[RecordingAnalysis], folder: Path, jobs: int
) -> Iterator[pd.DataFrame]:
    """Analyse recordings, so many side by side; their tables. Results go into the folder above."""
    analyse = partial(_analyse, folder=folder)
    for analysis, table in zip(analyses, run_each(analyse, analyses, jobs), strict=True):
        _replace_results(analysis, folder / analysis.name, folder.parent)
        yield table


def _analyse(analysis: RecordingAnalysis, folder: Path) -> pd.DataFrame:
    """Table of a recording; results go into a folder of its name."""
    results = folder / analysis.name
    results.mkdir()
    recording = (analysis.name, analysis.mapping)
    table = analyse_recording(recording, methods=analysis.methods, folder=results)
    write_csv(table, results / f"{analysis.name}-parameters.csv")
    return table


def _replace_results(analysis: RecordingAnalysis, results: Path, folder: Path) -> None:
    """Move the results of a recording to their place, and remove those of an earlier run."""
    for earlier in (folder / analysis.name).glob("*"):
        if earlier.suffix in SUFFIXES and (
            earlier.stem in {*METHODS, *analysis.methods} or earlier.stem.startswith("figure-")
        ):
            earlier.unlink()
    for result in filter(Path.is_file, results.rglob("*")):
        target = folder / result.relative_to(results)
        target.parent.mkdir(exist_ok=True)
        os.replace(result, target)


def show_results(table: pd.DataFrame, folder: Path) -> None:
    """Show the recommendation, the methods side by side, and where the results of a recording are."""
    first = table.iloc[0]
    valid = table[table["valid"]]
    name = first["recording"]
    echo(f"\n{click.style(name, bold=True)}")
    echo(f"{_style_verdict(first)}: {first['recommendation']}")
    if first["verdict"] == "refused":
        echo(first["reasons"])
    if not valid.empty:
        cells = format_parameters(valid)
        cells[""] = np.where(
            valid["trusted"], np.where(valid["remarks"].ne(""), "remarked", ""), "warned"
        )
        echo(f"\n{cells.set_index(valid['label']).rename_axis(None).to_string()}")
    for _, row in table[table["verdict"] != "refused"].drop(valid.index).iterrows():
        echo(f"not fitted: {row['label']}: {row['warnings']}")
    echo(f"\npage   {folder / name}.html\ntable  {folder / name}-parameters.csv")


def show_verdict(table: pd.DataFrame) -> None:
    """Show in a line whether a recording of several is good, and why it is refused."""
    first = table.iloc[0]
    reason = f": {first['reasons']}" if first["verdict"] == "refused" else ""
    echo(f"{click.style(first['recording'], bold=True)}  {_style_verdict(first)}{reason}")


def write_summary(tables: Sequence[pd.DataFrame], folder: Path) -> Path:
    """Write page, table and figures of several recordings, and show what fits a screen; the path of the page."""
    table = pd.concat(tables, ignore_index=True)
    write_csv(table, folder / TABLE, overwrite=True)
    recommended = table[table["recommended"].eq(True)]
    left_out = _list_left_out(table, set(recommended["recording"]))
    figures = {}
    answers = []
    comparable = select_comparable(table)
    if comparable is not None:
        comparison = compare(comparable)
        write_csv(comparison, folder / COMPARISON, overwrite=True)
        figures["comparison"] = comparison_figure(comparable, comparison)
        compared = comparison["parameter"].unique()
        answers = [describe_differences(comparison, name) for name in compared]
    cells = pd.DataFrame()
    if not recommended.empty:
        figures["levels"] = levels_figure(recommended)
        names = [name for name in PARAMETERS if recommended[name].notna().any()]
        figures["recordings"] = recordings_figure(recommended, names)
        cells = _tabulate(recommended)
    drawn = {}  # the numbers of the others are in the table
    for name in figures.keys() - {"levels"}:
        save_figure(figures[name], folder / f"{name}-figure", overwrite=True)
        drawn[name] = (folder / f"{name}-figure.png").read_bytes()
    recordings = table["recording"].nunique()
    counts = f"{recordings - len(left_out)} of {recordings} recordings have a recommended method."
    page = render_recordings_page(folder.name, [*answers, counts], cells, left_out, figures, drawn)
    with atomic_file(folder / PAGE, overwrite=True) as path:
        path.write_text(page, encoding="utf-8")
    _show_summary(recommended, cells, left_out)
    echo(f"\npage of all    {folder / PAGE}\npages          {folder}/NAME.html")
    echo(f"tables         {folder / TABLE}" + (f", {folder / COMPARISON}" if answers else ""))
    echo(f"\n{answers[0] if answers else counts}")
    return folder / PAGE


def _list_left_out(table: pd.DataFrame, recommended: Collection[str]) -> dict[str, str]:
    """Recordings without a recommended method, and why."""
    first = table.drop_duplicates("recording").set_index("recording")
    reasons = first["reasons"] if "reasons" in first else pd.Series("", first.index)
    reasons = reasons.where(first["verdict"] == "refused", first["recommendation"])
    return reasons.drop(list(recommended)).to_dict()


def _tabulate(recommended: pd.DataFrame) -> pd.DataFrame:
    """Recommended estimates with their intervals, as cells."""
    cells = format_parameters(recommended)
    for name in ("mean_torque", "mean_position"):
        cells[QUANTITIES[name].label] = recommended[name].map("{:.3g}".format)
    cells.insert(0, "recording", recommended["recording"])
    cells.insert(1, "loop", recommended["loop"])
    cells.insert(2, "recommended", recommended["label"])
    return cells


def _show_summary(
    recommended: pd.DataFrame, cells: pd.DataFrame, left_out: Mapping[str, str]
) -> None:
    """Show recommended estimates and what is left out, of many recordings the latter alone."""
    if 0 < len(cells) <= MOST_SHOWN:
        echo(f"\n{cells.set_index('recording').rename_axis(None).to_string()}")
        remarks = recommended.set_index("recording")["remarks"].dropna()
        for name, remark in remarks[remarks != ""].items():
            echo(f"{name}: {remark}")
    if len(cells) > MOST_SHOWN:  # others have been shown as they were identified
        echo()
        for name, reason in list(left_out.items())[:MOST_SHOWN]:
            echo(textwrap.shorten(f"{name}: {reason}", MOST_CHARACTERS, placeholder=" …"))
    if left_out:
        names = [*sorted(left_out)[:MOST_SHOWN]]
        more = f" and {len(left_out) - len(names)} more" if len(left_out) > len(names) else ""
        echo(f"\nno recommendation: {', '.join(names)}{more}")


def _style_verdict(row: pd.Series) -> str:
    return click.style(row["verdict"], fg=COLOURS[row["verdict"]])
