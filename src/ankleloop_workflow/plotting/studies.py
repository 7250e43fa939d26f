"""Curves of means over many trials."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import pandas as pd

from ankleloop.plotting.panels import (
    PANEL_COLUMNS,
    Panel,
    Styles,
    draw_panels,
    finish,
    note_lowest,
)
from ankleloop.plotting.style import (
    ONE_COLUMN,
    TWO_COLUMNS,
    DataFigure,
)

# Against the true torques; what lies above the level is shown on a scale of its own, too.
VAF_PANELS = {
    torque: Panel("VAF [%]", f"{torque} torque", limits=(-160.0, 107.0))
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
    ring marks means with more failures and warnings than others of their curve; where every trial failed, a cross
    stands at the lower edge of the panel. Panels of the same quantity share their ordinate. What lies above a level [%]
    is also shown on a scale of its own, in panels on top of the others.
    """
    direction = "x" if log else ""
    panels = {name: replace(panel, xlabel=xlabel, log=direction) for name, panel in panels.items()}
    upper = {}
    if above is not None:
        for name, panel in panels.items():
            label = panel.label.replace(" [", f" above {above:g} [")
            top = 100.0 + 0.04 * (100.0 - above)  # with room for symbols at 100 %
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
