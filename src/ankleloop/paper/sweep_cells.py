"""Means over the cells of a map of two parameters of a sweep."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from ankleloop.paper.sweep_summary import summarise_sweep
from ankleloop.plotting.sweep_axes import SweepAxis

MOST_POINTS = 300  # of an irregular design that are drawn one by one; more are drawn in tiles
MOST_SLICES = 4  # combinations of other parameters that have panels of their own
POINTS_PER_TILE = 4
TILES = (5, 25)  # in either direction, at least and at most

Edges = tuple[np.ndarray, np.ndarray]


def summarise_cells(
    trials: pd.DataFrame,
    axes: tuple[SweepAxis, SweepAxis],
    quantities: Sequence[str],
    slices: Mapping[str, str] | None = None,
) -> tuple[pd.DataFrame, Edges | None]:
    """Means over all trials of each cell: a combination of two values of a grid, or a tile of an irregular design."""
    x, y = axes
    combinations = len(trials[[x.name, y.name]].drop_duplicates())
    is_grid = 2 * combinations >= len(x.values) * len(y.values)
    edges: Edges | None = None
    if is_grid or combinations <= MOST_POINTS:
        places = [axis.places(trials[axis.name]) for axis in axes]
        edges = (x.edges(), y.edges()) if is_grid else None
    else:
        count = int(np.clip(np.sqrt(combinations / POINTS_PER_TILE), *TILES))
        places, lines = zip(*(axis.bin(trials[axis.name], count) for axis in axes), strict=True)
        edges = lines[0], lines[1]
    table = trials.assign(x=places[0], y=places[1], slice=trials["point"].map(slices) if slices else "")
    return summarise_sweep(table, ["x", "y", "slice", "method"], quantities), edges


def list_slices(trials: pd.DataFrame, others: Sequence[SweepAxis]) -> dict[str, str]:
    """Slice of each point: the values of the parameters that are not axes of the map, where there are few of them."""
    if not others:
        return {}
    points = trials.drop_duplicates("point")
    words = [_describe_values(row, others) for _, row in points.iterrows()]
    if not 1 < len(set(words)) <= MOST_SLICES:
        return {}
    return dict(zip(points["point"], words, strict=True))


def _describe_values(row: pd.Series, axes: Sequence[SweepAxis]) -> str:
    return ", ".join(axis.describe(row[axis.name]) for axis in axes)
