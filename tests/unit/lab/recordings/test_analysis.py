"""Analysis of a recording: valid methods only, scored on data that were not fitted."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from ankleloop import DataError, evaluate, identify, segment, simulate
from ankleloop.methods import registry
from ankleloop_lab.recordings.analysis import analyse
from ankleloop_lab.recordings.files import load_recording
from ankleloop_lab.recordings.recommendation import recommend
from ankleloop_workflow.config.study import read_studies

ROOT = Path(__file__).parents[4]

METHODS = {
    "riv": {"method": "riv"},
    "riv, position": {"method": "riv", "options": {"reference": "position"}},
    "PR": {"method": "pr-moesp", "options": {"basis": "rectifier"}},
    "PR, instruments": {
        "method": "pr-moesp",
        "options": {"basis": "rectifier", "input_matrices": "instruments"},
    },
    "PI": {"method": "pi-moesp", "options": {"basis": "rectifier"}, "select": {"order": [1, 2]}},
    "cascade": {"method": "parallel-cascade"},
}


@pytest.fixture(scope="module")
def analyses():
    trials = {
        "closed": simulate(seed=1, duration=40.0),
        "open": simulate(seed=1, duration=40.0, closed_loop=False),
    }
    trials["undecided"] = trials["open"].drop_vars("reference")
    return {loop: (trial, analyse(trial, METHODS)) for loop, trial in trials.items()}


@pytest.mark.parametrize(
    ("loop", "valid"),
    [
        ("closed", ["riv", "PR, instruments"]),
        ("open", list(METHODS)),
        ("undecided", ["riv, position", "PI", "cascade"]),
    ],
)
def test_only_valid_methods_are_fitted(analyses, loop, valid):
    _, analysis = analyses[loop]
    assert analysis.check.loop == loop
    assert list(analysis.estimates) == list(analysis.residuals) == valid
    table = analysis.table.set_index("label")
    assert list(table.index) == list(METHODS)
    assert table.index[table["valid"].astype(bool)].tolist() == valid
    invalid = table[~table["valid"].astype(bool)]
    assert (invalid["warnings"].str.len() > 10).all()
    assert invalid["K"].isna().all()


def test_assumptions_are_said_with_what_another_delay_would_do(analyses):
    table = analyses["open"][1].table.set_index("label")
    assert "The reflex delay is 40 ms." in table.loc["cascade", "assumptions"]
    assert "A delay of 10 ms more would move K by " in table.loc["cascade", "assumptions"]


def test_scores_on_the_half_that_was_not_fitted(analyses):
    trial, analysis = analyses["closed"]
    row = analysis.table.set_index("label").loc["riv"]
    end = float(trial["time"][-1])
    half = identify(segment(trial, 0.0, end / 2), "riv")
    second = segment(trial, end / 2, end + 1.0)
    expected = evaluate(second, half.predict(second), against="measured").iloc[0]["vaf"]
    assert row["vaf_unseen"] == pytest.approx(expected, abs=1e-9)
    assert row["vaf_unseen_low"] < expected < row["vaf_unseen_high"]
    assert row["K"] == analysis.estimates["riv"].stiffness["K"]
    assert not row["residual_related"]


def test_options_are_selected_within_the_first_half(analyses):
    _, analysis = analyses["open"]
    row = analysis.table.set_index("label").loc["PI"]
    assert row["selected"] == "order 2"
    assert analysis.estimates["PI"].diagnostics["order"] == 2
    assert "selection" not in analysis.estimates["PI"].diagnostics


def test_short_trials_are_merged():
    """Eight trials of six seconds are too short each, but long enough together; only methods that merge are valid."""
    whole = simulate(seed=1, duration=48.0, closed_loop=False).drop_vars("reference")
    trials = [segment(whole, 6.0 * k, 6.0 * (k + 1)) for k in range(8)]
    analysis = analyse(trials, METHODS)
    assert analysis.check.verdict == "warning"
    assert "48 s" in analysis.check.findings[0].text
    assert analyse(trials[:1], METHODS).check.verdict == "refused"
    methods = {
        "PI": {"method": "pi-moesp", "options": {"basis": "rectifier"}},
        "cascade": METHODS["cascade"],
    }
    merged = analyse(trials, methods)
    row = merged.table.set_index("label").loc["PI"]
    assert row["K"] == pytest.approx(150.0, rel=0.1)
    assert row["vaf_unseen"] > 85
    assert np.unique(merged.estimates["PI"].torque["trial"]).tolist() == [*range(1, 9)]
    assert not merged.table.set_index("label").loc["cascade", "valid"]


def test_merged_closed_loop_trials_rest_on_the_reference():
    trials = [simulate(seed=seed, duration=6.0) for seed in range(6)]
    instruments = {"basis": "rectifier", "input_matrices": "instruments"}
    analysis = analyse(
        trials, {"PR": {"method": "pr-moesp", "options": instruments}, "PI": METHODS["PI"]}
    )
    table = analysis.table.set_index("label")
    assert table["loop"].tolist() == ["closed", "closed"]
    assert table["valid"].tolist() == [True, False]
    assert "poles" in table.loc["PR", "caution"]
    assert recommend(analysis).label == "PR"


def patch_method(monkeypatch, name, change):
    """Let a method change its estimates, or fail as linear algebra does on data that it cannot use."""
    method = registry.METHODS[name]

    def identify_and_change(trial, options):
        if isinstance(change, Exception):
            raise change
        return change(method.identify(trial, options))

    monkeypatch.setattr(
        registry,
        "METHODS",
        {**registry.METHODS, name: replace(method, identify=identify_and_change)},
    )


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (np.linalg.LinAlgError("SVD did not converge"), "(LinAlgError: SVD did not converge)"),
        (ValueError("array must not contain infs"), "(ValueError: array must not contain infs)"),
        (FloatingPointError("overflow"), "(FloatingPointError: overflow)"),
        (DataError("too short", {"drift": 1}), "too short"),
    ],
)
def test_a_method_that_fails_does_not_stop_the_others(monkeypatch, error, text):
    patch_method(monkeypatch, "riv", error)
    analysis = analyse(
        simulate(seed=1, duration=20.0, closed_loop=False),
        {"riv": METHODS["riv"], "PR": METHODS["PR"]},
    )
    table = analysis.table.set_index("label")
    assert table["valid"].tolist() == [False, True]
    assert text in table.loc["riv", "warnings"]
    assert analysis.remedy == getattr(error, "remedy", {})
    assert list(analysis.estimates) == ["PR"]
    assert recommend(analysis).label == "PR"


def test_a_wrong_option_is_an_error_before_anything_is_fitted():
    trial = simulate(seed=1, duration=20.0)
    with pytest.raises(ValueError, match="order"):
        analyse(trial, {"riv": {"method": "riv", "options": {"order": 7}}})
    with pytest.raises(ValueError, match="order"):
        analyse(trial, {"riv": {"method": "riv", "select": {"order": [2, 7]}}})


def add_warning(estimate):
    return replace(estimate, diagnostics={**estimate.diagnostics, "warnings": ["not converged."]})


def turn_viscosity(estimate):
    return replace(
        estimate, stiffness={**estimate.stiffness, "B": -1.0}, intervals={"B": (-1.2, -0.8)}
    )


@pytest.mark.parametrize(
    ("change", "warning"),
    [(add_warning, "not converged."), (turn_viscosity, "B = -1 N·m·s/rad is negative")],
)
def test_estimates_with_a_warning_are_not_trusted_and_have_no_intervals(
    monkeypatch, change, warning
):
    trial = simulate(seed=1, duration=20.0)
    good = analyse(trial, {"riv": METHODS["riv"]})
    assert good.table.loc[0, "trusted"]
    assert good.table.loc[0, "K_low"] < good.table.loc[0, "K"]
    assert good.table.loc[0, "intervals"] in ("asymptotic", "robust")
    patch_method(monkeypatch, "riv", change)
    analysis = analyse(trial, {"riv": METHODS["riv"]})
    row = analysis.table.loc[0]
    assert row["valid"]
    assert not row["trusted"]
    assert warning in row["warnings"]
    assert not [name for name in row.index if name in ("K_low", "B_high", "intervals")]
    recommendation = recommend(analysis)
    assert recommendation.label is None
    assert "every method that was fitted has a warning (riv)" in recommendation.text


def test_a_warning_about_the_data_is_a_caution_and_decides_nothing():
    trial = simulate(seed=1, duration=20.0)
    analysis = analyse(trial.assign(reference=trial["position"]), {"PR": METHODS["PR"]})
    row = analysis.table.loc[0]
    assert row["trusted"]
    assert "reference is a copy of the position" in row["caution"]


def test_a_half_that_is_too_short_does_not_stop_the_fit_of_the_whole():
    options = {"basis": "spline", "block_rows": 40, "input_matrices": "instruments"}
    analysis = analyse(
        simulate(seed=5, duration=14.0), {"PI": {"method": "pi-moesp", "options": options}}
    )
    row = analysis.table.loc[0]
    assert row["valid"]
    assert np.isnan(row["vaf_unseen"])
    assert row["unseen_warnings"].startswith("there is none: the record of ")
    assert analysis.unseen == {}
    assert recommend(analysis).label == ("PI" if row["trusted"] else None)


@pytest.mark.skipif(
    "ANKLELOOP_RECORDINGS" not in os.environ,
    reason="set ANKLELOOP_RECORDINGS to the folder with the real recordings to run this",
)
@pytest.mark.parametrize(("recording", "net"), [("z_df", 93.4), ("z_pf", 87.7), ("z_df3", 93.4)])
def test_real_recordings(recording, net):
    """Those of the example. Their torque has the other sign; then only the missing reference gives warnings."""
    example = yaml.safe_load(
        (ROOT / "config" / "recordings.example.yaml").read_text(encoding="utf-8")
    )
    study = read_studies(example)[1]["recordings"]
    mapping = study.chunks[0][recording]
    (path,), (part,) = mapping["paths"], mapping["parts"]
    turned = analyse(load_recording(path, part | {"torque_sign": 1}), {})
    assert [finding.name for finding in turned.check.findings if finding.verdict == "refused"] == [
        "sign of the torque"
    ]
    trial = load_recording(path, part)
    analysis = analyse(trial, study.analysed_methods)
    assert (trial.sizes["time"], trial.attrs["sampling_rate"]) == (60_000, 1000.0)
    assert analysis.check.loop == "undecided"
    assert {f.name for f in analysis.check.findings if f.verdict != "ok"} == {
        "reference",
        "loop",
        "methods",
    }
    table = analysis.table.set_index("method")
    assert (table[["K", "B", "I"]] > 0).all(axis=None)
    assert (table.loc[["pi-moesp", "parallel-cascade"], "vaf_net"] > net - 1).all()
    unseen = table["vaf_unseen"]
    assert unseen.drop("parallel-cascade").max() > unseen["parallel-cascade"] - 0.5
