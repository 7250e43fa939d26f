"""Legends in even rows below the panels of a figure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.legend import Legend

from ankleloop.plotting.style import ALL_FAILED, FAULT_RING, MARK

HANDLE, PAD, GAP = 2.0, 0.6, 1.8  # length of a line, its distance to the text, distance of entries [font sizes]
LAYOUT: dict[str, Any] = {"handlelength": HANDLE, "handletextpad": PAD, "columnspacing": GAP, "labelspacing": 0.35}
LAYOUT |= {"borderpad": 0.15, "borderaxespad": 0.0}
SPACE = 3.0  # pt between the panels and the legend


def add_legend(figure: Figure, axes: Iterable[Axes]) -> None:
    """Put the entries of all lines below the panels: each label once, those of marks in the last row."""
    lines = {str(line.get_label()): line for axis in axes for line in axis.get_lines()}
    lines = {label: line for label, line in lines.items() if label[0] != "_"}
    marks = [label for label, line in lines.items() if line.get_gid() == MARK or label == ALL_FAILED]
    marks.sort(key=lambda label: label in (FAULT_RING["label"], ALL_FAILED))
    add_entries(figure, {name: line for name, line in lines.items() if name not in marks}, {m: lines[m] for m in marks})


def add_entries(figure: Figure, series: Mapping[str, Any], marks: Mapping[str, Any]) -> None:
    """Put legend entries below the panels: rows have the same number of entries, or differ by one and are centred."""
    handles = {**series, **marks}
    if not handles:
        return
    renderer = FigureCanvasAgg(figure).get_renderer()
    size = FontProperties(size=matplotlib.rcParams["legend.fontsize"]).get_size_in_points()
    widths = {label: _entry_width(figure, label, size, renderer) for label in handles}
    room = 72 * figure.get_figwidth() - 2 * size
    if _row_width(list(handles), widths, size) <= room:
        rows = [list(handles)]
    else:
        rows = [row for names in (list(series), list(marks)) for row in split_rows(names, widths, room, GAP * size)]
    blocks = _join_rows(rows, widths, room, GAP * size)
    legends = [
        figure.legend([handles[name] for name in names], names, loc="lower center", ncols=columns, **LAYOUT)
        for names, columns in blocks
    ]
    _stack(figure, legends, renderer)


def _entry_width(figure: Figure, label: str, size: float, renderer: Any) -> float:
    """Width of an entry [pt]."""
    text = figure.text(0, 0, label, fontsize=size)
    width = text.get_window_extent(renderer).width * 72 / figure.dpi
    text.remove()
    return float(width + (HANDLE + PAD) * size)


def _row_width(names: Sequence[str], widths: Mapping[str, float], size: float) -> float:
    return sum(widths[name] for name in names) + GAP * size * (len(names) - 1)


def split_rows(names: Sequence[str], widths: Mapping[str, float], room: float, gap: float) -> list[list[str]]:
    """Split entries into the fewest rows that fit; their numbers of entries differ by one at most."""
    for count in range(1, len(names) + 1):
        rows = [list(part) for part in np.array_split(np.array(names, dtype=object), count)]
        if all(sum(widths[name] for name in row) + gap * (len(row) - 1) <= room for row in rows):
            return rows
    return [[name] for name in names]


def _join_rows(
    rows: Sequence[list[str]], widths: Mapping[str, float], room: float, gap: float
) -> list[tuple[list[str], int]]:
    """Entries and columns of each block: rows of the same length make one block if their aligned columns fit."""
    blocks: list[list[list[str]]] = []
    for row in rows:
        if blocks and len(blocks[-1][0]) == len(row) > 1:
            aligned = np.array([[widths[name] for name in names] for names in [*blocks[-1], row]]).max(axis=0)
            if aligned.sum() + gap * (len(row) - 1) <= room:
                blocks[-1].append(row)
                continue
        blocks.append([row])
    # A legend is filled column by column.
    return [([name for column in zip(*block, strict=True) for name in column], len(block[0])) for block in blocks]


def _stack(figure: Figure, legends: Sequence[Legend], renderer: Any) -> None:
    """Place legends below each other, and the panels above them in a figure that is higher by as much."""
    heights = [legend.get_window_extent(renderer).height / figure.dpi for legend in legends]
    before = figure.get_figheight()
    total = sum(heights) + SPACE / 72
    figure.set_figheight(before + total)
    bottom = sum(heights)
    for legend, height in zip(legends, heights, strict=True):
        bottom -= height
        legend.set_in_layout(False)
        legend.set_bbox_to_anchor((0.5, bottom / (before + total)), transform=figure.transFigure)
    engine = figure.get_layout_engine()
    if isinstance(engine, ConstrainedLayoutEngine):
        engine.set(rect=(0.0, total / (before + total), 1.0, before / (before + total)))
