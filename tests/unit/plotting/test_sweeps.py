import itertools
from dataclasses import replace

import matplotlib
import numpy as np
import pandas as pd
import pytest

from ankleloop.plotting.panels import FAULT_RING
from ankleloop.plotting.style import METHOD_STYLES, STYLE
from ankleloop.plotting.sweeps import (
    FRAME,
    NO_POINT,
    SweepAxis,
    SweepPanel,
    SweepSeries,
    lines_figure,
    maps_figure,
    value_limits,
)

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
    return rows_of([{"value": value} for value in axis.values], parameter=axis.name)


def cells():
    return rows_of([{"x": x, "y": y} for y in NOISE.values for x in GAIN.values], slice="")


def panels_of(figure):
    return [axis for axis in figure.axes if axis.get_label() != "<colorbar>" and axis.get_visible()]


def bars_of(figure):
    return [axis for axis in figure.axes if axis.get_label() == "<colorbar>"]


def test_lines_are_the_means_and_bands_their_ends():
    axis = panels_of(draw(lines_figure(effects(GAIN), [GAIN], [VAF])))[0]
    line = next(line for line in axis.get_lines() if line.get_label() == "RIV")
    np.testing.assert_array_equal(line.get_xydata(), [(5, 95), (10, 96), (15, 97), (20, 98)])
    edges = axis.collections[0].get_paths()[0].vertices
    at_ten = edges[edges[:, 0] == 10.0][:, 1]
    assert (at_ten.min(), at_ten.max()) == (93.0, 99.0)


def test_marks_stand_where_trials_failed_or_warned():
    table = effects(GAIN)
    table.loc[(table["value"] == 5.0) & (table["method"] == "riv"), "warnings"] = 1
    last = (table["value"] == 20.0) & (table["method"] == "moesp")
    table.loc[last, ["mean", "low", "high"]] = np.nan
    table.loc[last, "failures"] = 5
    axis = panels_of(draw(lines_figure(table, [GAIN], [VAF])))[0]
    lines = {line.get_label(): line for line in axis.get_lines()}
    np.testing.assert_array_equal(lines[FAULT_RING["label"]].get_xydata(), [(5.0, 95.0)])
    assert lines["every trial failed"].get_xdata().tolist() == [20.0]


def test_only_a_relevant_share_of_faults_is_marked():
    rows = pd.DataFrame({"trials": [100, 100, 20, 5, 5], "failures": [4, 5, 0, 5, 0], "warnings": [0, 0, 1, 0, 0]})
    rows = rows.assign(quantity="vaf", method="riv")
    assert VAF.rows(rows)["marked"].tolist() == [False, True, True, False, False]
    assert VAF.rows(rows)["failed"].tolist() == [False, False, False, True, False]


def test_maps_have_a_panel_for_each_method_and_quantity_and_difference():
    figure = draw(maps_figure(cells(), (GAIN, NOISE), PANELS))
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
    assert [label.get_text() for label in panels[0].get_yticklabels()] == ["0.1", "1", "10"]


def test_tables_of_sweeps_have_what_is_drawn():
    figure = draw(maps_figure(cells(), (GAIN, NOISE), PANELS))
    rows = figure.data.query("quantity == 'reflex VAF' and series == 'PR-MOESP'").sort_values(["y", "x"])
    image = panels_of(figure)[1].images[0]
    np.testing.assert_array_equal(image.get_array().ravel(), rows["value"])
    assert set(figure.data["unit"]) == {"%", "points", "N·m/rad"}
    figure = draw(lines_figure(effects(GAIN), [GAIN], [VAF]))
    rows = figure.data.query("series == 'RIV'")
    line = next(line for line in panels_of(figure)[0].get_lines() if line.get_label() == "RIV")
    np.testing.assert_array_equal(line.get_xydata(), rows[["x", "value"]].astype(float))


def test_colours_of_differences_are_centred_at_zero():
    figure = draw(maps_figure(cells(), (GAIN, NOISE), [VAF, VAF_DIFFERENCE]))
    first, second, difference = (axis.images[0] for axis in panels_of(figure))
    assert difference.norm.vmin == -difference.norm.vmax
    assert difference.get_cmap().name == "RdBu"
    assert (first.norm.vmin, first.norm.vmax) == (second.norm.vmin, second.norm.vmax)


def test_cells_have_their_numbers_and_marks():
    """A cross where there are trials but no value, grey where there is no point, an asterisk behind marked means."""
    table = cells()
    table = table[~((table["x"] == 20.0) & (table["y"] == 10.0))]
    lost = (table["x"] == 5.0) & (table["y"] == 0.1) & (table["method"] == "riv")
    table.loc[lost, ["mean", "failures"]] = np.nan, 5
    table.loc[(table["x"] == 10.0) & (table["y"] == 0.1), "warnings"] = 1
    figure = draw(maps_figure(table, (GAIN, NOISE), [VAF]))
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["no point", "no value"]
    first, second = panels_of(figure)
    assert np.isnan(first.images[0].get_array().filled(np.nan)).sum() == 2
    assert [text.get_text() for text in second.texts][:4] == ["90.0", "91.0*", "92.0", "93.0"]
    assert first.get_facecolor() == second.get_facecolor() == matplotlib.colors.to_rgba(NO_POINT["color"])


def test_cells_within_a_limit_have_a_frame_and_what_should_be_low_is_light_where_it_is():
    names = {"quantity": "K", "method": "riv", "slice": ""}
    table = pd.DataFrame({**names, "x": [5.0, 10.0], "y": 1.0, "mean": [1.5, 40.0]})
    panel = SweepPanel("K", "deviation [points]", SERIES[:1], "low", limit=2.0)
    axes = SweepAxis.of("x", "gain [1]", table["x"]), SweepAxis.of("y", "noise [1]", table["y"])
    cell = panels_of(draw(maps_figure(table.assign(trials=3, failures=0, warnings=0), axes, [panel])))[0]
    (frame,) = cell.patches
    assert frame.get_xy() == (-0.5, -0.5)
    assert frame.get_edgecolor() == matplotlib.colors.to_rgba(FRAME)
    assert cell.images[0].to_rgba(1.5)[1] > cell.images[0].to_rgba(40.0)[1]


def test_small_cells_have_rings_and_points_of_a_random_design_are_drawn_one_by_one():
    axis = SweepAxis.of("reflex_gain", "reflex gain [N·m·s/rad]", np.arange(40.0))
    table = rows_of([{"x": x, "y": x} for x in axis.values], slice="", warnings=1)
    first = panels_of(draw(maps_figure(table, (axis, axis), [VAF])))[0]
    assert not first.texts
    assert first.get_lines()[-1].get_label() == FAULT_RING["label"]
    points = panels_of(draw(maps_figure(table, (axis, axis), [VAF], is_grid=False)))[0]
    np.testing.assert_array_equal(points.collections[0].get_offsets(), [(x, x) for x in axis.values])


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
            panel = panels_of(draw(lines_figure(table, [axis], [replace(VAF, series=SERIES[:1])] * 3)))[0]
            low, high = sorted(panel.get_xlim())
            boxes = [
                label.get_window_extent()
                for label in panel.get_xticklabels()
                if label.get_text() and low <= label.get_position()[0] <= high
            ]
            assert len(boxes) >= 2
            assert all(first.x1 < second.x0 for first, second in itertools.pairwise(boxes))
