"""Pages of recordings: checks, methods side by side, figures."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd
import xarray as xr

from ankleloop.joint.estimate import Estimate
from ankleloop.plotting.estimates import torque_figure, trajectories_figure
from ankleloop.plotting.style import DataFigure, estimate_styles, render_figure
from ankleloop.quantities import QUANTITIES
from ankleloop_lab.pages.interactive import render_interactive_torques
from ankleloop_lab.pages.page import render_page
from ankleloop_lab.pages.rendering import render_template
from ankleloop_lab.plotting.recordings import model_figure, residual_figure, spectra_figure
from ankleloop_lab.recordings.analysis import Analysis
from ankleloop_lab.recordings.recommendation import (
    describe_result,
    describe_variations,
    format_with_interval,
    recommend,
)

# Rows of the table of methods: columns of `Analysis.table` with their headings.
ROWS = {name: quantity.label for name, quantity in QUANTITIES.items() if name != "torque"}
ROWS |= {"warnings": "warnings", "intervals": "intervals of the parameters", "selected": "selected"}
PIXELS_PER_INCH = 137.5  # of the page: a figure of two columns fills it
DOTS_PER_INCH = 220  # of the picture


def draw_figures(
    trials: Sequence[xr.Dataset], analysis: Analysis, window: Mapping[str, Any]
) -> dict[str, DataFigure]:
    """Draw the figures of the page of a recording."""
    figures = {}
    if analysis.check.spectra:
        figures["spectra"] = spectra_figure(analysis.check.spectra)
    if not analysis.estimates:
        return figures
    marked = _mark_labels(analysis)
    estimates = {marked[label]: estimate for label, estimate in analysis.estimates.items()}
    styles = estimate_styles(estimates)
    torques = torque_figure(trials, estimates, **window)
    torques.interactive = render_interactive_torques(trials[0], estimates, styles, window)
    figures["torques"] = torques
    figures["models"] = model_figure(estimates)
    changing = _select_changing(estimates)
    if changing:
        figures["trajectories"] = trajectories_figure(changing, styles=styles)
    tests = {marked[label]: test for label, test in analysis.residuals.items()}
    figures["residuals"] = residual_figure(tests, styles=styles)
    return figures


def render_recording_page(
    name: str,
    mapping: Mapping[str, Any],
    analysis: Analysis,
    figures: dict[str, DataFigure],
    index: str | None = None,
) -> str:
    """Page of a recording: recommendation, checks, methods side by side, change of the joint, figures, residuals."""
    marked = _mark_labels(analysis)
    body = render_template(
        "recording.html.j2",
        title=name,
        mapping=mapping,
        analysis=analysis,
        marked=marked,
        recommendation=recommend(analysis),
        figures=figures,
        pictures={name: _embed(figure) for name, figure in figures.items()},
        methods=_compare_methods(analysis.table, list(marked.values())) if marked else None,
        variations=describe_variations(analysis),
        describe_result=describe_result,
    )
    return render_page(name, body, index=index)


HEADINGS = {
    "comparison": "Conditions",
    "levels": "Where the joint was held",
    "recordings": "Recommended methods",
}
CAPTIONS = {
    "comparison": (
        "Left: a line for each subject, and the mean over subjects with its 95 % interval. Right: the mean of the "
        "differences within subjects with its 95 % interval; where that holds 0, no difference is shown."
    ),
    "levels": (
        "K rises with the torque with which a joint is held, and depends on its position. Where conditions differ in "
        "these, so does K."
    ),
    "recordings": "Parameters with their 95 % intervals. A ring marks an estimate with a warning.",
}


def render_recordings_page(
    title: str,
    answers: Sequence[str],
    recommended: pd.DataFrame,
    left_out: Mapping[str, str],
    figures: Mapping[str, DataFigure],
    drawn: Mapping[str, bytes],
) -> str:
    """Page of several recordings: the answer, figures, links to their pages, and which are left out, and why.

    `drawn` are the pictures of those figures that have one already.
    """
    body = render_template(
        "recordings.html.j2",
        title=title,
        answers=answers,
        recommended=recommended,
        links=[f"{name}.html" for name in recommended.get("recording", ())],
        left_out=left_out,
        pictures={name: _embed(figure, drawn.get(name)) for name, figure in figures.items()},
        headings=HEADINGS,
        captions=CAPTIONS,
    )
    return render_page(title, body)


def _embed(figure: DataFigure, picture: bytes | None = None) -> dict[str, Any]:
    """Attributes of an image that holds a figure, which is drawn unless there is its picture."""
    picture = picture or render_figure(figure, DOTS_PER_INCH)
    return {
        "width": round(PIXELS_PER_INCH * figure.get_figwidth()),
        "src": f"data:image/png;base64,{base64.b64encode(picture).decode()}",
    }


def _select_changing(estimates: Mapping[str, Estimate]) -> dict[str, Estimate]:
    """Estimates with trajectories over what the first of them has, and riv beside them; none without any."""
    courses = {
        label: list(estimate.trajectories.sizes)
        for label, estimate in estimates.items()
        if estimate.trajectories is not None
    }
    if not courses:
        return {}
    first = next(iter(courses.values()))
    return {
        label: estimate
        for label, estimate in estimates.items()
        if estimate.method == "riv" or courses.get(label) == first
    }


def _compare_methods(table: pd.DataFrame, labels: list[str]) -> pd.DataFrame:
    """A row for each quantity that some method has, a column for each method."""
    rows = [row for _, row in table[table["valid"]].iterrows()]
    columns = {name: [format_with_interval(row, name) for row in rows] for name in ROWS}
    cells = pd.DataFrame(columns, index=labels)
    # A delay without an interval was not estimated.
    cells["delay"] = cells["delay"].str.replace("^[^–…]+$", r"\g<0> (assumed)", regex=True)
    is_empty = cells.isin(["–", ""]).all()
    return cells.loc[:, ~is_empty].rename(columns=ROWS).T.reset_index(names="")


def _mark_labels(analysis: Analysis) -> dict[str, str]:
    """Labels of the methods that were fitted, with a mark on those that have a warning."""
    trusted = set(analysis.table[analysis.table["trusted"]].get("label", ()))
    return {
        label: label if label in trusted else f"{label} (warning)" for label in analysis.estimates
    }
