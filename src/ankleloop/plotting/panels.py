"""Panels of a figure in rows, with shared axes where they show the same quantity."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import pandas as pd
from matplotlib.axes import Axes

from ankleloop.plotting.style import TWO_COLUMNS, DataFigure, inches

__all__ = ["Panel", "panel_grid", "share_ordinates", "split_label", "tabulate_lines"]


@dataclass(frozen=True)
class Panel:
    """What a panel shows.

    Parameters
    ----------
    label : str
        Quantity with its unit; panels with the same label share its axis.
    title : str
        What tells panels of the same quantity apart.
    truth : float or None
        True value, which is drawn as a line.
    limits : tuple of float or None
        Limits of the axis of the quantity.

    Examples
    --------
    >>> Panel("K [N·m/rad]", "closed loop", truth=150.0).label
    'K [N·m/rad]'
    """

    label: str
    title: str = ""
    truth: float | None = None
    limits: tuple[float, float] | None = None


def split_label(label: str) -> tuple[str, str]:
    """Split the label of an axis into the quantity and its unit.

    Parameters
    ----------
    label : str
        Label of an axis.

    Returns
    -------
    quantity, unit : str
        The unit is empty where the label has none.

    Examples
    --------
    >>> split_label("K [N·m/rad]"), split_label("basis")
    (('K', 'N·m/rad'), ('basis', ''))
    """
    quantity, bracket, unit = label.replace("\n", " ").rpartition(" [")
    return (quantity, unit.rstrip("]")) if bracket else (label, "")


def panel_grid(
    count: int,
    columns: int,
    height: float,
    *,
    width: float = TWO_COLUMNS,
    sharex: bool = False,
    sharey: bool = False,
) -> tuple[DataFigure, list[Axes]]:
    """Make a figure with panels in rows, and leave the rest of the last row empty.

    Parameters
    ----------
    count : int
        Number of panels.
    columns : int
        Panels side by side, at most.
    height : float
        Height of a row of panels with its labels [mm].
    width : float
        Width of the figure [mm].
    sharex, sharey : bool
        Whether the panels share their abscissae, their ordinates.

    Returns
    -------
    figure : DataFigure
    axes : list of matplotlib.axes.Axes
        Axes of the panels, without those that are empty.

    Examples
    --------
    >>> figure, axes = panel_grid(4, 3, 50.8)
    >>> figure.get_size_inches().round(2).tolist(), len(axes)
    ([7.13, 4.0], 4)
    """
    columns = min(columns, count)
    rows = -(-count // columns)
    figure = DataFigure(figsize=(inches(width), inches(height * rows)), layout="constrained")
    axes = list(figure.subplots(rows, columns, squeeze=False, sharex=sharex, sharey=sharey).ravel())
    for axis in axes[count:]:
        axis.set_visible(False)
    for axis in axes[count - columns : count]:  # the panel below it may be empty
        axis.tick_params(labelbottom=True)
    return figure, axes[:count]


def share_ordinates(axes: Sequence[Axes], panels: Sequence[Panel], columns: int) -> None:
    """Give panels of the same quantity one ordinate, with its label at the first of them in a row.

    Parameters
    ----------
    axes : sequence of matplotlib.axes.Axes
        Empty panels, row by row.
    panels : sequence of Panel
        What they show.
    columns : int
        Panels in a row.

    Examples
    --------
    >>> figure, axes = panel_grid(2, 2, 40.0)
    >>> share_ordinates(axes, [Panel("VAF [%]", "net torque"), Panel("VAF [%]", "reflex torque")], 2)
    >>> [axis.get_ylabel() for axis in axes]
    ['VAF [%]', '']
    """
    first: dict[str, Axes] = {}
    for number, (axis, panel) in enumerate(zip(axes, panels, strict=True)):
        if panel.label in first:
            axis.sharey(first[panel.label])
        first.setdefault(panel.label, axis)
        if number % columns and panels[number - 1].label == panel.label:
            axis.tick_params(labelleft=False)
        else:
            axis.set_ylabel(panel.label)
        axis.set_title(panel.title)


def tabulate_lines(axes: Iterable[Axes]) -> pd.DataFrame:
    """Numbers of all lines of some panels that have a label.

    Parameters
    ----------
    axes : iterable of matplotlib.axes.Axes
        Panels whose axes have labels with units.

    Returns
    -------
    pandas.DataFrame
        Columns `quantity`, `unit`, `series`, `x_quantity`, `x_unit`, `x` and `value`.

    Examples
    --------
    >>> figure, (axis,) = panel_grid(1, 1, 40.0)
    >>> _ = axis.set(xlabel="time [s]", ylabel="torque [N·m]")
    >>> _ = axis.plot([0.0, 1.0], [2.0, 3.0], label="measured")
    >>> tabulate_lines([axis]).values.tolist()[0]
    ['torque', 'N·m', 'measured', 'time', 's', 0.0, 2.0]
    """
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
