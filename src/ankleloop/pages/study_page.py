"""What the notebooks of all studies share: a study with its files, its figures and tables with their captions."""

from __future__ import annotations

import html
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from IPython.display import HTML, Image, Markdown, display

from ankleloop.joint.estimate import Estimate
from ankleloop.joint.estimate_files import load_estimates
from ankleloop.pages.rendering import render_table
from ankleloop.paper.captions import describe_settings, typical_point
from ankleloop.paper.results import describe_faults, list_outcomes
from ankleloop.paper.tables import write_table
from ankleloop.paper.trial_tables import read_results
from ankleloop.plotting.style import MethodStyle, label_styles, save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MEANS = (
    "± is half of a 95 % interval. Means leave out failed trials and include those with a warning; those of G, ωn and "
    "ζ leave out trials whose reflex path is no ramp with a low-pass behind it (without G)."
)


@dataclass(frozen=True)
class StudyPage:
    """A study as its notebook takes it: `ankleloop.studies.run_config.report_parameters`."""

    study: str  # its name
    kind: str  # "simulation" or "recordings"
    title: str
    labels: Mapping[str, str]  # label of each method
    algorithms: Mapping[str, str]  # name of each method in the registry
    points: Mapping[str, Mapping[str, Any]]  # settings of each point
    varied: Sequence[str]  # settings that differ between points
    figure: Mapping[str, Any]  # what figures of single trials show
    published: str  # folder of the numbers of the paper
    table_stem: str
    figure_stem: str
    table_file: str = ""  # all trials in one table
    tables: Sequence[str] = ()  # of recordings: a file for each chunk
    trials: Sequence[str] = ()  # files of trials and of estimates, one for each chunk of points
    estimates: Sequence[str] = ()
    # Of a sweep: the settings that all points share, and what its pictures show.
    settings: Mapping[str, Any] = field(default_factory=dict)
    sweep: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def details(self) -> pd.DataFrame:
        """Scores, parameters and diagnostics: a row for each estimate."""
        return read_results(self.table_file)

    @cached_property
    def table(self) -> pd.DataFrame:
        """The same, with the label of the method and what came of each identification."""
        return self.details.assign(series=self.details["method"].map(self.labels), outcome=list_outcomes(self.details))

    @property
    def styles(self) -> dict[str, MethodStyle]:
        """Style of each label."""
        return label_styles(self.labels, self.algorithms)

    @property
    def typical(self) -> str:
        """Point that figures of single trials show."""
        return typical_point(self.points, self.varied)

    def stack(self, x: str, columns: Mapping[str, str]) -> pd.DataFrame:
        """Rows of `ankleloop.plotting.studies.curves_figure`: a column of the table for each panel, over `x`."""
        table = self.table.assign(x=self.table[x])
        parts = [table.assign(panel=panel, value=table.get(column, np.nan)) for panel, column in columns.items()]
        return pd.concat(parts, ignore_index=True)

    def load_estimates(self, point: str) -> dict[str, dict[int, Estimate]]:
        """Estimates at a point, by method and trial."""
        return {name: load_estimates(self.estimates, point, name) for name in self.labels}

    def select_estimates(
        self, estimates: Mapping[str, Mapping[int, Estimate]], methods: Iterable[str]
    ) -> dict[str, Estimate]:
        """Estimates of the trial that figures show, by label; those that failed are not among them."""
        trial = self.figure["trial"]
        selection = {self.labels[name]: estimates[name][trial] for name in methods if trial in estimates[name]}
        self.refuse_empty(selection)
        return selection

    @staticmethod
    def refuse_empty(shown: Mapping[str, Any]) -> None:
        """Refuse a figure of a single trial of which nothing was identified."""
        if not shown:
            raise ValueError(
                "the trial that the figure shows could not be identified: set another number as figure: trial in the "
                "configuration of the study."
            )

    def show_figure(self, figure: Figure, name: str, caption: str, note: str = "", *, width: int = 980) -> None:
        """Save a figure, and show it with its caption; settings, warnings and a note are folded below."""
        stem = f"{self.figure_stem}-{name}"
        save_figure(figure, stem, overwrite=True)
        display(Image(f"{stem}.png", width=width), Markdown(caption), self.fold(note))

    def show_table(
        self, cells: pd.DataFrame, caption: str, note: str = "", *, table: pd.DataFrame | None = None
    ) -> None:
        """Show a table with its caption; `table` is written as CSV, and the cells as Markdown beside it."""
        note = f"{note} {MEANS}".strip()
        if table is not None:
            write_table(table, self.table_stem, cells, f"{caption} {note} {self._conditions()}")
        display(HTML(render_table(cells)), Markdown(caption), self.fold(note))

    def _conditions(self) -> str:
        """Number of trials at each point and the settings that they share."""
        settings = describe_settings(self.points[self.typical], self.varied)
        return f"{self.details['trial'].nunique()} trials at each point; {settings}."

    def fold(self, note: str = "") -> HTML:
        """Trials and settings of the study, and a note, behind a line that opens them."""
        return fold("Trials and settings", [note, self._conditions(), describe_faults(self.details, self.labels)])


def fold(summary: str, parts: Iterable[str]) -> HTML:
    """Text behind a line that opens it."""
    text = html.escape(" ".join(part for part in parts if part))
    return HTML(f"<details><summary>{html.escape(summary)}</summary><p>{text}</p></details>")


def read_published(page: StudyPage, name: str) -> pd.DataFrame:
    """A table of the paper."""
    return pd.read_csv(Path(page.published, f"{name}.csv"))
