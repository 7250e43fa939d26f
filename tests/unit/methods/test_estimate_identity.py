"""Estimates as values: equal ones have one hash, and a prediction of a prediction is a prediction."""

from dataclasses import replace

from ankleloop import identify, simulate


def test_equal_estimates_are_one_key(noisy):
    estimate, other = identify(noisy, "pr-moesp"), identify(noisy, "pr-moesp")
    stiffness = {name: estimate.stiffness[name] for name in ("I", "K", "B")}
    turned = replace(other, stiffness=stiffness)  # in another order
    assert estimate == other == turned
    assert hash(estimate) == hash(other) == hash(turned)
    riv = identify(noisy, "riv")
    assert {estimate, other, turned, riv} == {riv, turned}
    assert {estimate: 1}[other] == 1


def test_predictions_do_not_repeat_warnings(noisy):
    wide = simulate(seed=2, duration=10.0, amplitude=0.1)
    estimate = identify(noisy, "pr-moesp")
    prediction = estimate.predict(wide)
    warnings = prediction.diagnostics["warnings"]
    assert len(warnings) == len(estimate.diagnostics["warnings"]) + 1
    again = prediction.predict(wide)
    assert again == prediction
    assert again.diagnostics["warnings"] == warnings
    # Of a trial within the range there is none left.
    back = again.predict(noisy)
    assert back.diagnostics["warnings"] == estimate.diagnostics["warnings"]
