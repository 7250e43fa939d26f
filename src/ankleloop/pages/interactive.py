"""Figure of the torques of a whole record that zooms and moves, for pages that need no other files."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ankleloop.joint.regressors import TORQUES
from ankleloop.pages.rendering import render_template
from ankleloop.plotting.envelopes import envelope
from ankleloop.plotting.style import STYLE
from ankleloop.plotting.torque_series import TorqueSeries, Trace, limit_values, torque_series
from ankleloop.quantities import QUANTITIES

if TYPE_CHECKING:
    import xarray as xr
    from bokeh.models import Plot, Range1d

    from ankleloop.joint.estimate import Estimate
    from ankleloop.joint.prepared import PreparedTrial
    from ankleloop.plotting.method_styles import MethodStyle

MOST_VALUES = 700_000  # numbers of a figure: less than 4 MB in the page
HEIGHT, STRIP = 190, 70  # px of a panel, and of the strip that shows the window in the record
STRIP_BINS = 900
SHORTEST = 0.05  # s of a window
UNIT = QUANTITIES["torque"].unit
BORDER = 62  # px left of the frames
BIN = ("left", "right", "low", "high")  # edges of a rectangle
GRID_COLOUR = STYLE["grid.color"]
LINE_WIDTH = 1.3
ALPHA = {"residual": 0.45}  # of its colour, which is that of the estimate


def render_interactive_torques(
    trial: xr.Dataset | PreparedTrial,
    estimates: Mapping[str, Estimate],
    *,
    window: Mapping[str, float],
    shown: Sequence[str] | None = None,
    styles: Mapping[str, MethodStyle] | None = None,
) -> str:
    """Measured and estimated torques of a whole record, which a reader zooms, moves, and switches on and off."""
    series = limit_values(torque_series(trial, estimates, styles=styles), MOST_VALUES)
    visible = {"measured", "true (simulated)", *(list(estimates)[:2] if shown is None else shown)}
    record = _find_record(series)
    first = _find_window(record, window)
    return render_template(
        "interactive.html.j2",
        unit=UNIT,
        torques=TORQUES,
        windows={"whole record": record, f"{first[1] - first[0]:g} s": first},
        series=[
            {"label": item.label, "kind": item.kind, "colour": item.colour, "shown": item.label in visible}
            for item in series
        ],
        caption=_describe(series),
        data={
            "torques": TORQUES,
            "figure": _describe_figure(series, record, first),
            "series": [{"traces": [_encode(name, trace) for name, trace in item.traces.items()]} for item in series],
        },
    )


def _find_record(series: Sequence[TorqueSeries]) -> tuple[float, float]:
    """Start and end of the record [s]."""
    traces = [trace for item in series for trace in item.traces.values()]
    ends = [trace.start + trace.step * (trace.low.size - trace.sampled) for trace in traces]
    return min(trace.start for trace in traces), max(ends)


def _find_window(record: tuple[float, float], window: Mapping[str, float]) -> tuple[float, float]:
    """Start and end of what is shown at first [s]; of a short record its last seconds."""
    end = min(window["start"] + window["length"], record[1])
    return max(record[0], end - window["length"]), end


def _describe(series: Sequence[TorqueSeries]) -> str:
    text, measured = "Torques of the whole record, less their means. ", series[0].traces["net"]
    if not measured.sampled:
        text += f"The record is long: least and greatest value in every {measured.step:.3g} s. "
    if all(item.kind != "true" for item in series):
        text += "The intrinsic and the reflex torque of a recording are not known: the panels show their estimates."
    return text.strip()


def _encode(torque: str, trace: Trace) -> dict[str, Any]:
    """A trace for the script of the figure."""
    high = None if trace.sampled else _encode_array(trace.high)
    return {"torque": torque, "start": trace.start, "step": trace.step, "low": _encode_array(trace.low), "high": high}


def _encode_array(values: np.ndarray) -> str:
    return base64.b64encode(values.astype("<f4").tobytes()).decode()


def _describe_figure(
    series: Sequence[TorqueSeries], record: tuple[float, float], window: tuple[float, float]
) -> dict[str, Any]:
    """Bokeh's description of the figure: panels without samples, which the script of the page fills in."""
    from bokeh.embed import json_item  # here: it takes a second, and few jobs need it
    from bokeh.layouts import column, gridplot
    from bokeh.models import Range1d, RangeTool
    from bokeh.models.annotations import Span

    x_range = Range1d(start=window[0], end=window[1], bounds=record, min_interval=SHORTEST)
    cursor = Span(dimension="height", line_color="#888888", line_width=1, line_dash="dotted")
    panels = [_draw_panel(torque, series, x_range, cursor) for torque in TORQUES]
    strip = _draw_strip(series, record)
    strip.add_tools(RangeTool(x_range=x_range))
    grid = gridplot(
        [[panel] for panel in panels],
        sizing_mode="stretch_width",
        toolbar_location="above",
        toolbar_options={"logo": None},
    )
    item = json_item(column(grid, strip, sizing_mode="stretch_width"))
    return _number_models(item)


def _number_models(item: Any) -> Any:
    """Names of models that do not depend on what the process has drawn before."""
    names: dict[str, str] = {}

    def replace_name(match: re.Match[str]) -> str:
        return f'"{names.setdefault(match[1], f"p{1000 + len(names)}")}"'

    return json.loads(re.sub(r'"(p\d+)"', replace_name, json.dumps(item)))


def _draw_panel(torque: str, series: Sequence[TorqueSeries], x_range: Range1d, cursor: Any) -> Plot:
    from bokeh.models import (
        BoxZoomTool,
        ColumnDataSource,
        CrosshairTool,
        Line,
        PanTool,
        Quad,
        ResetTool,
        SaveTool,
        Toolbar,
        WheelZoomTool,
    )

    drag = PanTool(dimensions="width")
    wheel = WheelZoomTool(dimensions="width", modifiers={"ctrl": True})
    tools: list[Any] = [
        drag,
        BoxZoomTool(),
        wheel,
        ResetTool(),
        SaveTool(),
        CrosshairTool(overlay=cursor, dimensions="height"),
    ]
    labels = ("time [s]" if torque == TORQUES[-1] else None, f"{torque} torque [{UNIT}]")
    panel = _new_plot(x_range, _find_limits(torque, series), HEIGHT, labels)
    panel.name = torque
    panel.toolbar = Toolbar(tools=tools, active_drag=drag, active_scroll=wheel)
    for number, item in enumerate(series):
        if torque in item.traces:
            colour, alpha = item.colour, ALPHA.get(item.kind, 1.0)
            line = Line(x="x", y="y", line_color=colour, line_alpha=alpha, line_width=LINE_WIDTH)
            area = Quad(left="left", right="right", bottom="low", top="high", fill_color=colour, fill_alpha=alpha)
            area.line_color = None
            sources = [ColumnDataSource({name: [] for name in names}) for names in (("x", "y"), BIN)]
            panel.add_glyph(sources[0], line, name=f"{torque} {number} line")
            panel.add_glyph(sources[1], area, name=f"{torque} {number} area")
    return panel


def _find_limits(torque: str, series: Sequence[TorqueSeries]) -> tuple[float, float]:
    """Ends of the ordinate of a panel: all traces fit into it."""
    traces = [item.traces[torque] for item in series if torque in item.traces]
    low = min(float(np.nanmin(trace.low)) for trace in traces)
    high = max(float(np.nanmax(trace.high)) for trace in traces)
    margin = 0.05 * (high - low) or 1.0
    return low - margin, high + margin


def _draw_strip(series: Sequence[TorqueSeries], record: tuple[float, float]) -> Plot:
    """The measured torque of the whole record, in which a tool moves the window."""
    from bokeh.models import ColumnDataSource, Range1d, VArea

    trace = series[0].traces["net"]
    width = max(1, -(-trace.low.size // STRIP_BINS))
    low, _ = envelope(trace.low, width)
    _, high = envelope(trace.high, width)
    time = trace.start + (np.arange(low.size) + 0.5) * width * trace.step
    limits = _find_limits("net", series[:1])
    strip = _new_plot(Range1d(start=record[0], end=record[1]), limits, STRIP, None)
    strip.name, strip.toolbar_location = "strip", None
    source = ColumnDataSource({"x": time.astype(np.float32), "low": low, "high": high})
    strip.add_glyph(source, VArea(x="x", y1="low", y2="high", fill_color=series[0].colour))
    return strip


def _new_plot(
    x_range: Range1d, limits: tuple[float, float], height: int, labels: tuple[str | None, str] | None
) -> Plot:
    """A plot whose frame begins where those of the others do; without labels it has no ordinate."""
    from bokeh.models import Grid, LinearAxis, Plot, Range1d

    y_range = Range1d(start=limits[0], end=limits[1])
    plot = Plot(x_range=x_range, y_range=y_range, height=height, sizing_mode="stretch_width")
    plot.min_border_left = BORDER
    below, left = (
        LinearAxis(
            axis_label=label, axis_label_text_font_style="normal", axis_label_text_font_size="12px", visible=visible
        )
        for label, visible in zip(labels or (None, None), (True, labels is not None), strict=True)
    )
    plot.add_layout(below, "below")
    plot.add_layout(left, "left")
    plot.add_layout(Grid(dimension=0, ticker=below.ticker, grid_line_color=GRID_COLOUR))
    plot.add_layout(Grid(dimension=1, ticker=left.ticker, grid_line_color=GRID_COLOUR))
    return plot
