"""Style of all figures: colours, legends that can be read, files that are the same for the same data."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ankleloop.records.files import atomic_file

__all__ = [
    "ALL_FAILED",
    "COLOURS",
    "FAULT_RING",
    "MARKERS",
    "REFERENCE_LINE",
    "STYLE",
    "add_legend",
    "panel_grid",
    "save_figure",
]

# Okabe and Ito's colours can be told apart by colour-blind readers, and differ in print; two of Tol's for more.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#222222", "#882255", "#999933")
MARKERS = "osD^v<>pX"
# Line of a true value or of a limit.
REFERENCE_LINE: dict[str, Any] = {"color": "black", "lw": 0.8, "ls": (0, (2, 2))}
# Around the symbol of a mean: some of its trials failed, or came with a warning.
FAULT_RING: dict[str, Any] = {"ls": "", "marker": "o", "ms": 7.5, "mfc": "none", "mec": "#444444", "mew": 0.7}
FAULT_RING |= {"zorder": 4, "label": "with failures or warnings"}
ALL_FAILED = "every trial failed"  # label of a cross at the edge of a panel
STYLE: Any = {
    "font.size": 8.5,
    "axes.titlesize": 8.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.5,
    "legend.frameon": False,
    "pdf.fonttype": 42,
    "svg.hashsalt": "ankleloop",
}
# Metadata that would differ between two runs are left out.
METADATA: dict[str, dict[str, Any]] = {
    ".png": {"Software": None},
    ".pdf": {"CreationDate": None, "Producer": None},
    ".svg": {"Date": None, "Creator": None},
}


def panel_grid(
    count: int,
    columns: int,
    panel_size: tuple[float, float],
    margin: tuple[float, float],
    *,
    sharex: bool = False,
    sharey: bool = False,
) -> tuple[Figure, list[Axes]]:
    """Make a figure with panels in rows, and leave the rest of the last row empty.

    Parameters
    ----------
    count : int
        Number of panels.
    columns : int
        Panels side by side, at most.
    panel_size, margin : tuple of float
        Width and height of a panel, and of what the figure adds to all of them [in].
    sharex, sharey : bool
        Whether the panels share their abscissae, their ordinates.

    Returns
    -------
    figure : matplotlib.figure.Figure
    axes : list of matplotlib.axes.Axes
        Axes of the panels, without those that are empty.

    Examples
    --------
    >>> figure, axes = panel_grid(4, 3, (3.0, 2.0), (0.5, 0.5))
    >>> figure.get_size_inches().tolist(), len(axes)
    ([9.5, 4.5], 4)
    """
    columns = min(columns, count)
    rows = -(-count // columns)
    size = (panel_size[0] * columns + margin[0], panel_size[1] * rows + margin[1])
    figure = Figure(figsize=size, layout="constrained")
    axes = list(figure.subplots(rows, columns, squeeze=False, sharex=sharex, sharey=sharey).ravel())
    for axis in axes[count:]:
        axis.set_visible(False)
    return figure, axes[:count]


def add_legend(figure: Figure, axes: Iterable[Axes]) -> None:
    """Put one legend for all axes below them; each label appears once, those of marks at the end.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        The figure.
    axes : iterable of matplotlib.axes.Axes
        Its axes.
    """
    lines = {str(line.get_label()): line for axis in axes for line in axis.get_lines()}
    lines = {label: line for label, line in lines.items() if label[0] != "_"}
    labels = sorted(lines, key=lambda label: label in (FAULT_RING["label"], ALL_FAILED))
    columns = min(3, max(1, int(figure.get_figwidth() // 2.2)), len(labels))  # a narrow figure would cut them off
    figure.legend([lines[label] for label in labels], labels, loc="outside lower center", ncols=columns)


def save_figure(
    figure: Figure, stem: str | Path, suffixes: Sequence[str] = (".png", ".pdf"), *, overwrite: bool = False
) -> None:
    """Write a figure, the same bytes for the same data.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        The figure.
    stem : path-like
        Path without its suffix.
    suffixes : sequence of str
        Of ".png", ".pdf" and ".svg".
    overwrite : bool
        Whether to replace files of these names; without it existing files are refused.

    Raises
    ------
    DataError
        If a file exists, or cannot be written.
    """
    stem = Path(stem)
    with matplotlib.rc_context(STYLE):
        for suffix in suffixes:
            with atomic_file(stem.with_name(stem.name + suffix), overwrite=overwrite) as partial:
                figure.savefig(partial, format=suffix[1:], dpi=200, metadata=METADATA[suffix])
