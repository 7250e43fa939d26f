"""Map of a quantity over two parameters, cell by cell."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.image import AxesImage
from matplotlib.patches import Rectangle

from ankleloop.plotting.panels import panel_grid
from ankleloop.plotting.style import STYLE, DataFigure

if TYPE_CHECKING:
    import pandas as pd

FRAME = "#D55E00"  # of cells within a limit
COLUMNS = 3  # panels side by side
TITLE = 32  # characters of a line above a panel


@matplotlib.rc_context({**STYLE, "axes.grid": False})
def map_figure(
    table: pd.DataFrame,
    *,
    x: str,
    y: str,
    panel: str,
    value: str,
    xlabel: str,
    ylabel: str,
    title: str,
    limit: float,
) -> DataFigure:
    """Map of a quantity over two parameters, a panel for each value of a third."""
    names = list(dict.fromkeys(table[panel]))
    figure, axes = panel_grid(len(names), COLUMNS, 52.0, sharex=True, sharey=True)
    norm = LogNorm(max(0.5, table[value].min()), max(1.0, table[value].max()))
    for number, (axis, name) in enumerate(zip(axes, names, strict=True)):
        rows = table[table[panel] == name]
        cells = rows.pivot(index=y, columns=x, values=value)
        faults = rows.assign(fault=rows.get("fault", False)).pivot(index=y, columns=x, values="fault")
        image = _draw_cells(axis, cells, faults.eq(True).to_numpy(), norm, limit)
        lines = [part for line in title.format(name).split("\n") for part in textwrap.wrap(line, TITLE)]
        axis.set(title="\n".join(lines))
        if number % COLUMNS == 0:
            axis.set_ylabel(ylabel)
        if number + COLUMNS >= len(names):
            axis.set_xlabel(xlabel)
    label = "largest deviation from the paper [points of VAF]"
    bar = figure.colorbar(image, ax=figure.axes, label=label, aspect=40, pad=0.02)
    bar.ax.yaxis.set_major_formatter("{x:g}")
    bar.ax.yaxis.set_minor_formatter("{x:g}")
    bar.ax.tick_params(which="minor", labelsize=6)
    data = table.assign(panel=table[panel].str.replace("\n", ", "), fault=table.get("fault", False))
    figure.data = data[["panel", x, y, value, "fault"]].rename(columns={x: xlabel, y: ylabel, value: label})
    return figure


def _draw_cells(axis: Axes, cells: pd.DataFrame, faults: np.ndarray, norm: LogNorm, limit: float) -> AxesImage:
    image = axis.imshow(cells.to_numpy(), norm=norm, cmap="viridis_r", origin="lower", aspect="auto")
    axis.set_xticks(range(cells.shape[1]), [f"{value:g}" for value in cells.columns])
    axis.set_yticks(range(cells.shape[0]), [f"{value:g}" for value in cells.index])
    for (row, column), value in np.ndenumerate(cells.to_numpy()):
        if not np.isfinite(value):
            text = "failed" if faults[row, column] else "unstable"
            axis.text(column, row, text, ha="center", va="center", fontsize=6)
            continue
        text = (f"{value:.1f}" if value < 100 else f"{value:.0f}") + "*" * int(faults[row, column])
        colour = "white" if norm(value) > 0.5 else "black"  # on a dark or a light cell
        axis.text(column, row, text, ha="center", va="center", fontsize=6.5, color=colour)
        if value <= limit:
            axis.add_patch(Rectangle((column - 0.5, row - 0.5), 1, 1, fill=False, ec=FRAME, lw=2))
    return image
