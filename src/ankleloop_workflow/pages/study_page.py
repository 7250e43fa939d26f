"""What the notebooks of all studies share: a study with its files, its figures and tables with their captions."""

from __future__ import annotations

import html
import json
import os
import tempfile
from collections.abc import Iterable, Mapping
from functools import cached_property
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pandas as pd
from IPython.display import HTML, Image, Markdown, display
from matplotlib.figure import Figure

from ankleloop.joint.estimate import Estimate
from ankleloop.plotting.style import MethodStyle, label_styles, save_figure
from ankleloop.quantities import point_column
from ankleloop_lab.pages.rendering import render_table
from ankleloop_workflow.tables.captions import describe_settings, typical_point
from ankleloop_workflow.tables.comparisons import drop_omissions, write_table
from ankleloop_workflow.tables.estimate_tables import load_estimates
from ankleloop_workflow.tables.trial_tables import read_results

MEANS = (
    "± is half of a 95 % interval. Means leave out failed trials and include those with a warning; those of G, ωn and "
    "ζ leave out trials whose reflex path is no ramp with a low-pass behind it (without G)."
)

Estimates = Mapping[str, Mapping[int, Estimate]]  # by method and trial


class StudyPage(SimpleNamespace):
    """A study as its notebook takes it: what `ankleloop_workflow.config.run.report_parameters` gives are attributes."""

    @cached_property
    def details(self) -> pd.DataFrame:
        """Scores, parameters and diagnostics: a row for each estimate."""
        return drop_omissions(read_results(self.table_file))

    @cached_property
    def table(self) -> pd.DataFrame:
        """The same, with the label of the method as `series`."""
        return self.details.assign(series=self.details["method"].map(self.labels))

    @cached_property
    def predictions(self) -> pd.DataFrame:
        """What `ankleloop_workflow.jobs.predictions.predict` has written: a row for each point, kind and seed."""
        return pd.read_parquet(self.prediction_file)

    @property
    def keys(self) -> list[str]:
        """Columns with the values of the points."""
        return [point_column(name) for name in self.varied]

    @property
    def styles(self) -> dict[str, MethodStyle]:
        """Style of each label."""
        return label_styles(self.labels, self.algorithms)

    @cached_property
    def typical(self) -> str:
        """Point that figures of single trials show: one of those where that trial was identified, if there are any."""
        if not self.points:
            raise ValueError(
                "the page shows settings of points, which its notebook does not read: add points to reads of the "
                "notebook in notebooks/notebooks.yaml."
            )
        details = self.details
        is_shown = (details["trial"] == self.figure["trial"]) & details["failure"].isna()
        names = set(details.loc[is_shown, "point"])
        points = {name: values for name, values in self.points.items() if name in names}
        return typical_point(points or self.points, self.varied)

    def load_estimates(self, point: str) -> Estimates:
        """Estimates at a point, by method and trial."""
        return {name: load_estimates(self.estimates, point, name) for name in self.labels}

    def select_estimates(self, estimates: Estimates, methods: Iterable[str]) -> dict[str, Estimate]:
        """Estimates of the trial that figures show, by label; those that failed are not among them."""
        trial = self.figure["trial"]
        selection = {
            self.labels[name]: estimates[name][trial]
            for name in methods
            if trial in estimates[name]
        }
        self.refuse_empty(selection)
        return selection

    def refuse_empty(self, shown: Mapping[str, object]) -> None:
        """Refuse a figure of a single trial of which nothing was identified."""
        if not shown:
            raise ValueError(
                "the trial of the figure could not be identified: set another number as figure: trial."
            )

    def show_figure(
        self, figure: Figure, name: str, caption: str, note: str = "", *, width: int = 980
    ) -> None:
        """Save a figure, and show it with its caption and a note that is folded below."""
        self.check_figure(name)
        if getattr(figure, "data", None) is None:
            raise ValueError(
                f"the figure {name!r} has no table of the numbers that it draws, which is written as CSV beside it: "
                "set figure.data = table."
            )
        save_figure(figure, f"{self.figure_stem}-{name}", overwrite=True)
        show_picture(f"{self.figure_stem}-{name}.png", caption, width)
        show_note(note)

    def check_figure(self, name: str) -> None:
        """Refuse a figure that the list of notebooks does not have: nobody would find it among the results."""
        if name not in self.figures:
            listed = ", ".join(self.figures)
            raise ValueError(
                f"the figure {name!r} is not in notebooks/notebooks.yaml, which has {listed}."
            )

    def check_written(self, notebook: str) -> None:
        """Refuse a notebook that has not drawn all figures of its list, or has written no table."""
        for name in self.figures:
            if not Path(f"{self.figure_stem}-{name}.png").exists():
                raise ValueError(
                    f"{notebook} has not drawn the figure {name!r}, which notebooks/notebooks.yaml lists for it: call "
                    f"page.show_figure(figure, {name!r}, caption), or take it off the list."
                )
        if not Path(f"{self.table_stem}.csv").exists():
            raise ValueError(
                f"{notebook} has written no table of the study: call page.show_table(cells, caption, table=table)."
            )

    def show_table(
        self, cells: pd.DataFrame, caption: str, note: str = "", table: pd.DataFrame | None = None
    ) -> None:
        """Show a table with its caption; `table` is written as CSV, and the cells as Markdown beside it."""
        note = f"{note} {MEANS}".strip()
        if table is not None:
            write_table(table, self.table_stem, cells, f"{caption} {note} {self.describe()}")
        display(HTML(render_table(cells)), Markdown(caption))
        show_note(note)

    def describe(self) -> str:
        """Number of trials at each point and the settings that they share."""
        settings = describe_settings(self.points[self.typical], self.varied)
        return f"{self.details['trial'].nunique()} trials at each point; {settings}."


def open_study(study: Mapping[str, Any] | str) -> StudyPage:
    """The page of a study as the workflow gives it, or by the name of a study that a run has made.

    By its name the study is that of `results/notebooks/NAME.ipynb`, as `open_parameter` reads it. What the notebook
    draws then goes into a folder of its own, so that the results stay those of the run.

    Raises
    ------
    FileNotFoundError
        If no run has made the study.
    """
    page = StudyPage(**open_parameter(study))
    if isinstance(study, str):
        own = Path(tempfile.mkdtemp(prefix="ankleloop-")) / study
        page.table_stem = page.figure_stem = str(own)
    return page


def open_parameter(parameter: Mapping[str, Any] | str) -> Mapping[str, Any]:
    """The parameter of a notebook as the workflow gives it, or that of `results/notebooks/NAME.ipynb` by its name.

    The notebook is below this folder or one above it, which becomes the working folder since the paths of files count
    from there.

    Raises
    ------
    FileNotFoundError
        If no run has made the notebook.
    """
    if not isinstance(parameter, str):
        return parameter
    path = f"results/notebooks/{parameter}.ipynb"
    folders = [folder for folder in (Path.cwd(), *Path.cwd().parents) if (folder / path).exists()]
    if not folders:
        raise FileNotFoundError(
            f"no run has made {path}, which lists the files of {parameter!r}: run make, or make beyond, or set the "
            "parameter to the name of a study that was run."
        )
    os.chdir(folders[0])
    return json.loads(Path(path).read_text(encoding="utf-8"))["metadata"]["parameter"]


def show_note(note: str) -> None:
    """Show a note behind a line that opens it; nothing without one."""
    if note:
        display(HTML(f"<details><summary>Note</summary><p>{html.escape(note)}</p></details>"))


def show_picture(path: str, caption: str, width: int = 980) -> None:
    """Show a picture with its caption, which is also what readers get who do not see it."""
    display(Image(path, width=width, alt=caption.replace("**", "")), Markdown(caption))


def read_published(page: StudyPage, name: str) -> pd.DataFrame:
    """A table of the paper."""
    return pd.read_csv(f"{page.published}/{name}.csv")
