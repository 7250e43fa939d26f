"""Figure of the torques of a whole record that zooms and moves, for pages that need no other files."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ankleloop.joint.prepared import prepare
from ankleloop.joint.regressors import TORQUES
from ankleloop.pages.rendering import render_template
from ankleloop.plotting.style import MEASURED, TRUE, MethodStyle, method_styles
from ankleloop.plotting.torques import centre_torques, find_window

if TYPE_CHECKING:
    import xarray as xr

    from ankleloop.joint.estimate import Estimate
    from ankleloop.joint.prepared import PreparedTrial

MOST_VALUES = 700_000  # numbers of a figure: less than 4 MB in the page
HEIGHT, STRIP = 160, 80  # px of a panel, and of the strip that shows the window in the record
SHORTEST = 0.05  # s of a window
RESIDUAL = 0.45  # opacity of a residual, whose colour is that of the estimate

Line = tuple[str, str, float, bool, np.ndarray, dict[str, np.ndarray]]  # label, colour, opacity, shown, time, torques


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
    size = sum(time.size * (1 + len(torques)) for *_, time, torques in lines)
    width = -(-2 * size // MOST_VALUES) if size > MOST_VALUES else 1
    caption = "Torques of the whole record, less their means. "
    if width > 1:
        step = width * float(np.diff(lines[0][4][:2])[0])
        caption += f"The record is long: least and greatest value in every {step:.3g} s. "
    if all(label != "true (simulated)" for label, *_ in lines):
        caption += "The intrinsic and the reflex torque of a recording are not known: the panels show their estimates."
    return render_template("interactive.html.j2", caption=caption, figure=_draw(lines, window, width))


def list_lines(
    trial: PreparedTrial, estimates: Mapping[str, Estimate], styles: Mapping[str, MethodStyle], shown: Sequence[str]
) -> list[Line]:
    """Measured torque, true ones where they are known, estimates, and what they leave of the torques that are known."""
    longest = max(estimates.values(), key=lambda estimate: estimate.torque.sizes["time"])
    torques = centre_torques(trial, longest)
    lines: list[Line] = [("measured", MEASURED.colour, 1.0, True, torques.time, {"net": torques.measured})]
    if torques.true:
        lines.append(("true (simulated)", TRUE.colour, 1.0, True, torques.time, dict(torques.true)))
    residuals: list[Line] = []
    for label, estimate in estimates.items():
        own = centre_torques(trial, estimate)
        known = {**own.true, "net": own.measured}
        left = {torque: known[torque] - own.estimated[torque] for torque in TORQUES if torque in known}
        lines.append((label, styles[label].colour, 1.0, label in shown, own.time, dict(own.estimated)))
        residuals.append((f"residual of {label}", styles[label].colour, RESIDUAL, False, own.time, left))
    return lines + residuals


def thin(values: np.ndarray, width: int) -> np.ndarray:
    """Least and greatest value of each bin of samples one after the other, in which no peak is lost."""
    if width == 1:
        return values.astype(np.float32)
    starts = np.arange(0, values.size, width)
    ends = [np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)]
    return np.stack(ends, axis=1).ravel().astype(np.float32)


def _draw(lines: Sequence[Line], window: Mapping[str, float], width: int) -> Any:
    """Bokeh's description of the figure: panels with one time, a legend that hides, and a strip with the window."""
    from bokeh.embed import json_item  # here: it takes a second, and few jobs need it
    from bokeh.layouts import column, gridplot
    from bokeh.models import CrosshairTool, HoverTool, Range1d, RangeTool, WheelZoomTool
    from bokeh.models.annotations import Legend, LegendItem, Span
    from bokeh.plotting import figure

    times = [lines[0][4][0], max(time[-1] for *_, time, _ in lines)]
    start, end = find_window(np.array(times), window["start"], window["length"])
    x_range = Range1d(start=start, end=end, bounds=tuple(times), min_interval=SHORTEST)
    cursor = CrosshairTool(overlay=Span(dimension="height", line_color="#888888", line_dash="dotted"))
    tips = [("", "$name"), ("time", "$x{0.000} s"), ("torque", "$y{0.000} N·m")]
    panels = {}
    for torque in TORQUES:
        wheel = WheelZoomTool(dimensions="width", modifiers={"ctrl": True})
        panel = figure(frame_height=HEIGHT, x_range=x_range, tools="xpan,box_zoom,reset,save", active_drag="xpan")
        panel.add_tools(wheel, cursor, HoverTool(tooltips=tips, visible=torque == "net"))
        panel.toolbar.active_scroll, panel.toolbar.active_inspect = wheel, cursor
        panel.yaxis.axis_label, panel.min_border_left = f"{torque} torque [N·m]", 70
        panel.toolbar.logo = None
        panels[torque] = panel
    panels["reflex"].xaxis.axis_label = "time [s]"
    items = []
    for label, colour, alpha, shown, time, torques in lines:
        places = time.astype(np.float32) if width == 1 else np.repeat(time[::width], 2).astype(np.float32)
        style: dict[str, Any] = {"color": colour, "alpha": alpha, "visible": shown, "name": label}
        ordinates = {torque: thin(values, width) for torque, values in torques.items()}
        drawn: list[Any] = [panels[torque].line(places, ordinate, **style) for torque, ordinate in ordinates.items()]
        items.append(LegendItem(label=label, renderers=drawn))
    legend = Legend(items=items, click_policy="hide", location="top_left", ncols=2, label_text_font_size="11px")
    panels["net"].add_layout(legend, "above")
    strip = figure(height=STRIP, x_range=Range1d(*times), tools="", toolbar_location=None, sizing_mode="stretch_width")
    strip.line(lines[0][4][::width], lines[0][5]["net"][::width], color=lines[0][1])
    strip.add_tools(RangeTool(x_range=x_range))
    strip.yaxis.visible, strip.min_border_left = False, 70
    rows: list[list[Any]] = [[panel] for panel in panels.values()]
    grid = gridplot(rows, sizing_mode="stretch_width", toolbar_location="right")
    item = json_item(column(grid, strip, sizing_mode="stretch_width"))
    # Names of models that do not depend on what the process has drawn before.
    names: dict[str, str] = {}
    return json.loads(
        re.sub(r'"(p\d+)"', lambda name: f'"{names.setdefault(name[1], f"p{1000 + len(names)}")}"', json.dumps(item))
    )
