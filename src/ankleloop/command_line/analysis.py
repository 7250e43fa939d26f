"""What `identify` and `demo` make of a recording: the results of the workflow, in a folder and on the terminal."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import NoneType
from typing import Any, get_args

import click
import pandas as pd

from ankleloop.command_line.outputs import check_outputs
from ankleloop.command_line.terminal import COLOURS, echo, format_table
from ankleloop.methods.registry import METHODS
from ankleloop.pages.recordings import FIGURES
from ankleloop.plotting.recordings import recordings_figure
from ankleloop.plotting.style import save_figure
from ankleloop.quantities import QUANTITIES
from ankleloop.recordings.files import SUFFIXES
from ankleloop.recordings.recommendation import format_with_interval, select_valid_methods
from ankleloop.recordings.validity import usual_methods
from ankleloop.studies.checking import ConfigError, check
from ankleloop.studies.config import RecordingsStudy
from ankleloop.studies.recording_settings import Recording
from ankleloop.studies.recordings import analyse_recordings
from ankleloop.studies.study import RecordedStudy
from ankleloop.trials.files import write_csv

COLUMNS = ("vaf_unseen", "K", "B", "I", "G")  # of the tables on the terminal
TABLE, FIGURE = "recordings.csv", "recordings-figure"  # of several recordings
REMEDY = "--overwrite replaces results, --output names another folder."


def make_study(
    name: str, path: Path, recording: Recording, methods: Sequence[str] = (), options: Mapping[str, Any] | None = None
) -> RecordedStudy:
    """The study of one recording, which the workflow would make of it, with options by [METHOD.]NAME."""
    changing = "riv-tv" in methods or recording.changes
    usual = usual_methods(reference=recording.reference is not None, changing=changing)
    chosen = {key: method for key, method in usual.items() if not methods or key in methods}
    for option, value in (options or {}).items():
        _set_option(chosen, option, value)
    settings = {
        "kind": "recordings",
        "folder": str(path.absolute().parent).replace("$", "$$"),
        "files": {name: recording.model_dump()},
        "methods": chosen,
    }
    try:
        return RecordedStudy(name, check(RecordingsStudy, settings, name))
    except ConfigError as error:
        raise click.UsageError(str(error)) from None


def _set_option(methods: dict[str, dict[str, Any]], name: str, value: Any) -> None:
    """Set an option of one method, or of all that have it and can take the value."""
    key, _, field = name.rpartition(".")
    fields = {label: METHODS[label].options.model_fields for label in methods}
    concerned = [label for label in methods if key in ("", label) and field in fields[label]]
    if value is None and not key:  # only some can estimate what others have to be told
        concerned = [label for label in concerned if NoneType in get_args(fields[label][field].annotation)]
    if not concerned:
        raise click.UsageError(f"--option {name}: none of the methods {', '.join(methods)} has this option.")
    for label in concerned:
        methods[label]["options"][field] = value
        methods[label].get("select", {}).pop(field, None)


def identify_recording(study: RecordedStudy, folder: Path, *, overwrite: bool) -> tuple[pd.DataFrame, Path]:
    """Analyse the recording of a study; its table, and its page beside which all other results are."""
    name, inputs = study.name, study.points[study.name]["paths"]
    overwrite = overwrite or _is_refusal(folder / f"{name}-parameters.csv")
    estimates = [f"{name}/{key}{suffix}" for key in usual_methods(reference=True, changing=True) for suffix in SUFFIXES]
    outputs = [f"{name}.html", f"{name}-parameters.csv", *estimates, *(f"{name}/figure-{kind}.csv" for kind in FIGURES)]
    check_outputs(folder, outputs, REMEDY, overwrite=overwrite, inputs=map(Path, inputs))
    window = study.settings.figure.model_dump(include={"start", "length"})
    # In the same folder, so that what is complete only takes its name there.
    with tempfile.TemporaryDirectory(prefix=".ankleloop-", dir=folder) as temporary:
        results = Path(temporary)
        ((_, table, _),) = analyse_recordings(study.chunks[0], study.analysed_methods, results, window)
        write_csv(table, results / f"{name}-parameters.csv")
        for output in outputs:
            if (results / output).exists():
                (folder / output).parent.mkdir(exist_ok=True)
                os.replace(results / output, folder / output)
            else:  # of an earlier run
                (folder / output).unlink(missing_ok=True)
    return table, folder / f"{name}.html"


def _is_refusal(table: Path) -> bool:
    """Whether an earlier run could say no more of a recording than why it is refused."""
    try:
        return bool(pd.read_csv(table, usecols=["verdict"])["verdict"].eq("refused").all())
    except (OSError, ValueError):  # there is none, or it is something else
        return False


def show_results(table: pd.DataFrame, page: Path) -> None:
    """Show the recommendation, the methods side by side, and where the results are."""
    first, valid = table.iloc[0], select_valid_methods(table)
    echo(f"{click.style(first['verdict'], fg=COLOURS[first['verdict']])}: {first['recommendation']}")
    if first["verdict"] == "refused":
        echo(first["reasons"])
    if not valid.empty:
        rows = [(row["label"], "" if row["trusted"] else "warning", row) for _, row in valid.iterrows()]
        echo(f"\n{_format_parameters('method', rows)}")
        for _, row in table[~table.index.isin(valid.index)].iterrows():
            echo(f"not fitted: {row['label']}: {row['warnings']}")
    echo(f"\npage       {page}\ntable      {page.with_name(f'{page.stem}-parameters.csv')}")
    if not valid.empty:
        echo(f"estimates  {page.with_suffix('')}")


def _format_parameters(heading: str, rows: Iterable[tuple[str, str, pd.Series]]) -> str:
    """Lines with a name, parameters with their intervals, and a remark."""
    cells = [[name, *(format_with_interval(row, column) for column in COLUMNS), text] for name, text, row in rows]
    return format_table([[heading, *(QUANTITIES[column].label for column in COLUMNS), ""], *cells])


def write_summary(tables: Sequence[pd.DataFrame], folder: Path) -> Path:
    """Write the table and the figure of all recordings, and show what is recommended for each; the path to look at."""
    table = pd.concat(tables, ignore_index=True)
    write_csv(table, folder / TABLE, overwrite=True)
    rows = []
    for part in tables:
        row = next((row for _, row in part.iterrows() if row["recommended"]), part.iloc[0])
        rows.append((row["recording"], row["label"] if row["recommended"] else row["verdict"], row))
    echo(f"{_format_parameters('recording', rows)}\n\ntable   {folder / TABLE}")
    valid = select_valid_methods(table)
    if valid.empty:
        return folder / TABLE
    save_figure(recordings_figure(valid, [name for name in COLUMNS if name in valid]), folder / FIGURE, overwrite=True)
    echo(f"figure  {folder / FIGURE}.png")
    return folder / f"{FIGURE}.png"
