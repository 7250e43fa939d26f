"""Pages of recordings: checks, methods side by side, figures."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import pandas as pd

from ankleloop.pages.interactive import render_interactive_torques
from ankleloop.pages.rendering import describe_table, render_page, render_template
from ankleloop.plotting.estimates import torque_figure, trajectories_figure
from ankleloop.plotting.recordings import model_figure, residual_figure, spectra_figure
from ankleloop.plotting.style import method_styles, render_figure
from ankleloop.quantities import QUANTITIES
from ankleloop.recordings.recommendation import describe_variations, format_with_interval

if TYPE_CHECKING:
    import xarray as xr

    from ankleloop.joint.estimate import Estimate
    from ankleloop.recordings.analysis import Analysis
    from ankleloop.recordings.recommendation import Recommendation

SCORES = ("vaf_unseen", "vaf_net", "vaf_intrinsic", "vaf_reflex")
PARAMETERS = ("K", "B", "I", "G", "omega_n", "zeta", "pole", "threshold", "delay")
# Rows of the table of methods: columns of `Analysis.table` with their headings.
ROWS = {name: QUANTITIES[name].label for name in (*SCORES, *PARAMETERS)}
ROWS |= {"intervals": "intervals of the parameters", "selected": "selected"}
SUSPECT = "{} (warning)"  # label of a method that is not to be trusted
PIXELS_PER_INCH = 137.5  # of the page: a figure of two columns fills it
DOTS_PER_INCH = 220  # of the picture


@dataclass(frozen=True)
class EmbeddedFigure:
    """A picture that is part of a page."""

    source: str  # the picture as a data URI
    width: int  # width in the page [px]
    interactive: str = ""  # HTML of the same figure with more in it, for the screen; empty where there is none
    data: pd.DataFrame | None = field(default=None, compare=False, repr=False)  # numbers that the figure draws


def embed_recording_figures(
    trial: xr.Dataset | None, analysis: Analysis, *, start: float = 10.0, length: float = 5.0
) -> dict[str, EmbeddedFigure]:
    """Draw the figures of the page of a recording."""
    figures, interactive = {}, {}
    if analysis.check.spectra:
        figures["spectra"] = spectra_figure(analysis.check.spectra)
    if trial is not None and analysis.estimates:
        recording = trial.drop_vars([name for name in trial.data_vars if str(name).startswith("torque_")])
        marked = _mark_labels(analysis)
        estimates = {marked[label]: estimate for label, estimate in analysis.estimates.items()}
        figures["torques"] = torque_figure(recording, estimates, start=start, length=length)
        window = {"start": start, "length": length}
        interactive["torques"] = render_interactive_torques(recording, estimates, window=window)
        figures["models"] = model_figure(estimates)
        styles = method_styles({label: estimate.method for label, estimate in estimates.items()})
        if changing := _select_changing(estimates):
            figures["trajectories"] = trajectories_figure(changing, styles=styles)
        tests = {marked[label]: test for label, test in analysis.residuals.items()}
        figures["residuals"] = residual_figure(tests, styles=styles)
    embedded = {}
    for name, figure in figures.items():
        width = round(PIXELS_PER_INCH * figure.get_size_inches()[0])
        source = f"data:image/png;base64,{base64.b64encode(render_figure(figure, DOTS_PER_INCH)).decode()}"
        embedded[name] = EmbeddedFigure(source, width, interactive.get(name, ""), figure.data)
    return embedded


def render_recording_page(
    name: str,
    mapping: Mapping[str, Any],
    analysis: Analysis,
    recommendation: Recommendation,
    figures: Mapping[str, EmbeddedFigure],
    *,
    index: str | None = None,
) -> str:
    """Page of a recording: recommendation, checks, methods side by side, change of the joint, figures, residuals."""
    valid, marked = analysis.table[analysis.table["valid"]], _mark_labels(analysis)
    description = [
        f"{key} {mapping[key]}" for key in ("subject", "condition", "trial") if mapping[key] not in (None, "")
    ]
    answer = ""
    if recommendation.label is not None:
        row = valid.set_index("label").loc[recommendation.label]
        answer = f"Use {recommendation.label}: K = {format_with_interval(row, 'K')} {QUANTITIES['K'].unit}"
    body = render_template(
        "recording.html.j2",
        title=name,
        description=[*description, *(f"file {part['file']}" for part in mapping["parts"])],
        answer=answer,
        check=analysis.check,
        recommendation=recommendation,
        figures=figures,
        methods=describe_table(_compare_methods(valid, list(marked.values()))) if marked else None,
        variations=[(marked[label], text) for label, text in describe_variations(analysis).items()],
        remarks=_list_remarks(analysis.table),
        residuals={marked[label]: test for label, test in analysis.residuals.items()},
    )
    return render_page(name, body, index=index)


def _select_changing(estimates: Mapping[str, Estimate]) -> dict[str, Estimate]:
    """Estimates with trajectories over what the first of them has, and riv beside them; none without any."""
    sizes = {
        label: () if part.trajectories is None else tuple(part.trajectories.sizes) for label, part in estimates.items()
    }
    first = next(filter(None, sizes.values()), None)
    shown = [label for label, size in sizes.items() if size == first or (not size and estimates[label].method == "riv")]
    return {label: estimates[label] for label in shown} if first else {}


def _compare_methods(valid: pd.DataFrame, labels: list[str]) -> pd.DataFrame:
    """A row for each quantity that some method has, a column for each method."""
    table = []
    for name, heading in ROWS.items():
        cells = [format_with_interval(row, name) for _, row in valid.iterrows()]
        if name == "delay":  # a delay without an interval was given
            cells = [cell if cell == "–" or "…" in cell else f"{cell} (assumed)" for cell in cells]
        if set(cells) - {"–", ""}:
            table.append([heading, *cells])
    return pd.DataFrame(table, columns=["", *labels])


def _mark_labels(analysis: Analysis) -> dict[str, str]:
    """Labels of the methods that were fitted, with a mark on those that have a warning."""
    trusted = set(analysis.table[analysis.table["trusted"]].get("label", ()))
    return {label: label if label in trusted else SUSPECT.format(label) for label in analysis.estimates}


def _list_remarks(table: pd.DataFrame) -> list[tuple[str, str]]:
    """Labels of methods, with why they were not fitted, their warnings, what to bear in mind, and what they assume."""
    headings = {"warnings": "warning", "caution": "caution", "unseen_warnings": "fit to the first half"}
    headings["assumptions"] = "assumed"
    remarks = []
    for row in table.to_dict("records"):
        for name, heading in (headings if row["valid"] else {"warnings": "not fitted"}).items():
            if isinstance(row.get(name), str) and row[name]:
                remarks.append((row["label"], f"{heading}: {row[name]}"))
    return remarks
