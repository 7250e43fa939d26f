"""Marks of means that leave out trials that failed, or hold estimates with a warning."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.transforms import Transform
from numpy.typing import ArrayLike

from ankleloop.plotting.style import ALL_FAILED, FAULT_RING

if TYPE_CHECKING:
    import pandas as pd


def draw_rings(axis: Axes, x: ArrayLike, y: ArrayLike) -> None:
    """Draw rings around symbols of means with failures or warnings.

    Shapes: x, y (N,).
    """
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    shown = np.isfinite(x) & np.isfinite(y)
    if shown.any():
        axis.plot(x[shown], y[shown], **FAULT_RING)


def draw_crosses(axis: Axes, x: ArrayLike, y: ArrayLike, colour: str, transform: Transform) -> None:
    """Draw crosses at an edge of a panel, where every trial failed.

    Shapes: x, y (N,).
    """
    x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
    if x.size:
        mark: dict[str, Any] = {"marker": "x", "ms": 4.5, "ls": "", "color": colour, "zorder": 4, "clip_on": False}
        axis.plot(x, y, transform=transform, label=ALL_FAILED, **mark)


def mark_means(axis: Axes, rows: pd.DataFrame, values: ArrayLike, heights: Sequence[float], colour: str) -> None:
    """Draw rings around means with failures or warnings, and crosses at the left edge where every trial failed.

    Shapes: values (N,).
    """
    places = np.array(heights)
    if "fault" in rows:
        fault = rows["fault"].to_numpy()
        draw_rings(axis, np.asarray(values)[fault], places[fault])
    if "failed" in rows:
        draw_crosses(axis, 0.02, places[rows["failed"].to_numpy()], colour, axis.get_yaxis_transform())
