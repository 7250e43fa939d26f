"""Maps of a quantity over two parameters: cells with their numbers."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.image import AxesImage
from matplotlib.patches import Rectangle

from ankleloop.plotting.panels import panel_grid
from ankleloop.plotting.style import STYLE, DataFigure

if TYPE_CHECKING:
    import pandas as pd

FRAME = "#D55E00"  # of cells within a limit
COLUMNS = 3  # panels side by side
TITLE = 32  # characters of a line above a panel
LABEL = "largest deviation from the paper [points of VAF]"
DARK = 0.5  # lightness of a cell from which on its number is black


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
    table = table.assign(fault=table.get("fault", False))
    names = list(dict.fromkeys(table[panel]))
    figure, axes = panel_grid(len(names), COLUMNS, 52.0, sharex=True, sharey=True)
    norm = LogNorm(max(0.5, table[value].min()), max(1.0, table[value].max()))
    for number, (axis, name) in enumerate(zip(axes, names, strict=True)):
        cells = table[table[panel] == name].pivot(index=y, columns=x, values=[value, "fault"])
        values, faults = cells[value].to_numpy(dtype=float), cells["fault"].eq(True).to_numpy()
        texts = np.where(values < 100, np.char.mod("%.1f", values), np.char.mod("%.0f", values))
        texts = np.where(np.isfinite(values), np.char.add(texts, np.where(faults, "*", "")), "unstable")
        texts[~np.isfinite(values) & faults] = "failed"
        image = draw_cells(axis, values, norm, "viridis_r", texts)
        for row, column in np.argwhere(values <= limit):
            axis.add_patch(Rectangle((column - 0.5, row - 0.5), 1, 1, fill=False, ec=FRAME, lw=2))
        axis.set_xticks(range(values.shape[1]), [f"{tick:g}" for tick in cells[value].columns])
        axis.set_yticks(range(values.shape[0]), [f"{tick:g}" for tick in cells.index])
        axis.set_title("\n".join(textwrap.fill(line, TITLE) for line in title.format(name).split("\n")))
        axis.set_ylabel(ylabel if number % COLUMNS == 0 else "")
        axis.set_xlabel(xlabel if number + COLUMNS >= len(names) else "")
    bar = figure.colorbar(image, ax=figure.axes, label=LABEL, aspect=40, pad=0.02)
    bar.ax.yaxis.set_major_formatter("{x:g}")
    bar.ax.yaxis.set_minor_formatter("{x:g}")
    bar.ax.tick_params(which="minor", labelsize=6)
    data = table.assign(panel=table[panel].str.replace("\n", ", "))
    figure.data = data[["panel", x, y, value, "fault"]].rename(columns={x: xlabel, y: ylabel, value: LABEL})
    return figure


def draw_cells(
    axis: Axes, values: np.ndarray, norm: Normalize, cmap: str, texts: np.ndarray | None = None
) -> AxesImage:
    """Cells in their colours with a text in each; shapes of values and texts: (rows, columns)."""
    image = axis.imshow(values, norm=norm, cmap=cmap, origin="lower", aspect="auto", interpolation="nearest")
    for (row, column), text in np.ndenumerate(texts if texts is not None else np.empty((0, 0))):
        lightness = np.dot(image.to_rgba(values[row, column])[:3], (0.3, 0.6, 0.1))
        colour = "black" if lightness > DARK or not np.isfinite(values[row, column]) else "white"
        axis.text(column, row, text, ha="center", va="center", fontsize=6.2, color=colour)
    return image
