"""The page that moves during a recording: K, B and G with their bands, the torque, and what there is to say."""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import Mapping
from threading import Thread
from typing import Any

import numpy as np

from ankleloop.live.live_estimate import LiveEstimate
from ankleloop.live.sources import Source
from ankleloop.pages.rendering import ENVIRONMENT, render_template
from ankleloop.plotting.style import MEASURED, METHOD_STYLES
from ankleloop.quantities import QUANTITIES, TRAJECTORIES
from ankleloop.recordings.recommendation import format_with_interval

PERIOD = 500  # ms between two pictures
SHOWN_ROWS = 1200  # of the estimates
TORQUE_SECONDS = 5.0
PANEL: dict[str, Any] = {
    "height": 150,
    "min_border_left": 65,
    "sizing_mode": "stretch_width",
    "toolbar_location": None,
}


class LiveView:
    """What is shown of an estimate during the recording, on a page or in lines."""

    def __init__(self, source: Source, live: LiveEstimate, widths: Mapping[str, float]) -> None:
        self.source = source
        self.live = live
        self.widths = widths
        self._torque = np.zeros(round(TORQUE_SECONDS * source.rate))

    def add_torque(self, torque: np.ndarray) -> None:
        """Add samples [N·m] to the line of the torque."""
        self._torque = np.append(self._torque, torque)[-self._torque.size :]

    def render(self, template: str) -> str:
        """The newest numbers, whether they are narrow enough, and what there is to say, by a template."""
        return render_template(
            template,
            view=self,
            newest=self.live.history.tail(1).to_dict("records"),
            names=TRAJECTORIES,
            quantities=QUANTITIES,
            show=format_with_interval,
        )

    def serve(self) -> str:
        """Serve the page on this machine alone; its address has a token, without which nothing is served."""
        loop = asyncio.new_event_loop()
        Thread(target=loop.run_forever, daemon=True).start()
        return asyncio.run_coroutine_threadsafe(self._serve(), loop).result()

    async def _serve(self) -> str:
        """Begin to serve."""
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
            panel = figure(x_axis_label="time [s]", y_axis_label=QUANTITIES[name].label, **PANEL)
            look: dict[str, Any] = {"source": estimates, "color": METHOD_STYLES["riv"].colour}
            panel.varea("time", f"{name}_low", f"{name}_high", alpha=0.25, **look)
            panel.line("time", name, line_width=2, **look)
            panel.vspan("since", source=changes, line_dash="dashed")
            panels.append(panel)
        panel = figure(
            x_axis_label="time from now [s]", y_axis_label=QUANTITIES["torque"].label, **PANEL
        )
        panel.line("time", "torque", source=torque, color=MEASURED.colour)

        def update() -> None:
            history = self.live.history.drop(columns=["warnings", "failure"]).tail(SHOWN_ROWS)
            numbered = history[history["K"].notna().cummax()]
            estimates.data = dict(numbered.items())
            changes.data = {"since": self.live.change["since"].dropna()}
            seconds = np.linspace(-TORQUE_SECONDS, 0.0, self._torque.size)
            torque.data = {"time": seconds, "torque": self._torque}
            text.text = self.render("live_text.html.j2")

        update()
        document.title = self.source.path.name
        document.template = ENVIRONMENT.get_template("live.html.j2")
        document.add_root(column(text, *panels, panel, sizing_mode="stretch_width"))
        document.add_periodic_callback(update, PERIOD)
