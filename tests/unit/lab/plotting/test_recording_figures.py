from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from ankleloop import compare
from ankleloop.joint.models import ResponseModel
from ankleloop_lab.plotting.recordings import (
    comparison_figure,
    levels_figure,
    model_figure,
    recordings_figure,
    spectra_figure,
)


def estimate(predictor=None):
    """Parameters of a joint, with the model of a method."""
    stiffness = {"K": 150.0, "B": 0.8, "I": 0.015}
    reflex = {"G": 10.0, "omega_n": 40.0, "zeta": 1.0, "delay": 0.04}
    return SimpleNamespace(
        method="riv", stiffness=stiffness, reflex=reflex, diagnostics={}, predictor=predictor
    )


def legend(figure):
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def test_reference_has_a_coherence_of_its_own():
    frequency = np.geomspace(0.1, 40.0, 50)
    spectra = {
        "frequency": frequency,
        "position": frequency**-2,
        "torque": frequency**-1,
        "coherence": 0 * frequency,
    }
    assert legend(spectra_figure(spectra)) == ["position and torque"]
    figure = spectra_figure({**spectra, "reference_coherence": 0 * frequency + 1.0})
    assert legend(figure) == ["position and torque", "reference and position"]


def test_parametric_models_have_a_gain_and_a_phase():
    figure = model_figure({"riv": estimate(), "PI-MOESP": estimate()})
    gain = figure.axes[1]
    frequency, values = gain.get_lines()[0].get_data()
    s = 2j * np.pi * frequency
    np.testing.assert_allclose(values, np.abs(150.0 + 0.8 * s + 0.015 * s**2))


def test_reflex_responses_begin_after_the_delay_of_their_estimate():
    """Methods with different delays are compared at the same time after the movement."""
    slow = estimate(
        ResponseModel(SimpleNamespace(identification_rate=100.0), np.ones(9), np.ones(60))
    )
    slow.reflex["delay"] = 0.07
    figure = model_figure({"riv": slow, "PI-MOESP": estimate()})
    reflex = figure.axes[3]
    starts = [line.get_xdata()[0] for line in reflex.get_lines()]
    assert starts == [0.07, 0.07, 0.04]
    peaks = [
        line.get_xdata()[np.argmax(line.get_ydata())]
        for line in (reflex.get_lines()[0], reflex.get_lines()[2])
    ]
    assert peaks[0] - peaks[1] == pytest.approx(0.03)
    assert peaks[1] == pytest.approx(
        0.04 + 1 / 40.0, abs=2e-3
    )  # of a critically damped low-pass, at 1 / ωn


def recordings(**columns):
    names = {"label": "riv", "recording": ["A1", "A2", "A3"], "trusted": [True, True, False]}
    values = {
        "K": [100.0, 120.0, 900.0],
        "K_low": [90.0, 115.0, np.nan],
        "K_high": [110.0, 125.0, np.nan],
    }
    return pd.DataFrame({**names, **values, **columns})


def test_recordings_have_a_row_each_with_their_intervals():
    figure = recordings_figure(recordings(), ["K"])
    (axis,) = figure.axes
    ends = [segment[:, 0].tolist() for segment in axis.collections[0].get_segments()[:2]]
    assert ends == [[90.0, 110.0], [115.0, 125.0]]
    low, high = axis.get_xlim()
    assert (
        80.0 < low < 90.0 < 125.0 < high < 135.0
    )  # of those to be trusted; the other one is an arrow head
    assert figure.data["marked"].tolist() == [False, False, True]


def test_a_recording_without_an_estimate_has_an_empty_row():
    """Also where no recording has one: a study always has its figure."""
    some = recordings(K=[100.0, 120.0, np.nan], label=["riv", "PR", None])
    none = recordings(K=np.nan, K_low=np.nan, K_high=np.nan, label=np.nan, trusted=False)
    for table, methods in ((some, ["riv", "PR"]), (none, [])):
        figure = recordings_figure(table, ["K"])
        (axis,) = figure.axes
        assert [label.get_text() for label in axis.get_yticklabels()] == ["A1", "A2", "A3"]
        assert legend(figure) == methods
        assert figure.data["row"].tolist() == ["A1", "A2", "A3"]


def test_differences_stand_beside_the_lines_of_subjects():
    table = pd.DataFrame({"subject": list("abcabc"), "condition": ["rest"] * 3 + ["10MVC"] * 3})
    table["K"] = [100.0, 120.0, 80.0, 141.0, 160.0, 122.0]
    comparison = compare(table)
    figure = comparison_figure(table, comparison)
    shown = figure.data[figure.data["quantity"] == "ΔK"].iloc[0]
    row = comparison.set_index("kind").loc["difference"]
    assert shown[["value", "low", "high"]].tolist() == row[["value", "low", "high"]].tolist()
    assert [axis.get_ylabel() for axis in figure.axes] == ["K [N·m/rad]", "ΔK [N·m/rad]"]


def test_k_stands_against_where_the_joint_was_held():
    table = pd.DataFrame({"K": [100.0, 140.0], "K_low": [95.0, 130.0], "K_high": [105.0, 150.0]})
    levels = table.assign(mean_torque=[1.0, 9.0], mean_position=0.1, condition=["rest", "10MVC"])
    figure = levels_figure(levels)
    assert [axis.get_xlabel() for axis in figure.axes] == [
        "mean torque [N·m]",
        "mean position [rad]",
    ]
    assert figure.data["series"].tolist() == ["rest", "10MVC"] * 2
