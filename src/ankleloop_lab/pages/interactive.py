"""Figure of the torques of a whole record that zooms and moves, for pages that need no other files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from ankleloop.joint.estimate import Estimate
from ankleloop.joint.prepared import PreparedTrial, prepare
from ankleloop.joint.regressors import TORQUES
from ankleloop.plotting.estimates import centre_torques, find_window
from ankleloop.plotting.panels import Styles
from ankleloop.plotting.style import MEASURED, TRUE
from ankleloop_lab.pages.rendering import render_template

MOST_SAMPLES = 20_000  # of a line: less than 5 MB in the page
PANEL_HEIGHT = 160  # px
STRIP_HEIGHT = 80  # px of the strip that shows the window in the record
SHORTEST_WINDOW = 0.05  # s
SHOWN_ESTIMATES = 2  # the others are hidden at first
SIZE: dict[str, Any] = {"sizing_mode": "stretch_width", "min_border_left": 70}

# How Bokeh draws a series, and its time [s] and torques [N·m] by the names of their panels.
Series = tuple[dict[str, Any], dict[str, np.ndarray]]


def render_interactive_torques(
    trial: xr.Dataset | PreparedTrial,
    estimates: Mapping[str, Estimate],
    styles: Styles,
    window: Mapping[str, float],
) -> str:
    """Measured and estimated torques of a whole record, which a reader zooms, moves, and switches on and off."""
    series = list_series(prepare(trial), estimates, styles)
    step = -(-series[0][1]["time"].size // MOST_SAMPLES)
    return render_template("interactive.html.j2", step=step, figure=_draw(series, window, step))


def list_series(
    trial: PreparedTrial, estimates: Mapping[str, Estimate], styles: Styles
) -> list[Series]:
    """Measured torque, true ones where they are known, and estimates."""
    longest = max(estimates.values(), key=lambda estimate: estimate.torque.sizes["time"])
    torques = centre_torques(trial, longest)
    measured = {"time": torques.time, "net": torques.measured}
    series: list[Series] = [({"name": "measured", "color": MEASURED.colour}, measured)]
    if torques.true:
        true = {"time": torques.time, **torques.true}
        series.append(({"name": "true (simulated)", "color": TRUE.colour}, true))
    for rank, (label, estimate) in enumerate(estimates.items()):
        own = centre_torques(trial, estimate)
        look = {
            "name": label,
            "color": styles[label].colour,
            "visible": rank < SHOWN_ESTIMATES,
        }
        series.append((look, {"time": own.time, **own.estimated}))
    return series


def _draw(series: list[Series], window: Mapping[str, float], step: int) -> Any:
    """Bokeh's description of the figure: panels with one time, a legend that hides, and a strip with the window."""
    from bokeh.embed import json_item  # here: it takes a second, and few jobs need it
    from bokeh.layouts import column, gridplot
    from bokeh.models import ColumnDataSource, Range1d, RangeTool, WheelZoomTool
    from bokeh.models.annotations import Legend
    from bokeh.plotting import figure

    times = series[0][1]["time"][[0, -1]]
    start, end = find_window(times, window["start"], window["length"])
    x_range = Range1d(start=start, end=end, bounds=tuple(times), min_interval=SHORTEST_WINDOW)
    wheel = WheelZoomTool(dimensions="width", modifiers={"ctrl": True})
    options = {
        "frame_height": PANEL_HEIGHT,
        "x_range": x_range,
        "tools": ["xpan", "box_zoom", "reset", "save", wheel],
        "tooltips": [("", "$name"), ("time", "$x{0.000} s"), ("torque", "$y{0.000} N·m")],
        **SIZE,
        "active_scroll": wheel,
    }
    panels = {
        torque: figure(y_axis_label=f"{torque} torque [N·m]", **options) for torque in TORQUES
    }
    panels["reflex"].xaxis.axis_label = "time [s]"
    strip = figure(
        height=STRIP_HEIGHT,
        x_range=Range1d(*times),
        y_axis_type=None,
        toolbar_location=None,
        tools="",
        **SIZE,
    )
    strip.add_tools(RangeTool(x_range=x_range))
    items: list[Any] = []
    for look, values in series:
        thinned = {name: part[::step].astype("float32") for name, part in values.items()}
        source = ColumnDataSource(thinned)
        lines = []
        for torque in TORQUES:
            if torque in values:
                lines.append(panels[torque].line("time", torque, source=source, **look))
        items.append((look["name"], lines))
        if look["name"] == "measured":
            strip.line("time", "net", source=source, color=look["color"])
    legend = Legend(
        items=items, click_policy="hide", location="top_left", ncols=2, inactive_fill_alpha=0.4
    )
    panels["net"].add_layout(legend, "above")
    grid = gridplot(
        [[panel] for panel in panels.values()],
        sizing_mode="stretch_width",
        toolbar_options={"logo": None},
    )
    return json_item(column(grid, strip, sizing_mode="stretch_width"))
