"""Figure of the torques of a whole record that zooms and moves, for pages that need no other files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ankleloop.joint.prepared import prepare
from ankleloop.joint.regressors import TORQUES
from ankleloop.pages.rendering import render_template
from ankleloop.plotting.estimates import centre_torques, find_window
from ankleloop.plotting.style import MEASURED, TRUE, MethodStyle, method_styles

if TYPE_CHECKING:
    import xarray as xr

    from ankleloop.joint.estimate import Estimate
    from ankleloop.joint.prepared import PreparedTrial

MOST_SAMPLES = 20_000  # of a line: less than 5 MB in the page
HEIGHT, STRIP = 160, 80  # px of a panel, and of the strip that shows the window in the record
SHORTEST = 0.05  # s of a window
RESIDUAL = 0.45  # opacity of a residual, whose colour is that of the estimate
TRUE_LABEL = "true (simulated)"


@dataclass(frozen=True)
class Line:
    """Torques in the panels of the figure."""

    label: str
    colour: str
    shown: bool
    time: np.ndarray  # [s]
    torques: Mapping[str, np.ndarray]  # values by panel [N·m]
    opacity: float = 1.0


def render_interactive_torques(
    trial: xr.Dataset | PreparedTrial,
    estimates: Mapping[str, Estimate],
    *,
    window: Mapping[str, float],
    shown: Sequence[str] | None = None,
    styles: Mapping[str, MethodStyle] | None = None,
) -> str:
    """Measured and estimated torques of a whole record, which a reader zooms, moves, and switches on and off."""
    styles = styles or method_styles({label: estimate.method for label, estimate in estimates.items()})
    lines = list_lines(prepare(trial), estimates, styles, list(estimates)[:2] if shown is None else shown)
    step = -(-lines[0].time.size // MOST_SAMPLES)
    caption = "Torques of the whole record, less their means. "
    if step > 1:
        caption += f"The record is long: of every {step} samples one is drawn. "
    if all(line.label != TRUE_LABEL for line in lines):
        caption += "The intrinsic and the reflex torque of a recording are not known: the panels show their estimates."
    return render_template("interactive.html.j2", caption=caption, figure=_draw(lines, window, step))


def list_lines(
    trial: PreparedTrial, estimates: Mapping[str, Estimate], styles: Mapping[str, MethodStyle], shown: Sequence[str]
) -> list[Line]:
    """Measured torque, true ones where they are known, estimates, and what they leave of the torques that are known."""
    lines, residuals = [], []
    for label, estimate in estimates.items():
        own, colour = centre_torques(trial, estimate), styles[label].colour
        known = {**own.true, "net": own.measured}
        left = {torque: values - own.estimated[torque] for torque, values in known.items()}
        lines.append(Line(label, colour, label in shown, own.time, own.estimated))
        residuals.append(Line(f"residual of {label}", colour, False, own.time, left, RESIDUAL))
    torques = centre_torques(trial, max(estimates.values(), key=lambda estimate: estimate.torque.sizes["time"]))
    targets = [Line("measured", MEASURED.colour, True, torques.time, {"net": torques.measured})]
    if torques.true:
        targets.append(Line(TRUE_LABEL, TRUE.colour, True, torques.time, torques.true))
    return targets + lines + residuals


def _draw(lines: Sequence[Line], window: Mapping[str, float], step: int) -> Any:
    """Bokeh's description of the figure: panels with one time, a legend that hides, and a strip with the window."""
    from bokeh.embed import json_item  # here: it takes a second, and few jobs need it
    from bokeh.layouts import column, gridplot
    from bokeh.models import CrosshairTool, HoverTool, Range1d, RangeTool, WheelZoomTool
    from bokeh.models.annotations import Legend, LegendItem, Span
    from bokeh.plotting import figure

    times = np.array([lines[0].time[0], max(line.time[-1] for line in lines)])
    start, end = find_window(times, window["start"], window["length"])
    x_range = Range1d(start=start, end=end, bounds=tuple(times), min_interval=SHORTEST)
    cursor = CrosshairTool(overlay=Span(dimension="height", line_color="#888888", line_dash="dotted"))
    tips = [("", "$name"), ("time", "$x{0.000} s"), ("torque", "$y{0.000} N·m")]
    panels = {}
    for torque in TORQUES:
        wheel = WheelZoomTool(dimensions="width", modifiers={"ctrl": True})
        panel = figure(frame_height=HEIGHT, x_range=x_range, tools="xpan,box_zoom,reset,save", active_drag="xpan")
        panel.add_tools(wheel, cursor, HoverTool(tooltips=tips, visible=torque == "net"))
        panel.toolbar.active_scroll, panel.toolbar.active_inspect, panel.toolbar.logo = wheel, cursor, None
        panel.yaxis.axis_label, panel.min_border_left = f"{torque} torque [N·m]", 70
        panels[torque] = panel
    panels["reflex"].xaxis.axis_label = "time [s]"
    items = []
    for line in lines:
        style: dict[str, Any] = {"color": line.colour, "alpha": line.opacity, "visible": line.shown, "name": line.label}
        time = line.time[::step].astype(np.float32)
        drawn: list[Any] = [
            panels[torque].line(time, values[::step].astype(np.float32), **style)
            for torque, values in line.torques.items()
        ]
        items.append(LegendItem(label=line.label, renderers=drawn))
    legend = Legend(items=items, click_policy="hide", location="top_left", ncols=2, label_text_font_size="11px")
    panels["net"].add_layout(legend, "above")
    strip = figure(height=STRIP, x_range=Range1d(*times), tools="", toolbar_location=None, sizing_mode="stretch_width")
    strip.line(lines[0].time[::step], lines[0].torques["net"][::step], color=lines[0].colour)
    strip.add_tools(RangeTool(x_range=x_range))
    strip.yaxis.visible, strip.min_border_left = False, 70
    grid = gridplot([[panel] for panel in panels.values()], sizing_mode="stretch_width", toolbar_location="right")
    return json_item(column(grid, strip, sizing_mode="stretch_width"))
