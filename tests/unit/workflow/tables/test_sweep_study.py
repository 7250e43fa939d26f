from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from synthetic_sweep import LABELS, SETTINGS, grid, make_trials, sweep_options, write_trials

from ankleloop.errors import DataError
from ankleloop_workflow.tables.sweeps import SweepStudy, describe_design, draw_sweep

POINTS = grid(reflex_gain=[5.0, 10.0, 20.0], voluntary=[0.0, 0.5])


@pytest.fixture
def read(tmp_path):
    """Write a table of trials and read it as a sweep."""

    def read(table, varied, **options):
        path = write_trials(tmp_path / "s-trials.parquet", table)
        return SweepStudy.read(path, varied, LABELS, sweep_options(**options), SETTINGS)

    return read


@pytest.fixture
def sweep(read):
    table = make_trials(
        POINTS, fail=lambda row: row["point.voluntary"] == 0.5 and row["trial"] == 0
    )
    return read(table, ["reflex_gain", "voluntary"], difference=["riv", "moesp"])


def test_quantities_without_a_value_are_named_and_left_out(read):
    table = make_trials(POINTS).assign(zeta=np.nan)
    sweep = read(table, ["reflex_gain", "voluntary"], quantities=["K", "zeta", "passes"])
    assert (sweep.quantities, sweep.absent) == (["K"], ["zeta", "passes"])
    assert "No method of this study gives ζ, passes." in describe_design(sweep)
    with pytest.raises(DataError, match="no method has a value of zeta"):
        read(table, ["reflex_gain", "voluntary"], quantities=["zeta"])


def test_axes_choose_the_picture(read):
    table = make_trials(
        grid(reflex_gain=[5.0, 10.0], voluntary=[0.0, 0.5], block_rows=[10, 12]), trials=2
    )
    varied = ["reflex_gain", "voluntary", "block_rows"]
    figure, _ = draw_sweep(read(table, varied))
    assert len([axis for axis in figure.axes if axis.get_visible()]) == 5 * 3
    figure, caption = draw_sweep(read(table, varied, axes=["voluntary"], quantities=["K"]))
    assert figure.axes[0].get_xlabel() == "relative voluntary torque [1]"
    assert "against relative voluntary torque; each is over all values of reflex gain [" in caption
    figure, _ = draw_sweep(read(table, varied, axes=varied[:2], quantities=["K"]))
    assert [axis.get_title() for axis in figure.axes if axis.get_title()] == list(LABELS.values())


def test_a_picture_says_why_means_over_two_conditions_have_no_band(sweep):
    """Three gains at each of two levels of voluntary torque: bands over the levels, none over the gains."""
    figure, caption = draw_sweep(replace(sweep, axes=sweep.axes[:1]))
    assert not any(axis.collections for axis in figure.axes)
    assert "a mean over two conditions has none" in caption
    figure, _ = draw_sweep(replace(sweep, axes=sweep.axes[1:]))
    assert all(axis.collections for axis in figure.axes)


def test_only_a_relevant_share_of_faults_is_marked(sweep):
    counts = {
        "trials": [100, 100, 20, 5, 5],
        "failures": [4, 5, 0, 5, 0],
        "warnings": [0, 0, 1, 0, 0],
    }
    rows = sweep.label_rows(
        pd.DataFrame(counts).assign(quantity="K_error", method="riv", mean=1.0, margin=0.0)
    )
    assert rows["marked"].tolist() == [False, True, True, False, False]
    assert rows["failed"].tolist() == [False, False, False, True, False]


def test_a_random_design_of_two_parameters_has_a_column_of_lines_for_each(read):
    rng = np.random.default_rng(1)
    points = [
        {"reflex_gain": gain, "voluntary": noise} for gain, noise in rng.uniform(0.1, 9.0, (60, 2))
    ]
    figure, _ = draw_sweep(
        read(make_trials(points, trials=1), ["reflex_gain", "voluntary"], quantities=["K"])
    )
    assert [axis.lines[0].get_xdata().size for axis in figure.axes] == [10, 10]
