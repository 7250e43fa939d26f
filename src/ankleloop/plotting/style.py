"""Style of all figures, and of each method: the same in every picture; figures and their files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure

from ankleloop.trials.files import atomic_file, write_csv

if TYPE_CHECKING:
    import pandas as pd

    from ankleloop.joint.estimate import Estimate

# Widths of figures [mm], as journals set one and two columns.
ONE_COLUMN = 88.0
TWO_COLUMNS = 181.0
DOTS_PER_INCH = 300  # of pictures, for print
SCREEN_DOTS_PER_INCH = 130  # of those that a notebook shows

MARK = "mark"  # group of lines that are no series: they stand at the end of a legend
# Line of a true value or of a limit.
REFERENCE_LINE: dict[str, Any] = {"color": "black", "lw": 0.8, "ls": (0, (2, 2)), "gid": MARK}
STYLE: Any = {
    "font.family": "DejaVu Sans",  # comes with matplotlib, so that figures are the same on every machine
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "axes.titley": 1.0,  # without a search for room above the ticks, of which there are none
    "figure.titlesize": 8.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.1,
    "lines.markersize": 3.4,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.5,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "text.parse_math": False,  # labels of methods may hold dollars
    "pdf.fonttype": 42,
}
# Metadata that would differ between two runs are left out. PNG: in half the time of the usual level, 6 % larger.
FILE_OPTIONS: dict[str, Any] = {
    ".png": {"metadata": {"Software": None}, "pil_kwargs": {"compress_level": 3}},
    ".pdf": {"metadata": {"CreationDate": None, "Producer": None}},
}

Dashes = tuple[float, ...]


@dataclass(frozen=True)
class MethodStyle:
    """How a method, or another series, is drawn."""

    colour: str  # of lines and symbols, as "#rrggbb"
    marker: str  # symbol, as matplotlib names it
    filled: bool = True  # whether the symbol is filled
    dashes: Dashes = ()  # lengths of dashes and gaps in line widths; empty for a solid line
    # Further properties for matplotlib, such as ls="" for symbols that no line joins.
    more: Mapping[str, Any] = field(default_factory=dict, hash=False)

    @property
    def symbol(self) -> dict[str, Any]:
        """Properties of its symbols for matplotlib."""
        face = self.colour if self.filled else "white"
        return {"color": self.colour, "marker": self.marker, "markerfacecolor": face, **self.more}

    @property
    def line(self) -> dict[str, Any]:
        """Properties of a line without symbols for matplotlib."""
        return {"color": self.colour, "ls": (0, self.dashes) if self.dashes else "-", **self.more}

    @property
    def curve(self) -> dict[str, Any]:
        """Properties of a line with symbols for matplotlib."""
        return {**self.symbol, **self.line}


# Light and broad, so that every estimate stands out on it, also in grey.
MEASURED = MethodStyle("#b0b0b0", "", more={"lw": 2.2, "gid": MARK, "zorder": 1.9})
TRUE = MethodStyle("#000000", "", more={"lw": 1.0, "gid": MARK, "zorder": 1.9})
# Five of Okabe and Ito's colours and four that differ from them for readers without red or green receptors, too. The
# colours also differ in lightness where their hues are near; no two methods share a symbol.
METHOD_STYLES: Mapping[str, MethodStyle] = {
    "pr-moesp": MethodStyle("#0072B2", "o"),
    "eiv-moesp": MethodStyle("#D55E00", "s"),
    "pi-moesp": MethodStyle("#E69F00", "v"),
    "po-moesp": MethodStyle("#56B4E9", "<"),
    "moesp": MethodStyle("#5533CC", ">"),
    "parallel-cascade": MethodStyle("#009E73", "^"),
    "real-time": MethodStyle("#CC79A7", "X"),
    "riv": MethodStyle("#882255", "D"),
    "riv-tv": MethodStyle("#B22222", "p"),
    "ensemble": MethodStyle("#200060", "h"),
}
SPARE = MethodStyle("#555555", "P")  # of a method without one, such as a new one

# Change of lightness, fill and line of the variants of a method: they keep its colour and its symbol.
VARIANTS: tuple[tuple[float, bool, Dashes], ...] = (
    (0.0, True, ()),
    (-0.35, False, (4.0, 1.5)),
    (0.4, True, (6.0, 1.5, 1.0, 1.5)),
    (-0.35, True, (1.0, 1.5)),
    (0.4, False, (8.0, 2.0)),
    (0.0, False, (6.0, 1.5, 1.0, 1.5, 1.0, 1.5)),
)
MOST_VARIANTS = 3  # of a single method that are drawn in its colour
# From dark to light: values of a parameter, subjects.
ORDINAL_COLOURS = ("#1B1044", "#3B4A8C", "#2A788E", "#1F9E77", "#62B244", "#DDBE00")
ORDINAL_MARKERS = "os^Dv<>pX"


def method_styles(algorithms: Mapping[str, str]) -> dict[str, MethodStyle]:
    """Styles of the methods of a study.

    A method has the same colour and symbol in every study. Where a study has it with several sets of options, these
    variants differ in lightness, fill and line. Many variants of a single method go from dark to light instead: there
    the colour does not have to tell the method.
    """
    if len(algorithms) > MOST_VARIANTS and len(set(algorithms.values())) == 1:
        return ordinal_styles(algorithms)
    styles: dict[str, MethodStyle] = {}
    used: Counter[str] = Counter()
    for key, method in algorithms.items():
        change, filled, dashes = VARIANTS[used[method] % len(VARIANTS)]
        used[method] += 1
        base = METHOD_STYLES.get(method, SPARE)
        colour = _lighten(base.colour, change)
        styles[key] = replace(base, colour=colour, filled=filled, dashes=dashes)
    return styles


def _lighten(colour: str, share: float) -> str:
    """A colour mixed with white, or with black where the share is negative."""
    target = float(share > 0)
    red, green, blue = (part + abs(share) * (target - part) for part in to_rgb(colour))
    return to_hex((red, green, blue))


def estimate_styles(estimates: Mapping[str, Estimate]) -> dict[str, MethodStyle]:
    """Styles of the methods of some estimates by their labels."""
    return method_styles({label: estimate.method for label, estimate in estimates.items()})


def ordinal_styles(names: Iterable[str]) -> dict[str, MethodStyle]:
    """Styles of series that are no methods, such as values of a parameter: from dark to light."""
    series = list(dict.fromkeys(names))
    pitch = min(2.0, (len(ORDINAL_COLOURS) - 1) / max(1, len(series) - 1))
    styles = {}
    for number, name in enumerate(series):
        colour = ORDINAL_COLOURS[round(number * pitch)]
        styles[name] = MethodStyle(colour, ORDINAL_MARKERS[number % len(ORDINAL_MARKERS)])
    return styles


def label_styles(
    labels: Mapping[str, str], algorithms: Mapping[str, str]
) -> dict[str, MethodStyle]:
    """Styles of the methods of a study by their labels."""
    return method_styles({label: algorithms.get(name, name) for name, label in labels.items()})


class DataFigure(Figure):
    """Figure with the table of the numbers that it draws, which a notebook shows without pyplot.

    `data` is a tidy table with the unit of each number; `save_figure` writes it beside the picture.
    """

    data: pd.DataFrame | None = None
    interactive = ""  # HTML of the same figure with more in it, for the screen

    def _ipython_display_(self) -> None:
        """Make pyplot forget a figure that a notebook shows, which would else show it again at the end of the cell."""
        if "inline" in matplotlib.get_backend():
            import matplotlib.pyplot as plt

            plt.close(self)
        raise NotImplementedError  # the notebook takes the picture

    def _repr_png_(self) -> bytes:
        """Picture for notebooks."""
        return render_figure(self, SCREEN_DOTS_PER_INCH)


def render_figure(figure: Figure, dots_per_inch: float, suffix: str = ".png") -> bytes:
    """Draw a figure as a picture, the same bytes for the same data."""
    stream = BytesIO()
    with matplotlib.rc_context(STYLE):
        figure.savefig(stream, format=suffix[1:], dpi=dots_per_inch, **FILE_OPTIONS[suffix])
    return stream.getvalue()


def save_figure(figure: Figure, stem: str | Path, *, overwrite: bool = False) -> None:
    """Write a figure as PNG and PDF, and the numbers that it draws as CSV: the same bytes for the same data."""
    for suffix in FILE_OPTIONS:
        with atomic_file(f"{stem}{suffix}", overwrite=overwrite) as partial:
            partial.write_bytes(render_figure(figure, DOTS_PER_INCH, suffix))
    data = getattr(figure, "data", None)  # a figure of matplotlib has none
    if data is not None:
        write_csv(data, f"{stem}.csv", overwrite=overwrite)
