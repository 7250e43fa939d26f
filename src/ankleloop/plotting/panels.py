"""Panels of a figure in rows, with shared axes where they show the same quantity."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import pandas as pd
from matplotlib.axes import Axes

from ankleloop.plotting.style import TWO_COLUMNS, DataFigure, inches


@dataclass(frozen=True)
class Panel:
    """What a panel shows."""

    label: str  # quantity with its unit; panels with the same label share its axis
    title: str = ""  # what tells panels of the same quantity apart
    truth: float | None = None  # true value, which is drawn as a line
    limits: tuple[float, float] | None = None  # limits of the axis of the quantity


def split_label(label: str) -> tuple[str, str]:
    """Split the label of an axis into the quantity and its unit."""
    quantity, bracket, unit = label.replace("\n", " ").rpartition(" [")
    return (quantity, unit.rstrip("]")) if bracket else (label, "")


def panel_grid(
    count: int,
    columns: int,
    height: float,
    *,
    width: float = TWO_COLUMNS,
    sharex: bool = False,
    sharey: bool = False,
) -> tuple[DataFigure, list[Axes]]:
    """Make a figure with panels in rows, and leave the rest of the last row empty."""
    columns = min(columns, count)
    rows = -(-count // columns)
    figure = DataFigure(figsize=(inches(width), inches(height * rows)), layout="constrained")
    axes = list(figure.subplots(rows, columns, squeeze=False, sharex=sharex, sharey=sharey).ravel())
    for axis in axes[count:]:
        axis.set_visible(False)
    for axis in axes[count - columns : count]:  # the panel below it may be empty
        axis.tick_params(labelbottom=True)
    return figure, axes[:count]


def share_ordinates(axes: Sequence[Axes], panels: Sequence[Panel], columns: int) -> None:
    """Give panels of the same quantity one ordinate, with its label at the first of them in a row."""
    first: dict[str, Axes] = {}
    for number, (axis, panel) in enumerate(zip(axes, panels, strict=True)):
        if panel.label in first:
            axis.sharey(first[panel.label])
        first.setdefault(panel.label, axis)
        if number % columns and panels[number - 1].label == panel.label:
            axis.tick_params(labelleft=False)
        else:
            axis.set_ylabel(panel.label)
        axis.set_title(panel.title)


def tabulate_lines(axes: Iterable[Axes]) -> pd.DataFrame:
    """Numbers of all lines of some panels that have a label."""
    parts = []
    for axis in axes:
        (quantity, unit), (x_quantity, x_unit) = split_label(axis.get_ylabel()), split_label(axis.get_xlabel())
        for line in axis.get_lines():
            label = str(line.get_label())
            if label[0] == "_" or line.get_transform() != axis.transData:
                continue
            names = {"quantity": quantity, "unit": unit, "series": label, "x_quantity": x_quantity, "x_unit": x_unit}
            parts.append(pd.DataFrame({**names, "x": line.get_xdata(), "value": line.get_ydata()}))
    return pd.concat(parts, ignore_index=True)
