"""Charts of many trials: curves of means, means row by row, traces over time, singular values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from ankleloop.plotting.panels import (
    PANEL_COLUMNS,
    Panel,
    Styles,
    curve,
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

RATIO_LIMITS = (0.7, 50.0)  # of the axis of errors over the bound
ORDERS = 10  # singular values that are drawn
# Against the true torques; what lies above the level is shown on a scale of its own, too.
VAF_PANELS = {
    torque: Panel("VAF [%]", f"{torque} torque", limits=(-160.0, 100.4))
    for torque in ("net", "intrinsic", "reflex")
}
VAF_LEVEL = 90.0  # %


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
    direction = "x" if log else ""
    panels = {name: replace(panel, xlabel=xlabel, log=direction) for name, panel in panels.items()}
    upper = {}
    if above is not None:
        for name, panel in panels.items():
            label = panel.label.replace(" [", f" above {above:g} [")
            _, top = panel.limits or (0.0, 100.0)
            upper[f"upper {name}"] = replace(panel, label=label, limits=(above, top))
        table = pd.concat([table.assign(panel="upper " + table["panel"]), table])
    figure = draw_panels(
        table,
        {**upper, **panels},
        styles,
        columns=min(PANEL_COLUMNS, len(panels)),
        width=TWO_COLUMNS if len(panels) > 1 or upper else ONE_COLUMN,
        sharex=True,
    )
    for axis, name in zip(figure.axes[len(upper) :], panels, strict=True):
        note_lowest(axis, table.loc[table["panel"] == name, "value"].min())
    return finish(figure)


def ratio_figure(table: pd.DataFrame, *, limit: float, styles: Styles) -> DataFigure:
    """Errors over the Cramér-Rao bound: a panel for each setting, a row for each parameter, a symbol for a method."""
    panels = {}
    for name in table["panel"].unique():
        panels[name] = Panel(
            "rms error over the bound [1]",
            title=name.replace(", ", ",\n", 1),
            limits=RATIO_LIMITS,
            log="x",
        )
    levels = {"the bound": (1.0, TRUE.line), f"{limit:g} times the bound": (limit, REFERENCE_LINE)}
    shown = table.filter(["panel", "row", "series", "marked", "failed"])
    return estimates_figure(
        shown.assign(value=table["ratio"]), panels, levels=levels, styles=styles
    )


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
        settled = [trace[name][trace["time"] >= settling] for trace in traces.values()]
        values = np.concatenate([[truth], *settled])
        margin = 0.2 * np.ptp(values)
        for condition, trace in traces.items():
            panel = f"{name} {condition}"
            panels[panel] = Panel(
                label,
                title=condition.replace(", ", ",\n") if name == next(iter(truths)) else "",
                truth=truth,
                limits=(values.min() - margin, values.max() + margin),
                xlabel="time [s]",
            )
            parts.append(curve(panel, "estimate", trace["time"], trace[name], condition=condition))
    styles = {"estimate": replace(style, more={"lw": 0.9})}
    table = pd.concat(parts)
    return finish(draw_panels(table, panels, styles, columns=len(traces), height=34.0, sharex=True))


def order_figure(
    singular_values: Mapping[str, Sequence[np.ndarray]], *, order: float, styles: Styles
) -> DataFigure:
    """Singular values that show the order, of every trial and method."""
    panels = {}
    parts = []
    looks = {}
    for label, trials in singular_values.items():
        panels[label] = Panel(
            "singular value over the first [1]", title=label, xlabel="number [1]", log="y"
        )
        look = replace(styles[label], more={"ms": 2.2, "mew": 0.5, "lw": 0.5, "alpha": 0.6})
        for trial, values in enumerate(trials):
            name = f"{label} {trial}"
            looks[name] = look
            relative = np.asarray(values)[:ORDERS] / values[0]
            parts.append(curve(label, f"_{name}", np.arange(1, relative.size + 1), relative))
    figure = draw_panels(pd.concat(parts), panels, looks, columns=len(panels), height=52.0)
    for axis in figure.axes:
        axis.axvline(order + 0.5, **REFERENCE_LINE)
        axis.set_xticks(range(1, ORDERS + 1))
    return finish(figure)
