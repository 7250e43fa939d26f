"""The page that moves during a recording: K, B and G with their bands, the torque, and what there is to say."""

from __future__ import annotations

import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from threading import Thread
from typing import Any

from ankleloop.plotting.style import MEASURED
from ankleloop.quantities import QUANTITIES, TRAJECTORIES
from ankleloop_lab.live.live_estimate import LiveEstimate
from ankleloop_lab.live.sources import Source
from ankleloop_lab.pages.rendering import ENVIRONMENT, render_template
from ankleloop_lab.recordings.recommendation import format_with_interval

PERIOD = 500  # ms between two pictures
WIDTH = 0.5  # s of an estimate: there is one each half second
SHOWN_ROWS = 1200  # of the estimates
SHOWN_SAMPLES = 5000  # of the torque
PANEL: dict[str, Any] = {
    "x_axis_label": "time [s]",
    "height": 150,
    "min_border_left": 65,
    "sizing_mode": "stretch_width",
    "toolbar_location": None,
}


@dataclass
class LiveView:
    """What is shown of an estimate during the recording, on a page or in lines."""

    source: Source
    live: LiveEstimate
    widths: Mapping[str, float]  # half-widths that are enough, over the values

    def render(self, template: str) -> str:
        """The newest numbers, whether they are narrow enough, and what there is to say, by a template."""
        return render_template(
            template,
            view=self,
            names=TRAJECTORIES,
            quantities=QUANTITIES,
            show=format_with_interval,
        )

    def serve(self) -> str:
        """Serve the page on this machine alone; its address has a token, without which nothing is served."""
        from bokeh.server.server import Server  # here: it takes a second

        token = secrets.token_urlsafe(16)
        server = Server(
            {"/": self._build},
            address="127.0.0.1",
            port=0,
            prefix=token,
            use_index=False,
            redirect_root=False,
        )
        server.start()
        Thread(target=server.io_loop.start, daemon=True).start()
        return f"http://localhost:{server.port}/{token}/"

    def _build(self, document: Any) -> None:
        """Fill the document of a browser, which then is kept up to date."""
        from bokeh.layouts import column
        from bokeh.models import ColumnDataSource
        from bokeh.models.widgets import Div
        from bokeh.plotting import figure

        text = Div(sizing_mode="stretch_width")
        estimates = ColumnDataSource()
        changes = ColumnDataSource()
        torque = ColumnDataSource()
        panels = []
        for name in TRAJECTORIES:
            panel = figure(y_axis_label=QUANTITIES[name].label, **PANEL)
            # Bars, because an area would go on where there is no estimate.
            panel.vbar(
                "time",
                WIDTH,
                f"{name}_high",
                f"{name}_low",
                source=estimates,
                alpha=0.25,
                line_color=None,
            )
            panel.line("time", name, source=estimates, line_width=2)
            panel.vspan("since", source=changes, line_dash="dashed")
            panels.append(panel)
        panel = figure(y_axis_label=QUANTITIES["torque"].label, **PANEL)
        panel.line("time", "torque", source=torque, color=MEASURED.colour)

        def update() -> None:
            estimates.data = dict(self.live.history.tail(SHOWN_ROWS))
            changes.data = dict(self.live.change)
            times, _, torques, _ = self.live.samples[-SHOWN_SAMPLES:].T
            torque.data = {"time": times, "torque": torques}
            text.text = self.render("live_text.html.j2")

        update()
        document.template = ENVIRONMENT.get_template("live.html.j2")
        document.add_root(column(text, *panels, panel, sizing_mode="stretch_width"))
        document.add_periodic_callback(update, PERIOD)
