import matplotlib
import numpy as np
import pandas as pd
import pytest
from matplotlib.text import Text

from ankleloop.plotting.style import STYLE
from ankleloop_workflow.plotting.sweeps import SweepAxis, SweepPanel, maps_figure, value_limits

VAF = SweepPanel("vaf", "reflex VAF [%]", "high")
DIFFERENCE = SweepPanel("vaf", "Δ reflex VAF [points]", "zero")
STIFFNESS = SweepPanel("K", "K [N·m/rad]", None, 150.0)
PANELS = [VAF, DIFFERENCE, STIFFNESS]
GAIN = SweepAxis.of("reflex_gain", "reflex gain [N·m·s/rad]", [5.0, 10.0, 15.0, 20.0])
NOISE = SweepAxis.of("voluntary", "voluntary torque [1]", [0.1, 1.0, 10.0])
SERIES = {"RIV": 95.0, "PR-MOESP": 90.0, "RIV − PR-MOESP": 5.0}
SMALLEST = 6.0  # pt of a letter


def draw(figure):
    """Draw a figure: what cannot be drawn raises here, and letters that nobody can read in print fail."""
    with matplotlib.rc_context(STYLE):
        figure.canvas.draw()
    texts = [text for text in figure.findobj(Text) if text.get_text() and text.get_visible()]
    assert min(text.get_fontsize() for text in texts) >= SMALLEST
    return figure


def rows_of(places, **columns):
    """Rows of all panels and series at some places."""
    rows = [
        {"panel": panel.label, "series": name, "value": level + number, **place}
        for panel in PANELS
        for name, level in SERIES.items()
        if ("−" in name) == (panel is DIFFERENCE)
        for number, place in enumerate(places)
    ]
    table = pd.DataFrame(rows).assign(
        marked=False, failed=False, trials=5, failures=0, warnings=0, **columns
    )
    return table.assign(low=table["value"] - 2, high=table["value"] + 4)


def cells():
    return rows_of([{"x": x, "y": y} for y in NOISE.values for x in GAIN.values])


def panels_of(figure):
    return [axis for axis in figure.axes if axis.get_label() != "<colorbar>" and axis.get_visible()]


def test_maps_have_a_panel_for_each_method_and_quantity_and_difference():
    figure = draw(maps_figure(cells(), (GAIN, NOISE), PANELS))
    panels = panels_of(figure)
    titles = [axis.get_title().replace("\n", " ") for axis in panels]
    assert titles == ["RIV", "PR-MOESP", "RIV − PR-MOESP", "RIV", "PR-MOESP"]
    assert [label.get_text() for label in panels[0].get_yticklabels()] == ["0.1", "1", "10"]
    rows = figure.data.query("quantity == 'reflex VAF' and series == 'PR-MOESP'").sort_values(
        ["y", "x"]
    )
    np.testing.assert_array_equal(panels[1].images[0].get_array().ravel(), rows["value"])
    first, second, difference = (axis.images[0] for axis in panels[:3])
    assert difference.norm.vmin == -difference.norm.vmax
    assert (first.norm.vmin, first.norm.vmax) == (second.norm.vmin, second.norm.vmax)


def test_cells_without_a_mean_are_empty_and_marked_means_have_a_ring():
    table = cells()
    table = table[~((table["x"] == 20.0) & (table["y"] == 10.0))]
    lost = (table["x"] == 5.0) & (table["y"] == 0.1) & (table["series"] == "RIV")
    table.loc[lost, "value"] = np.nan
    table.loc[(table["x"] == 10.0) & (table["y"] == 0.1), "marked"] = True
    figure = draw(maps_figure(table, (GAIN, NOISE), [VAF]))
    first, second = panels_of(figure)
    assert np.isnan(first.images[0].get_array().filled(np.nan)).sum() == 2
    assert np.isnan(second.images[0].get_array().filled(np.nan)).sum() == 1
    for panel in (first, second):
        (ring,) = panel.lines
        np.testing.assert_array_equal(ring.get_xydata(), [[1, 0]])
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["with failures or warnings"]


@pytest.mark.parametrize(
    ("values", "goal", "limits"),
    [
        ([90.0, 95.0, 99.0], "high", (90.0, 99.0)),
        ([90.0, 95.0, 99.0, -1e7], "high", (90.0, 99.0)),
        ([-5.0, 1.0, 1e9], "zero", (-5.0, 1.0)),
        ([140.0, 150.0, np.nan, 160.0], None, (140.0, 160.0)),
        ([*np.linspace(140.0, 160.0, 21), 1e7], None, (140.0, 160.0)),
        ([], "high", (0.0, 1.0)),
        ([3.0, 12.0], "low", (0.0, 12.0)),
        ([0.0, 0.0], "low", (0.0, 1.0)),  # nought has the colour of the lower end
    ],
)
def test_lost_values_do_not_set_the_limits(values, goal, limits):
    assert value_limits(pd.Series(values, dtype=float), goal) == limits
