"""`ankleloop identify --method ensemble`: windows around the perturbations of recordings, to estimates and a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click
import pandas as pd

from ankleloop.assessment.scores import list_parameters
from ankleloop.errors import NUMERICAL_ERRORS
from ankleloop.plotting.estimates import conditions_figure
from ankleloop.plotting.style import save_figure
from ankleloop.trials.files import write_csv
from ankleloop_lab.command_line.analysis import TABLE
from ankleloop_lab.command_line.terminal import echo, refuse_existing, show_correction
from ankleloop_lab.recordings.analysis import describe_failure
from ankleloop_lab.recordings.ensembles import identify_windows
from ankleloop_lab.recordings.files import export_estimates
from ankleloop_lab.recordings.labels import GROUPS
from ankleloop_lab.recordings.settings import Recording

METHOD = "ensemble"
FIGURE = "figure-conditions"


def identify_ensembles(
    recordings: Mapping[str, tuple[Recording, Path]],
    folder: Path,
    onsets: str,
    condition: str | None,
    options: Mapping[str, Any],
    words: Sequence[str],
    *,
    overwrite: bool,
) -> list[bool]:
    """Identify the windows of each recording, and write its results; which of them could be identified.

    `words` are those of the command, to correct it where a recording is refused.
    """
    if condition is None:
        raise click.UsageError("--onsets needs --condition: the variable of what was commanded.")
    chosen = {name.removeprefix(f"{METHOD}."): value for name, value in options.items()}
    if not overwrite:
        refuse_existing([folder / TABLE])
    rows = []
    for name, (recording, path) in recordings.items():
        labels = {"recording": name, **{group: getattr(recording, group) for group in GROUPS}}
        try:
            estimate = identify_windows(path, recording, onsets, condition, **chosen)
        except NUMERICAL_ERRORS as error:
            reason = describe_failure(error)
            rows.append({**labels, "trusted": False, "refused": reason})
            echo(f"{click.style(name, bold=True)}  {click.style('refused', fg='red')}: {reason}")
            show_correction(getattr(error, "remedy", {}), words)
            continue
        except (TypeError, ValueError) as error:  # of an option
            raise click.UsageError(str(error)) from None
        export_estimates({METHOD: estimate}, folder / name)
        figure = folder / name / FIGURE
        save_figure(conditions_figure(estimate), figure, overwrite=True)
        warnings = " ".join(estimate.warnings)
        row = {"trusted": estimate.trusted, "refused": "", **list_parameters(estimate)}
        rows.append({**labels, **row, "warnings": warnings})
        echo(f"\n{click.style(name, bold=True)}\n{estimate}")
        echo(f"\nestimate  {folder / name / METHOD}.nc, .mat, .csv\nfigure    {figure}.png")
    usable = [not row["refused"] for row in rows]
    if any(usable):
        write_csv(pd.DataFrame(rows), folder / TABLE, overwrite=True)
        echo(f"table     {folder / TABLE}")
    return usable
