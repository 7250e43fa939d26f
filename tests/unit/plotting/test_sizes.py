"""Every figure has the width of one or two columns, and letters that can be read in print."""

from dataclasses import replace
from types import SimpleNamespace

import matplotlib
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from matplotlib.text import Text

from ankleloop.plotting.estimates import mean_trajectories_figure, trajectories_figure
from ankleloop.plotting.panels import Panel, estimates_figure
from ankleloop.plotting.recordings import recordings_figure, residual_figure, spectra_figure
from ankleloop.plotting.studies import curves_figure, order_figure, ratio_figure, traces_figure
from ankleloop.plotting.style import METHOD_STYLES, ONE_COLUMN, STYLE, TWO_COLUMNS, ordinal_styles
from ankleloop.plotting.sweeps import SweepAxis, SweepPanel, lines_figure, maps_figure

SMALLEST = 6.0  # pt
RIV = METHOD_STYLES["riv"]
TRUTHS = {"p": ("K [N·m/rad]", 1.0)}
METHODS = [f"a method with a name of some length, variant {number}" for number in range(5)]
LINE = np.linspace(0.1, 1.0, 20)
AXIS = SweepAxis.of("voluntary", "relative voluntary torque [1]", [0.1, 0.2, 0.4, 0.8])
SWEEP = [
    SweepPanel("vaf", "reflex VAF, true [%]", "high"),
    SweepPanel("vaf", "Δ VAF, true [points]", "zero"),
]


def trials(**columns):
    rows = [
        {"series": name, "x": x, "value": 90.0 + x, "low": 89.0, "high": 95.0, **columns}
        for name in METHODS
        for x in (1.0, 2.0)
    ]
    return pd.DataFrame(rows)


def means():
    table = pd.DataFrame([{"x": x, "y": y, "setting": x} for x in AXIS.values for y in AXIS.values])
    parts = [
        table.assign(panel=panel.label, series=name) for panel in SWEEP for name in METHODS[:2]
    ]
    values = {"value": 90.0, "low": 80.0, "high": 95.0, "marked": True, "failed": False}
    return pd.concat(parts).assign(**values, parameter="voluntary")


def rows_of(**columns):
    return pd.DataFrame({"row": ["K", "B"], "series": METHODS[:2], "panel": "p", **columns})


def residuals():
    test = SimpleNamespace(frequency=LINE, density=LINE, lags=LINE, correlation=LINE, limit=0.1)
    return dict.fromkeys(METHODS, test)


def group():
    table = pd.DataFrame(
        {"label": METHODS, "subject": "S1", "condition": "rest", "K": 100.0, "trusted": True}
    )
    return recordings_figure(table.assign(recording="a recording with a long name"), ["K"])


def changing():
    names = [f"{name}{end}" for name in "KBG" for end in ("", "_low", "_high")]
    curves = xr.Dataset(dict.fromkeys(names, ("phase", LINE)), coords={"phase": LINE})
    estimate = SimpleNamespace(
        method="riv-tv", trajectories=curves, diagnostics={"excitation": dict.fromkeys("KBG", LINE)}
    )
    return trajectories_figure(dict.fromkeys(METHODS[:3], estimate))


def mean_trajectories():
    table = pd.DataFrame(
        {"place": LINE, "truth": 1.0, "mean": LINE, "low": LINE, "high": LINE, "n": 3}
    )
    rows = [
        table.assign(
            parameter=name, series=series, row="a setting of some length", dimension="phase"
        )
        for name in "KBG"
        for series in METHODS
    ]
    return mean_trajectories_figure(pd.concat(rows), styles=ordinal_styles(METHODS))


FIGURES = {
    "curves": lambda: curves_figure(
        trials(panel="p"), {"p": Panel("VAF [%]", "net torque")}, xlabel="gain [1]"
    ),
    "curves in two rows": lambda: curves_figure(
        trials(panel="p"),
        {"p": Panel("VAF [%]")} | {"q": Panel("VAF [%]")},
        xlabel="gain [1]",
        above=92.0,
    ),
    "estimates": lambda: estimates_figure(
        rows_of(value=1.0, margin=0.1), {"p": Panel("K [N·m/rad]")}
    ),
    "ratios": lambda: ratio_figure(rows_of(ratio=2.0), limit=1.5),
    "traces": lambda: traces_figure({"open loop": {"time": LINE, "p": LINE}}, TRUTHS, 0.0, RIV),
    "orders": lambda: order_figure(
        {name: [LINE[::-1]] for name in METHODS}, order=2, styles=ordinal_styles(METHODS)
    ),
    "spectra": lambda: spectra_figure(
        dict.fromkeys(("frequency", "position", "torque", "coherence"), LINE)
    ),
    "residuals": lambda: residual_figure(residuals()),
    "group": group,
    "lines": lambda: lines_figure(means(), [AXIS], SWEEP, ordinal_styles(METHODS)),
    "effects": lambda: lines_figure(
        means(), [AXIS, replace(AXIS, name="noise")], SWEEP, ordinal_styles(METHODS)
    ),
    "maps": lambda: maps_figure(means(), (AXIS, replace(AXIS, label="noise [1]")), SWEEP),
    "trajectories": changing,
    "mean trajectories": mean_trajectories,
}


@pytest.mark.parametrize("name", FIGURES)
def test_figures_have_the_width_of_columns_letters_that_can_be_read_and_a_table_with_units(name):
    figure = FIGURES[name]()
    with matplotlib.rc_context(STYLE):
        figure.canvas.draw()
    assert any(
        25.4 * figure.get_figwidth() == pytest.approx(width) for width in (ONE_COLUMN, TWO_COLUMNS)
    )
    texts = [text for text in figure.findobj(Text) if text.get_text() and text.get_visible()]
    assert min(text.get_fontsize() for text in texts) >= SMALLEST
    assert len(figure.data) > 0
    assert figure.data.columns.is_unique
    assert (figure.data["unit"] != "").all()
