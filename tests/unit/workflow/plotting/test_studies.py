import numpy as np
import pandas as pd
import pytest
from scipy import stats

from ankleloop.plotting.panels import Panel, estimates_figure
from ankleloop_workflow.plotting.studies import curves_figure
from ankleloop_workflow.tables.means import curve_means


@pytest.fixture
def results():
    rng = np.random.default_rng(1)
    rows = [
        {
            "panel": panel,
            "series": series,
            "x": x,
            "value": 10.0 * x + offset + rng.standard_normal(),
        }
        for panel in ("K", "B")
        for series, offset in (("PR-MOESP", 0.0), ("PI-MOESP", -300.0))
        for x in (1.0, 2.0, 4.0)
        for _ in range(8)
    ]
    return pd.DataFrame(rows)


def average(rows):
    """Means of the values in each panel, as figures take them."""
    parts = [
        curve_means(part.assign(point="p", trial=range(len(part))), {panel: "value"})
        for panel, part in rows.groupby("panel", sort=False)
    ]
    return pd.concat(parts)


def test_curves_are_means_with_their_confidence_bands(results):
    figure = curves_figure(
        average(results),
        {"K": Panel("K [N·m/rad]", truth=15.0), "B": Panel("B [N·m·s/rad]")},
        xlabel="gain [1]",
    )
    first, second = figure.axes
    assert [axis.get_ylabel() for axis in (first, second)] == ["K [N·m/rad]", "B [N·m·s/rad]"]
    values = results.query("panel == 'K' and series == 'PR-MOESP' and x == 2")["value"]
    line = first.get_lines()[0]
    assert line.get_ydata()[1] == pytest.approx(values.mean())
    low, high = stats.t.interval(0.95, 7, values.mean(), values.std() / np.sqrt(8))
    band = first.collections[0].get_paths()[0].vertices
    edges = band[band[:, 0] == 2.0][:, 1]
    assert (edges.min(), edges.max()) == (pytest.approx(low), pytest.approx(high))


def test_a_band_ends_where_a_single_trial_is_left(results):
    """No interval is known there: the band must not shrink to a line, as if the mean were exact."""
    rows = results[(results["x"] != 4.0) | ~results.duplicated(["panel", "series", "x"])]
    figure = curves_figure(average(rows), {"K": Panel("K [N·m/rad]")}, xlabel="gain [1]")
    for band in figure.axes[0].collections:
        assert max(path.vertices[:, 0].max() for path in band.get_paths()) == 2.0


def test_means_with_faults_have_a_ring_and_those_without_a_trial_a_cross():
    table = pd.DataFrame(
        {
            "panel": "K",
            "series": "PR-MOESP",
            "x": [1.0, 2.0, 4.0],
            "value": [10.0, 20.0, np.nan],
            "marked": [False, True, False],
            "failed": [False, False, True],
        }
    )
    figure = curves_figure(table, {"K": Panel("K [N·m/rad]")}, xlabel="gain [1]")
    places = {line.get_label(): line.get_xdata().tolist() for line in figure.axes[0].get_lines()}
    assert places["more failures or warnings than others of the curve"] == [2.0]
    assert places["every trial failed"] == [4.0]


def test_estimates_have_a_row_for_each_condition_and_arrow_heads_beyond_the_limits():
    table = pd.DataFrame(
        {
            "panel": "K",
            "row": ["complete", "complete", "rank policy", "rank policy"],
            "series": ["PR-MOESP", "EIV-MOESP"] * 2,
            "value": [2.0, 3.0, 4.0, 200.0],
            "margin": [0.5, np.nan, 1.0, 50.0],
        }
    )
    figure = estimates_figure(
        table, {"K": Panel("error of K [%]", truth=0.0, limits=(-10.0, 20.0))}
    )
    axis = figure.axes[0]
    markers = [line for line in axis.get_lines() if line.get_marker() not in (None, "None", "")]
    first, inside, beyond = markers
    np.testing.assert_allclose(first.get_xdata(), [2.0, 4.0])
    np.testing.assert_allclose(inside.get_xdata(), [3.0, np.nan])
    np.testing.assert_allclose(beyond.get_xdata(), [20.0])
    assert figure.data["value"].tolist() == [2.0, 3.0, 4.0, 200.0]  # also those beyond the limits
    ends = [segment[:, 0].tolist() for segment in axis.collections[0].get_segments()]
    assert ends == [[1.5, 2.5], [3.0, 5.0]]


def test_what_lies_above_a_level_has_panels_of_its_own(results):
    rows = results.assign(
        value=np.where(results["series"] == "PR-MOESP", 99.0, -50.0) + 0.1 * results["value"]
    )
    panels = {
        name: Panel("VAF [%]", f"{name} torque", limits=(-200.0, 105.0)) for name in ("K", "B")
    }
    figure = curves_figure(average(rows), panels, xlabel="gain [1]", above=90.0)
    assert [axis.get_ylim() for axis in figure.axes] == [(90.0, 100.4)] * 2 + [(-200.0, 105.0)] * 2
    assert figure.data["quantity"].unique().tolist() == ["VAF above 90", "VAF"]
