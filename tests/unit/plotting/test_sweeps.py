import itertools
from dataclasses import replace

import matplotlib
import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex

from ankleloop.plotting.method_styles import METHOD_STYLES
from ankleloop.plotting.style import FAULT_RING, STYLE
from ankleloop.plotting.sweep_axes import SweepAxis
from ankleloop.plotting.sweep_maps import NO_POINT, NO_VALUE, maps_figure
from ankleloop.plotting.sweeps import SweepPanel, SweepSeries, lines_figure, mark_rows, value_limits

SERIES = [
    SweepSeries("riv", "RIV", METHOD_STYLES["riv"]),
    SweepSeries("moesp", "PR-MOESP", METHOD_STYLES["pr-moesp"]),
]
DIFFERENCE = SweepSeries("riv − moesp", "RIV − PR-MOESP", is_difference=True)
VAF = SweepPanel("vaf", "reflex VAF [%]", SERIES, "high")
VAF_DIFFERENCE = SweepPanel("vaf", "Δ reflex VAF [points]", [DIFFERENCE], "zero")
STIFFNESS = SweepPanel("K", "K [N·m/rad]", SERIES, None, 150.0)
STIFFNESS_DIFFERENCE = SweepPanel("K", "Δ K [N·m/rad]", [DIFFERENCE], "zero")
FAILURES = SweepPanel("failures", "failed trials [%]", SERIES, "low", None, False)
PANELS = [VAF, VAF_DIFFERENCE, STIFFNESS, STIFFNESS_DIFFERENCE, FAILURES]
GAIN = SweepAxis.of("reflex_gain", "reflex gain [N·m·s/rad]", [5.0, 10.0, 15.0, 20.0])
NOISE = SweepAxis.of("voluntary", "voluntary torque [1]", [0.1, 1.0, 10.0])
METHODS = {"riv": 0.0, "moesp": -5.0, "riv − moesp": 5.0}


def draw(figure):
    """Draw a figure: what cannot be drawn raises here."""
    with matplotlib.rc_context(STYLE):
        figure.canvas.draw()
    return figure


def rows_of(places, **columns):
    """Rows of all methods and quantities at some places."""
    rows = []
    for method, offset in METHODS.items():
        for quantity, level in (("vaf", 95.0), ("K", 150.0), ("failures", 0.0)):
            if quantity == "failures" and "−" in method:
                continue
            for number, place in enumerate(places):
                mean = (0.0 if "−" in method else level) + offset + number
                row = {"method": method, "quantity": quantity, "mean": mean, "margin": 1.0, "low": mean - 3}
                rows.append({**row, "high": mean + 3, "trials": 5, "failures": 0, "warnings": 0, **place})
    return pd.DataFrame(rows).assign(**columns)


def effects(axis):
    return rows_of([{"place": place} for place in axis.places(axis.values)], parameter=axis.name)


def cells():
    return rows_of([{"x": x, "y": y} for y in NOISE.values for x in GAIN.values], slice="")


EDGES = (GAIN.edges(), NOISE.edges())


def panels_of(figure):
    return [axis for axis in figure.axes if axis.get_label() != "<colorbar>" and axis.get_visible()]


def bars_of(figure):
    return [axis for axis in figure.axes if axis.get_label() == "<colorbar>"]


def test_lines_have_a_panel_for_each_quantity_and_each_difference():
    figure = draw(lines_figure(effects(GAIN), GAIN, PANELS))
    labels = [axis.get_ylabel().replace("\n", " ") for axis in panels_of(figure)]
    assert labels == [
        "reflex VAF [%]",
        "Δ reflex VAF [points]",
        "K [N·m/rad]",
        "Δ K [N·m/rad]",
        "failed trials [%]",
    ]
    assert panels_of(figure)[-1].get_xlabel().replace("\n", " ") == "reflex gain [N·m·s/rad]"


def test_lines_are_the_means_and_bands_their_intervals_or_the_trials():
    for band, half in (("mean", 1.0), ("trials", 3.0)):
        figure = draw(lines_figure(effects(GAIN), GAIN, [VAF], band=band))
        axis = panels_of(figure)[0]
        line = next(line for line in axis.get_lines() if line.get_label() == "RIV")
        np.testing.assert_array_equal(line.get_xydata(), [(5, 95), (10, 96), (15, 97), (20, 98)])
        edges = axis.collections[0].get_paths()[0].vertices
        at_ten = edges[edges[:, 0] == 10.0][:, 1]
        assert (at_ten.min(), at_ten.max()) == (96 - half, 96 + half)


def test_marks_stand_where_trials_failed_or_warned():
    table = effects(GAIN)
    first = (table["place"] == 5.0) & (table["method"] == "riv")
    table.loc[first, "warnings"] = 1
    last = (table["place"] == 20.0) & (table["method"] == "moesp")
    table.loc[last, ["mean", "margin", "low", "high"]] = np.nan
    table.loc[last, "failures"] = 5
    axis = panels_of(draw(lines_figure(table, GAIN, [VAF])))[0]
    lines = {line.get_label(): line for line in axis.get_lines()}
    np.testing.assert_array_equal(lines[FAULT_RING["label"]].get_xydata(), [(5.0, 95.0)])
    assert lines["every trial failed"].get_xdata().tolist() == [20.0]


def test_only_a_relevant_share_of_faults_is_marked():
    rows = pd.DataFrame({"trials": [100, 100, 20, 5, 5], "failures": [4, 5, 0, 5, 0], "warnings": [0, 0, 1, 0, 0]})
    marked, failed = mark_rows(rows)
    assert marked.tolist() == [False, True, True, False, False]
    assert failed.tolist() == [False, False, False, True, False]


def test_maps_have_a_panel_for_each_method_and_quantity_and_difference():
    figure = draw(maps_figure(cells(), (GAIN, NOISE), EDGES, PANELS))
    titles = [axis.get_title() for axis in panels_of(figure)]
    assert titles == ["RIV", "PR-MOESP", "RIV − PR-MOESP"] * 2 + ["RIV", "PR-MOESP"]
    labels = [axis.get_ylabel().replace("\n", " ") for axis in bars_of(figure)]
    expected = ["reflex VAF [%]", "Δ reflex VAF [points]", "K [N·m/rad]", "Δ K [N·m/rad]"]
    assert labels == [*expected, "failed trials [%]"]
    panels = panels_of(figure)
    below = [axis.get_xlabel().replace("\n", " ") for axis in panels]
    beside = [axis.get_ylabel().replace("\n", " ") for axis in panels]
    assert below == [""] * 5 + [GAIN.label] * 3  # below the last panel of each column
    assert beside == [NOISE.label, "", ""] * 2 + [NOISE.label, ""]
    assert {axis.get_yscale() for axis in panels} == {"log"}


def test_tables_of_sweeps_have_what_is_drawn():
    figure = draw(maps_figure(cells(), (GAIN, NOISE), EDGES, PANELS))
    rows = figure.data.query("quantity == 'reflex VAF' and method == 'PR-MOESP'").sort_values([NOISE.label, GAIN.label])
    mesh = panels_of(figure)[1].collections[0]
    np.testing.assert_array_equal(mesh.get_array().ravel(), rows["mean"])
    assert set(figure.data["unit"]) == {"%", "points", "N·m/rad"}
    figure = draw(lines_figure(effects(GAIN), GAIN, [VAF]))
    rows = figure.data.query("method == 'RIV'")
    line = next(line for line in panels_of(figure)[0].get_lines() if line.get_label() == "RIV")
    np.testing.assert_array_equal(line.get_xydata(), rows[["value of the parameter", "mean"]].astype(float))


def test_colours_of_differences_are_centred_at_zero():
    figure = draw(maps_figure(cells(), (GAIN, NOISE), EDGES, [VAF, VAF_DIFFERENCE]))
    mesh = panels_of(figure)[2].collections[0]
    assert mesh.norm.vmin == -mesh.norm.vmax
    assert mesh.get_cmap().name == "RdBu"
    shared = {id(axis.collections[0].norm) for axis in panels_of(figure)[:2]}
    assert len(shared) == 1


def test_cells_without_a_value_are_hatched_and_those_without_a_point_are_grey():
    table = cells()
    table = table[~((table["x"] == 20.0) & (table["y"] == 10.0))]
    hit = (table["x"] == 5.0) & (table["y"] == 0.1) & (table["method"] == "riv")
    table.loc[hit, "mean"] = np.nan
    table.loc[hit, "failures"] = 5
    figure = draw(maps_figure(table, (GAIN, NOISE), EDGES, [VAF]))
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [NO_POINT, NO_VALUE, "every trial failed"]
    first, second = panels_of(figure)
    assert np.isnan(first.collections[0].get_array().filled(np.nan)).sum() == 2
    assert first.collections[1].get_hatch() == "////"
    assert [to_hex(colour) for colour in first.collections[1].get_facecolor()] == ["#f4f4f4"]
    assert len(second.collections) == 1


@pytest.mark.parametrize(
    ("values", "goal", "limits"),
    [
        ([90.0, 95.0, 99.0], "high", (90.0, 99.0)),
        ([90.0, 95.0, 99.0, -1e7], "high", (90.0, 99.0)),
        ([-5.0, 1.0, 1e9], "zero", (-5.0, 1.0)),
        ([140.0, 150.0, np.nan, 160.0], None, (140.0, 160.0)),
        ([], "high", (0.0, 1.0)),
        ([3.0, 12.0], "low", (0.0, 12.0)),
    ],
)
def test_lost_values_do_not_set_the_limits(values, goal, limits):
    assert value_limits(np.array(values), goal) == limits


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        ([1.0, 2.0, 3.0], "linear"),
        ([0.0, 0.25, 0.5, 1.0], "linear"),
        ([1.0, 2.0, 5.0, 10.0], "log"),
        ([10.0, 100.0, 1000.0], "log"),
        ([0.0, 0.1, 1.0, 10.0], "listed"),
        ([10.0, None, 20.0], "listed"),
        ([True, False], "listed"),
        (["a", "b"], "listed"),
        ([1.0, 10.0], "linear"),
    ],
)
def test_scale_of_an_axis_follows_its_values(values, kind):
    assert SweepAxis.of("x", "x", values).kind == kind


def test_tick_labels_do_not_overlap():
    for count in (2, 9, 300):
        for scale in (np.linspace(0.0, 30.0, count), np.geomspace(0.01, 1000.0, count)):
            axis = SweepAxis.of("x", "reflex gain [N·m·s/rad]", scale.tolist())
            table = effects(axis)
            panel = panels_of(draw(lines_figure(table, axis, [replace(VAF, series=SERIES[:1])] * 3)))[0]
            low, high = sorted(panel.get_xlim())
            boxes = [
                label.get_window_extent()
                for label in panel.get_xticklabels()
                if label.get_text() and low <= label.get_position()[0] <= high
            ]
            assert len(boxes) >= 2
            assert all(first.x1 < second.x0 for first, second in itertools.pairwise(boxes))
