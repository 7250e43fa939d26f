"""Panels of a figure in rows, their legend, and marks of means that failures or warnings concern."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ankleloop.plotting.style import ALL_FAILED, FAULT_RING, MARK, TWO_COLUMNS, DataFigure, inches

LEGEND: dict[str, Any] = {"handlelength": 2.0, "columnspacing": 1.8, "labelspacing": 0.35, "borderaxespad": 0.1}


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


def new_figure(height: float, width: float = TWO_COLUMNS) -> DataFigure:
    """Make a figure of a height and a width in print [mm]."""
    return DataFigure(figsize=(inches(width), inches(height)), layout="constrained")


def panel_grid(
    count: int, columns: int, height: float, *, width: float = TWO_COLUMNS, **shared: Any
) -> tuple[DataFigure, list[Axes]]:
    """Make a figure with panels in rows of a height [mm], and leave the rest of the last row empty."""
    columns = min(columns, count)
    rows = -(-count // columns)
    figure = new_figure(height * rows, width)
    axes = list(figure.subplots(rows, columns, squeeze=False, **shared).ravel())
    for axis in axes[count:]:
        axis.set_visible(False)
    for axis in axes[count - columns : count]:  # the panel below it may be empty
        axis.tick_params(labelbottom=True)
    return figure, axes[:count]


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


def add_legend(figure: Figure, axes: Iterable[Axes]) -> None:
    """Put the entries of all lines below the panels, in as few rows as fit: each label once, those of marks last."""
    lines: dict[str, Line2D] = {}
    for line in (line for axis in axes for line in axis.get_lines()):
        lines.setdefault(str(line.get_label()), line)
    names = sorted((name for name in lines if name[0] != "_"), key=lambda name: _rank(lines[name]))
    renderer = FigureCanvasAgg(figure).get_renderer()
    for rows in range(1, len(names) + 1):
        columns = -(-len(names) // rows)
        handles = [lines[name] for name in names]
        legend = figure.legend(handles, names, loc="outside lower center", ncols=columns, **LEGEND)
        extent = legend.get_window_extent(renderer)
        if extent.width <= figure.bbox.width or columns == 1:
            figure.set_figheight(figure.get_figheight() + extent.height / figure.dpi)
            break
        legend.remove()


def _rank(line: Line2D) -> int:
    """Place of an entry in a legend: series, other marks, marks of failures."""
    return 2 if line.get_label() in (FAULT_RING["label"], ALL_FAILED) else int(line.get_gid() == MARK)


def mark_means(
    axis: Axes, x: np.ndarray, y: np.ndarray, marked: np.ndarray, failed: np.ndarray, colour: str, edge: float | None
) -> None:
    """Draw rings around means with failures or warnings, and crosses at an edge of a panel where every trial failed.

    The edge is the lower one, where the crosses have a height in the panel, or without a height the left one.
    Shapes: x, y, marked, failed (N,).
    """
    marked = marked & np.isfinite(y) & np.isfinite(x)
    if marked.any():
        axis.plot(x[marked], y[marked], **FAULT_RING)
    if failed.any():
        cross: dict[str, Any] = {"marker": "x", "ms": 4.5, "ls": "", "color": colour, "zorder": 4, "clip_on": False}
        near = np.full(failed.sum(), 0.02 if edge is None else edge)
        places = (near, y[failed]) if edge is None else (x[failed], near)
        transform = axis.get_yaxis_transform() if edge is None else axis.get_xaxis_transform()
        axis.plot(*places, transform=transform, label=ALL_FAILED, **cross)
