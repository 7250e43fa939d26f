from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from IPython.core.formatters import DisplayFormatter

import ankleloop
from ankleloop.plotting.estimates import torque_figure
from ankleloop.plotting.style import save_figure


@pytest.fixture(scope="module")
def identified():
    trial = ankleloop.simulate(seed=1, duration=12.0)
    return trial, {
        "PR-MOESP": ankleloop.identify(trial, "pr-moesp"),
        "one pass": ankleloop.identify(trial, "parallel-cascade", max_passes=1),
    }


def test_estimates_of_a_recording_are_drawn_over_its_measured_torque(identified):
    trial, estimates = identified
    recording = trial[["position", "torque", "reference"]]
    figure = torque_figure(recording, estimates, start=100.0, length=4.0)
    titles = [axis.get_title() for axis in figure.axes]
    assert all(title.endswith("(measured)") for title in titles)
    end = float(trial["time"][-1])
    assert figure.axes[0].get_xlim() == (
        end - 4.0,
        end,
    )  # a window beyond the record is moved into it


def test_the_table_has_what_is_drawn(identified, tmp_path):
    trial, estimates = identified
    figure = torque_figure(trial, estimates, start=3.0, length=4.0)
    save_figure(figure, tmp_path / "torques")
    table = pd.read_csv(tmp_path / "torques.csv")
    axes = np.array(figure.axes).reshape(3, 2)
    for column, label in enumerate(estimates):
        for row, torque in enumerate(("net", "intrinsic", "reflex")):
            rows = table[(table["method"] == label) & (table["quantity"] == f"{torque} torque")]
            for line in axes[row, column].get_lines():
                drawn = rows.loc[rows["series"] == line.get_label(), ["x", "value"]]
                np.testing.assert_array_equal(line.get_xydata(), drawn)
    assert table["x"].between(3.0, 7.0).all()


def test_an_estimate_plots_itself_over_the_measured_torque_and_with_a_trial_over_the_true_ones(
    identified,
):
    trial, estimates = identified
    estimate = estimates["PR-MOESP"]
    figure = estimate.plot()
    assert plt.gcf() is figure  # which plt.show and plt.savefig take
    assert f"VAF {estimate.vaf_net:.1f} %" in figure.axes[0].get_title()
    assert set(figure.data["series"]) == {"measured", "pr-moesp (estimated)"}
    (measured,) = (line for line in figure.axes[1].get_lines() if line.get_label() == "measured")
    expected = estimate.torque["measured"].sel(time=measured.get_xdata())
    np.testing.assert_allclose(measured.get_ydata(), expected, atol=1e-12)
    plt.close(figure)
    assert "true (simulated)" in set(estimate.plot(trial).data["series"])


@pytest.mark.parametrize("layout", [None, "constrained"])
def test_an_estimate_plots_itself_into_a_part_of_a_figure(identified, layout):
    _, estimates = identified
    figure = plt.figure(layout=layout)
    part = figure.subfigures(1, 2)[1]
    assert estimates["PR-MOESP"].plot(figure=part) is part
    assert len(part.axes) == 3
    assert len(part.legends) == 1
    plt.close(figure)


def test_an_estimate_without_a_measured_torque_asks_for_the_trial(identified):
    trial, estimates = identified
    estimate = replace(
        estimates["PR-MOESP"], torque=estimates["PR-MOESP"].torque.drop_vars("measured")
    )
    with pytest.raises(ankleloop.DataError, match=r"give the trial, estimate\.plot\(trial\)"):
        estimate.plot()
    assert len(estimate.plot(trial).axes) == 3


def test_an_estimate_of_a_joint_that_changes_plots_its_trajectories():
    trial = ankleloop.simulate(seed=4, variation="cycle", duration=24.0)
    estimate = ankleloop.identify(trial, "riv-tv", cycle_onsets="phase")
    labels = ["K [N·m/rad]", "B [N·m·s/rad]", "G [N·m·s/rad]"]
    assert [axis.get_ylabel() for axis in estimate.plot().axes[:3]] == labels
    assert set(estimate.plot(trial).data["series"]) == {"riv-tv", "true value"}


def test_a_notebook_shows_the_plot_of_an_estimate_once(identified):
    """As the last line of a cell: pyplot has no figure left that it would show at the end of the cell."""
    plt.close("all")
    with plt.rc_context():
        plt.switch_backend("module://matplotlib_inline.backend_inline")
        figure = identified[1]["PR-MOESP"].plot()
        assert plt.gcf() is figure
        assert "image/png" in DisplayFormatter().format(figure)[0]
        assert not plt.get_fignums()
        plt.switch_backend("agg")
