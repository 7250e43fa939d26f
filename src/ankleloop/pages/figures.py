"""Figures inside pages."""

from __future__ import annotations

import base64
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from ankleloop.plotting.style import render_png

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

LARGEST_WIDTH = 980  # px
PIXELS_PER_INCH = 137.5  # of the page: a figure of two columns fills it
DOTS_PER_INCH = 220  # of the picture


@dataclass(frozen=True)
class EmbeddedFigure:
    """A picture that is part of a page."""

    source: str  # the picture as a data URI
    width: int  # width in the page [px]
    interactive: str = ""  # HTML of the same figure with more in it, for the screen; empty where there is none
    data: pd.DataFrame | None = field(default=None, compare=False, repr=False)  # numbers that the figure draws


def embed_figure(figure: Figure) -> EmbeddedFigure:
    """Convert a figure to a picture inside a page."""
    width = min(LARGEST_WIDTH, round(PIXELS_PER_INCH * figure.get_size_inches()[0]))
    source = f"data:image/png;base64,{base64.b64encode(render_png(figure, DOTS_PER_INCH)).decode()}"
    return EmbeddedFigure(source, width, data=getattr(figure, "data", None))
