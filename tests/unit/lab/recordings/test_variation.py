"""Recordings of joints that change: what their parameters follow, and whether they change at all."""

import re
from dataclasses import replace

import numpy as np
import pytest

from ankleloop import DataError, save_trial, simulate
from ankleloop_lab.pages.recordings import draw_figures, render_recording_page
from ankleloop_lab.recordings.analysis import analyse
from ankleloop_lab.recordings.files import add_course, check_course, load_recording, merge_courses
from ankleloop_lab.recordings.recommendation import describe_variations, recommend
from ankleloop_lab.recordings.settings import Recording

CHANGE = {
    "stiffness_variation": 0.4,
    "gain_variation": 0.4,
    "load": (0.1, 10.0, 100.0),
    "voluntary": 0.3,
}
METHODS = {
    "changing": {"method": "riv-tv", "options": {"rest_position": 0.0}},
    "constant": {"method": "riv"},
}
MAPPING = {"subject": "", "condition": "", "trial": "", "session": "", "parts": [{"file": "a.nc"}]}


def onsets_of(trial):
    """Onsets of cycles [s] of a simulated trial."""
    phase = trial["phase"].values
    return trial["time"].values[1:][np.diff(phase) < -0.5].tolist()


@pytest.fixture(scope="module")
def analysis():
    """Cycles of uneven duration, whose onsets are numbers: each half has its own."""
    trial = simulate(seed=1, duration=50.0, variation="cycle", cycle_jitter=0.05, **CHANGE)
    return trial, analyse(trial, add_course(METHODS, {"cycle_onsets": onsets_of(trial)}))


def test_unseen_cycles_are_predicted_at_their_own_onsets(analysis):
    _, result = analysis
    table = result.table.set_index("label")
    assert table.loc["changing", "vaf_unseen"] > table.loc["constant", "vaf_unseen"] + 10.0
    assert table.loc["changing", "vaf_unseen"] == pytest.approx(
        table.loc["changing", "vaf_net"], abs=4.0
    )


def test_a_change_is_told_with_its_test_and_the_gain_on_unseen_cycles(analysis):
    _, result = analysis
    (text,) = describe_variations(result).values()
    gain = np.subtract(*result.table.set_index("label").loc[["changing", "constant"], "vaf_unseen"])
    assert text.startswith("K, B or G change with the phase of the cycle")
    assert "(level 5 %)" in text
    stated = float(re.search(r"a difference of ([\d.]+) points", text)[1])
    assert stated == pytest.approx(
        gain, abs=1.0
    )  # without the means of the residuals, which a VAF leaves out, too
    assert "Of the torque of unseen cycles the trajectories explain" in text
    assert "the time-invariant fit (constant)" in text


@pytest.mark.usefixtures("coarse_pictures")
def test_the_page_shows_trajectories_bands_and_excitation(analysis):
    trial, result = analysis
    figures = draw_figures([trial], result, {"start": 10.0, "length": 5.0})
    data = figures["trajectories"].data
    assert set(data["series"]) == {"changing", "constant"}
    assert {"value", "low", "high"} <= set(data.columns)
    assert "excitation" in set(data["quantity"])
    page = render_recording_page("a", MAPPING, result, figures)
    assert "Change of the joint" in page
    assert describe_variations(result)["changing"] in page


def test_an_incomplete_model_decides_nothing(analysis):
    """What a model leaves out, such as a threshold, may look like a change."""
    _, result = analysis
    incomplete = replace(
        result, table=result.table.assign(incomplete=result.table["label"].eq("changing"))
    )
    (text,) = describe_variations(incomplete).values()
    assert "So the test decides nothing here." in text
    assert recommend(result).label == "changing"
    assert recommend(incomplete).label == "constant"


def test_a_constant_joint_is_not_called_changing():
    trial = simulate(
        seed=3, duration=50.0, variation="cycle", voluntary=0.3, load=(0.1, 10.0, 100.0)
    )
    result = analyse(trial, add_course(METHODS, {"cycle_onsets": "phase"}))
    (text,) = describe_variations(result).values()
    assert text.startswith("No change of K, B or G with the phase of the cycle is shown")
    assert recommend(result).label == "constant"


@pytest.mark.parametrize(("knots", "told"), [((1, 5, 5), True), ((1, 1, 1), False)])
def test_what_cannot_vary_is_not_said_to(knots, told):
    """With one value of a parameter there is no probability of its variation."""
    trial = simulate(seed=1, duration=30.0, variation="cycle", **CHANGE)
    options = {"cycle_onsets": "phase", "knots": knots, "interpolation": "constant"}
    result = analyse(trial, {"steps": {"method": "riv-tv", "options": options}})
    texts = list(describe_variations(result).values())
    assert len(texts) == told
    assert all("while the others may change: B " in text and "nan" not in text for text in texts)
    assert recommend(result).text


def test_a_slow_change_has_no_unseen_half_and_is_recommended():
    trial = simulate(seed=1, duration=60.0, variation="time", **CHANGE)
    result = analyse(trial, METHODS)
    (text,) = describe_variations(result).values()
    assert text.startswith("K, B or G change with time")
    assert "There is no VAF of the unseen half" in text
    assert "were fitted before the times of the other half" in text
    recommendation = recommend(result)
    assert recommendation.label == "changing"
    assert "its test says that K, B or G change" in recommendation.text
    assert "the trajectories show the change" in recommendation.text


def test_the_course_of_a_recording_goes_to_methods_that_take_one_and_set_none():
    mapping = {"schedule": "ankle_angle", "cycle_onsets": None}
    methods = METHODS | {"own": {"method": "riv-tv", "options": {"cycle_onsets": "phase"}}}
    result = add_course(methods, mapping)
    assert result["changing"]["options"] == {"rest_position": 0.0, "schedule": "ankle_angle"}
    assert result["constant"] == METHODS["constant"]
    assert result["own"] == methods["own"]
    assert add_course(methods, {}) == methods


def test_files_are_analysed_over_their_scheduling_variable(tmp_path):
    trial = simulate(seed=1, duration=40.0, variation="schedule", **CHANGE)
    save_trial(trial, tmp_path / "a.nc")
    mapping = Recording(
        file="a.nc", reference="reference", variables={"level": "schedule"}, schedule="level"
    ).model_dump()
    result = analyse(load_recording(tmp_path / "a.nc", mapping), add_course(METHODS, mapping))
    assert list(result.estimates["changing"].trajectories.sizes) == ["schedule"]
    assert describe_variations(result)["changing"].startswith(
        "K, B or G change with the scheduling variable"
    )


@pytest.mark.parametrize(
    ("course", "verdict", "text"),
    [
        ({}, None, ""),
        ({"cycle_onsets": "phase"}, "ok", "12 whole cycles of 1.4 s can be identified."),
        (
            {"cycle_onsets": (5.0, 3.0, 2.0)},
            "warning",
            r"onset 2 of 3 \(3 s\) is not after the one before",
        ),
        ({"cycle_onsets": (5.0, 6.4, 7.8)}, "warning", "too few whole cycles"),
        (
            {"cycle_onsets": "gait"},
            "warning",
            "no variable 'gait' for cycle_onsets; .* variables of read_trial",
        ),
        ({"schedule": "emg"}, "warning", "no variable 'emg' for schedule"),
        (
            {"schedule": "phase"},
            "ok",
            r"phase goes from 0\.0\d+ to 0\.9\d+ \(2nd to 98th percentile\)",
        ),
        (
            {"schedule": "position"},
            "warning",
            "position follows the perturbation: 100 % of its fast changes",
        ),
    ],
)
def test_cycles_are_checked_before_anything_is_fitted(course, verdict, text):
    findings = check_course(simulate(seed=1, duration=20.0, variation="cycle"), course)
    assert [finding.verdict for finding in findings] == ([] if verdict is None else [verdict])
    assert all(re.search(text, finding.text) for finding in findings)


def test_onsets_of_each_merged_recording_go_with_its_trial():
    """Also where the halves of the list are fitted, and predicted."""
    settings = {"variation": "cycle", "cycle_jitter": 0.05, **CHANGE}
    trials = [simulate(seed=seed, duration=14.0, **settings) for seed in range(4)]
    parts = [{"cycle_onsets": onsets_of(trial)} for trial in trials]
    result = analyse(trials, add_course(METHODS, merge_courses(parts)))
    row = result.table.set_index("label").loc["changing"]
    assert row["vaf_unseen"] == pytest.approx(row["vaf_net"], abs=6.0)
    assert row["K"] == pytest.approx(150.0, rel=0.1)
    assert merge_courses([{"cycle_onsets": "phase"}] * 4)["cycle_onsets"] == "phase"
    with pytest.raises(DataError, match="differ between the trials that are merged"):
        merge_courses([*parts[:3], {"cycle_onsets": "phase"}])
