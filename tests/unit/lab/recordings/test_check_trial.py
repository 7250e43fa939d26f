"""Checks of a recording: every refusal and warning has the reason that it names."""

import numpy as np
import pytest
from scipy import signal as sps

from ankleloop import DataError, identify, segment, simulate
from ankleloop.joint.prepared import prepare
from ankleloop.methods.registry import JOINT_METHODS
from ankleloop.trials.trial import remove_drift
from ankleloop_lab.recordings.checks import check_trial


@pytest.fixture(scope="module")
def closed():
    return simulate(seed=1)


def find(check, name):
    return next(finding for finding in check.findings if finding.name == name)


def test_a_good_record_is_ok(closed):
    check = check_trial(closed)
    assert check.verdict == "ok", str(check)
    assert check.loop == "closed"
    assert list(check.methods) == ["riv", "pr-moesp", "pi-moesp", "po-moesp", "eiv-moesp", "riv-tv"]
    assert check.reasons == []
    assert set(check.spectra) == {
        "frequency",
        "position",
        "torque",
        "coherence",
        "reference_coherence",
    }


def test_spectra_against_scipy(closed):
    spectra = check_trial(closed).spectra
    r = prepare(closed).regressors(
        delay=0.04, basis="rectifier", identification_rate=100.0, reference="reference"
    )
    options = {"fs": 100.0, "nperseg": 512, "window": np.hanning(512)}
    frequency, density = sps.welch(r.torque, **options)
    inside = np.isin(frequency, spectra["frequency"])
    np.testing.assert_allclose(spectra["torque"], density[inside], rtol=1e-9)
    coherence = sps.coherence(r.inputs[:, 0], r.torque, **options)[1]
    np.testing.assert_allclose(spectra["coherence"], coherence[inside], rtol=1e-9)


def test_valid_methods_run_with_their_options(closed):
    opened = simulate(seed=1, closed_loop=False)
    for loop, trial in (
        ("closed", closed),
        ("open", opened),
        ("undecided", opened.drop_vars("reference")),
    ):
        check = check_trial(trial)
        assert (check.loop, bool(check.methods)) == (loop, True)
        for method, options in check.methods.items():
            assert np.isfinite(identify(trial, method, **options).stiffness["K"]), (loop, method)


def test_the_sign_is_detected(closed):
    for trial in (
        closed,
        simulate(seed=2, reflex_gain=15.0, voluntary=1.0),
        simulate(seed=3, closed_loop=False),
    ):
        assert find(check_trial(trial), "sign of the torque").verdict == "ok"
        flipped = check_trial(trial.assign(torque=-trial["torque"]))
        assert flipped.verdict == "refused"
        assert "Set torque_sign: -1" in find(flipped, "sign of the torque").text
        # Checks that rest on the sign are not made.
        assert (flipped.loop, flipped.methods) == ("undecided", {})
        assert not {"loop", "methods"} & {finding.name for finding in flipped.findings}


@pytest.mark.parametrize("closed_loop", [True, False])
def test_the_sign_that_is_set_is_that_of_the_file(closed_loop):
    """What turns the torque round is the opposite of the sign that the trial was read with."""
    trial = simulate(seed=1, duration=20.0, closed_loop=closed_loop)
    turned = trial.assign(torque=-trial["torque"]).assign_attrs(torque_sign=-1)
    assert "Set torque_sign: 1 (" in find(check_trial(turned), "sign of the torque").text
    (text,) = identify(turned, "riv").diagnostics["data_warnings"]
    assert "Set torque_sign: 1 (" in text
    both = check_trial([turned, simulate(seed=2, duration=20.0, closed_loop=closed_loop)])
    assert "trial 1 of 2: " in find(both, "sign of the torque").text


def test_feedback_is_not_taken_for_a_wrong_sign():
    """Least squares gives a negative viscosity here, although the torque has the right sign."""
    trial = simulate(seed=5, load=(0.1, 10.0, 100.0), reflex_gain=25.0, voluntary=1.0)
    assert identify(trial, "pr-moesp", basis="rectifier").stiffness["B"] < 0
    assert find(check_trial(trial), "sign of the torque").verdict == "ok"


def test_without_a_reference_the_loop_cannot_be_decided(closed):
    check = check_trial(closed.drop_vars("reference"))
    assert check.verdict == "warning"
    assert check.loop == "undecided"
    assert "cannot be told without a usable reference" in find(check, "loop").text
    other = simulate(seed=9)["reference"].values
    swapped = check_trial(closed.assign(reference=closed["reference"].copy(data=other)))
    assert "too weak an instrument" in find(swapped, "reference").text
    assert swapped.loop == "undecided"


def test_drift_is_detected_and_can_be_removed(closed):
    t = closed["time"].values / 50.0
    drifting = closed.assign(torque=closed["torque"] + 30.0 * t**2 - 8.0 * t)
    check = check_trial(drifting)
    assert find(check, "drift").verdict == "warning"
    assert check.remedy == {"drift": 1}
    level = remove_drift(drifting, 2)
    assert find(check_trial(level), "drift").verdict == "ok"
    difference = level["torque"] - remove_drift(closed, 2)["torque"]
    assert float(np.abs(difference).max()) < 1e-9


def test_a_torque_that_is_unrelated_to_the_movement(closed):
    noise = np.random.default_rng(1).standard_normal(closed.sizes["time"])
    check = check_trial(closed.assign(torque=closed["torque"].copy(data=noise)))
    assert find(check, "coherence").verdict != "ok"


def test_merged_trials_have_the_worst_finding_and_its_trial():
    whole = simulate(seed=1, duration=30.0, closed_loop=False)
    trials = [segment(whole, start, start + 10.0) for start in (0.0, 10.0, 20.0)]
    check = check_trial(trials)
    assert check.loop == "open"
    single = {name for name, method in JOINT_METHODS.items() if not method.merges}
    assert {*JOINT_METHODS} - {*check.methods} == single
    assert find(check, "length").text.startswith(
        "3 trials of 10 s or more, 30 s at 1000 Hz, without gaps in time"
    )
    assert find(check, "drift").text.startswith("all 3 trials pass; the first: ")
    assert find(check, "methods").text.startswith("of those that merge trials, ")
    trials[1] = trials[1].assign(torque=-trials[1]["torque"])
    check = check_trial(trials)
    assert check.verdict == "refused"
    assert find(check, "sign of the torque").text.startswith("trial 2 of 3: ")
    with pytest.raises(DataError, match="no trials"):
        check_trial([])


def test_an_identification_warns_of_what_the_check_finds():
    trial = simulate(seed=1, duration=20.0)
    trial["torque"] = trial["torque"].clip(-6.0, 6.0)
    trial["position"][4000:5000] = trial["position"][4000]
    reasons = [
        f.text
        for f in check_trial(trial).findings
        if f.verdict != "ok" and f.name not in ("length", "loop")
    ]
    assert len(reasons) >= 2
    assert set(identify(trial, "riv").diagnostics["data_warnings"]) == set(reasons)
