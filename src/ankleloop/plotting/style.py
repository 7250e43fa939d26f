"""Style of all figures: sizes in print, fonts, lines; and their files, which are the same for the same data."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib
from matplotlib.figure import Figure

from ankleloop.trials.files import atomic_file, quote_formulas

if TYPE_CHECKING:
    import pandas as pd

# Widths of figures [mm], as journals set one and two columns.
ONE_COLUMN = 88.0
TWO_COLUMNS = 181.0
DOTS_PER_INCH = 300  # of pictures, for print
SCREEN_DOTS_PER_INCH = 130  # of those that a notebook shows

MARK = "mark"  # group of lines that are no series: they stand at the end of a legend
# Line of a true value or of a limit.
REFERENCE_LINE: dict[str, Any] = {"color": "black", "lw": 0.8, "ls": (0, (2, 2)), "gid": MARK}
MEASURED_LINE: dict[str, Any] = {"color": "#888888", "lw": 1.0, "gid": MARK}
TRUE_LINE: dict[str, Any] = {"color": "black", "lw": 1.0, "gid": MARK}
# Around the symbol of a mean: some of its trials failed, or came with a warning.
FAULT_RING: dict[str, Any] = {"ls": "", "marker": "o", "ms": 6.0, "mfc": "none", "mec": "#666666", "mew": 0.5}
FAULT_RING |= {"zorder": 4, "label": "with failures or warnings", "gid": MARK}
ALL_FAILED = "every trial failed"  # label of a cross at the edge of a panel
NOTE: dict[str, Any] = {"xycoords": "axes fraction", "fontsize": 6.5, "color": "#555555"}
STYLE: Any = {
    "font.family": "DejaVu Sans",  # comes with matplotlib, so that figures are the same on every machine
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "axes.labelsize": 8.0,
    "figure.titlesize": 8.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.1,
    "lines.markersize": 3.4,
    "lines.markeredgewidth": 0.8,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "xtick.minor.size": 1.5,
    "ytick.minor.size": 1.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.5,
    "axes.axisbelow": True,
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


class DataFigure(Figure):
    """Figure with the table of the numbers that it draws, which a notebook shows without pyplot.

    `data` is a tidy table whose units are in the names of its columns or in a column `unit`; `save_figure` writes it
    beside the picture. A diagram has none.
    """

    data: pd.DataFrame | None = None

    def _repr_png_(self) -> bytes:
        """Picture for notebooks."""
        return render_png(self, SCREEN_DOTS_PER_INCH)


def inches(millimetres: float) -> float:
    """Convert a length in print to the unit of matplotlib."""
    return millimetres / 25.4


def render_png(figure: Figure, dots_per_inch: float) -> bytes:
    """Draw a figure as a PNG, the same bytes for the same data."""
    return _render(figure, ".png", dots_per_inch)


def _render(figure: Figure, suffix: str, dots_per_inch: float) -> bytes:
    stream = BytesIO()
    with matplotlib.rc_context(STYLE):
        figure.savefig(stream, format=suffix[1:], dpi=dots_per_inch, metadata=METADATA[suffix])
    return stream.getvalue()


def save_figure(
    figure: Figure, stem: str | Path, suffixes: Sequence[str] | None = None, *, overwrite: bool = False
) -> None:
    """Write a figure and the numbers that it draws, the same bytes for the same data."""
    stem, data = Path(stem), getattr(figure, "data", None)
    if suffixes is None:
        suffixes = (".png", ".pdf") if data is None else (".png", ".pdf", ".csv")
    if ".csv" in suffixes and data is None:
        raise ValueError(f"{stem.name}: this figure has no table of its numbers: leave .csv out of suffixes.")
    for suffix in suffixes:
        with atomic_file(stem.with_name(stem.name + suffix), overwrite=overwrite) as partial:
            if suffix == ".csv" and data is not None:
                quote_formulas(data).to_csv(partial, index=False, lineterminator="\n")
            else:
                partial.write_bytes(_render(figure, suffix, DOTS_PER_INCH))
