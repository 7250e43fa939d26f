"""Charts of many trials: curves of means, means row by row, traces over time, singular values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from ankleloop.plotting.panels import (
    COLUMNS,
    Panel,
    Styles,
    draw_panels,
    estimates_figure,
    finish,
    note_lowest,
)
from ankleloop.plotting.style import (
    ONE_COLUMN,
    REFERENCE_LINE,
    TRUE,
    TWO_COLUMNS,
    DataFigure,
    MethodStyle,
)

RATIO, LIMITS = "rms error over the bound [1]", (0.7, 50.0)  # and its axis


def curves_figure(
    table: pd.DataFrame,
    panels: Mapping[str, Panel],
    *,
    xlabel: str,
    styles: Styles | None = None,
    log: bool = False,
    above: float | None = None,
) -> DataFigure:
    """Means over trials against a parameter, with their 95 % confidence bands.

    The columns are `panel`, `series`, `x`, `value`, `low`, `high`, `marked` and `failed`. A single trial has no band. A
    ring marks means of which a trial failed or came with a warning; where every trial failed, a cross stands at the
    lower edge of the panel. Panels of the same quantity share their ordinate. What lies above a level is also shown on
    a scale of its own, in panels on top of the others.
    """
    panels = {name: replace(panel, xlabel=xlabel, log="x" * log) for name, panel in panels.items()}
    columns = min(COLUMNS, len(panels))
    if above is not None:
        upper = {}
        for name, panel in panels.items():
            label, limits = (
                panel.label.replace(" [", f" above {above:g} ["),
                (above, (panel.limits or (0.0, 100.0))[1]),
            )
            upper[f"upper {name}"] = replace(panel, label=label, limits=limits)
        panels = {**upper, **panels}
        table = pd.concat([table.assign(panel="upper " + table["panel"]), table], ignore_index=True)
    width = ONE_COLUMN if len(panels) == 1 else TWO_COLUMNS
    figure, axes = draw_panels(table, panels, styles, columns=columns, width=width, sharex=True)
    for axis, (name, panel) in zip(axes, panels.items(), strict=True):
        if panel.limits and panel.limits[0] != above:
            note_lowest(axis, table.loc[table["panel"] == name, "value"].min())
    return finish(figure)


def ratio_figure(table: pd.DataFrame, *, limit: float, styles: Styles | None = None) -> DataFigure:
    """Errors over the Cramér-Rao bound: a panel for each setting, a row for each parameter, a symbol for a method."""
    titles = {name: name.replace(", ", ",\n", 1) for name in table["panel"]}
    panels = {name: Panel(RATIO, title, limits=LIMITS, log="x") for name, title in titles.items()}
    levels = {"the bound": (1.0, TRUE.line), f"{limit:g} times the bound": (limit, REFERENCE_LINE)}
    table = table.filter(["panel", "row", "series", "fault", "failed"]).assign(value=table["ratio"])
    return estimates_figure(table, panels, levels=levels, styles=styles)


def traces_figure(
    traces: Mapping[str, Mapping[str, np.ndarray]],
    truths: Mapping[str, tuple[str, float]],
    settling: float,
    style: MethodStyle,
) -> DataFigure:
    """Estimated parameters over time, a column for each condition; the ordinates are those of the settled traces."""
    parts = []
    panels: dict[str, Panel] = {}
    for name, (label, truth) in truths.items():
        settled = np.concatenate(
            [[truth], *(trace[name][trace["time"] >= settling] for trace in traces.values())]
        )
        low, high = float(settled.min()), float(settled.max())
        limits = low - 0.2 * (high - low), high + 0.2 * (high - low)
        for condition, trace in traces.items():
            title = "" if panels and name != next(iter(truths)) else condition.replace(", ", ",\n")
            panels[f"{name} {condition}"] = Panel(label, title, truth, limits, "time [s]")
            columns = {"condition": condition, "x": trace["time"], "value": trace[name]}
            parts.append(
                pd.DataFrame({"panel": f"{name} {condition}", "series": "estimate", **columns})
            )
    styles = {"estimate": replace(style, more={"lw": 0.9})}
    return finish(
        draw_panels(
            pd.concat(parts), panels, styles, columns=len(traces), height=34.0, sharex=True
        )[0]
    )


def order_figure(
    singular_values: Mapping[str, Sequence[np.ndarray]],
    *,
    order: float,
    styles: Styles,
    largest: int = 10,
) -> DataFigure:
    """Singular values that show the order, of every trial and method."""
    panels, parts, looks = {}, [], {}
    for label, trials in singular_values.items():
        panels[label] = Panel(
            "singular value over the first [1]", label, xlabel="number [1]", log="y"
        )
        for trial, values in enumerate(trials):
            looks[f"{label} {trial}"] = replace(
                styles[label], more={"ms": 2.2, "mew": 0.5, "lw": 0.5, "alpha": 0.6}
            )
            relative = np.asarray(values)[:largest] / values[0]
            columns = {
                "series": f"_{label} {trial}",
                "x": np.arange(1, relative.size + 1),
                "value": relative,
            }
            parts.append(pd.DataFrame({"panel": label, **columns}))
    figure, axes = draw_panels(pd.concat(parts), panels, looks, columns=len(panels), height=52.0)
    for axis in axes:
        axis.axvline(order + 0.5, **REFERENCE_LINE)
        axis.set_xticks(range(1, largest + 1))
    return finish(figure)
