import numpy as np
import pytest

import ankleloop
from ankleloop.plotting.style import save_figure
from ankleloop.plotting.torques import torque_figure


@pytest.fixture(scope="module")
def identified():
    trial = ankleloop.simulate(seed=1, duration=12.0)
    return trial, {
        "PR-MOESP": ankleloop.identify(trial),
        "one pass": ankleloop.identify(trial, "parallel-cascade", max_passes=1),
    }


def test_panels_have_labels_titles_and_scores(identified):
    trial, estimates = identified
    figure = torque_figure(trial, estimates, start=3.0, length=4.0, title="a title")
    axes = np.array(figure.axes).reshape(3, 2)
    assert [axis.get_ylabel() for axis in axes[:, 0]] == [f"{t} torque [N·m]" for t in ("net", "intrinsic", "reflex")]
    assert {axis.get_xlabel() for axis in axes[-1]} == {"time [s]"}
    assert {axis.get_xlim() for axis in axes.flat} == {(3.0, 7.0)}
    assert axes[0, 0].get_title().startswith("PR-MOESP\nnet: VAF ")
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    assert legend == ["measured", "PR-MOESP (estimated)", "one pass (estimated)", "true (simulated)"]
    scores = ankleloop.evaluate(trial, estimates["PR-MOESP"]).set_index(["torque", "against"])["vaf"]
    assert axes[2, 0].get_title() == f"reflex: VAF {scores['reflex', 'true']:.1f} % (true)"


def test_estimates_of_a_recording_are_drawn_over_its_measured_torque(identified):
    trial, estimates = identified
    recording = trial[["position", "torque", "reference"]]
    figure = torque_figure(recording, estimates, start=100.0, length=4.0)
    titles = [axis.get_title() for axis in figure.axes]
    assert all(title.endswith("(measured)") for title in titles)
    end = float(trial["time"][-1])
    assert figure.axes[0].get_xlim() == (end - 4.0, end)  # a window beyond the record is moved into it


def test_equal_data_give_equal_bytes(identified, tmp_path):
    for name in ("first", "second"):
        save_figure(torque_figure(*identified), tmp_path / name)
    for suffix in (".png", ".pdf"):
        first, second = ((tmp_path / f"{name}{suffix}").read_bytes() for name in ("first", "second"))
        assert first == second
        assert len(first) > 10_000
