from pathlib import Path

import pytest
from pydantic import ValidationError

from ankleloop.studies.sweep_settings import SweepSettings, check_sweep

ROOT = Path(__file__).parents[3]
VARIED, METHODS = ["reflex_gain", "riv.delay"], ["riv", "pr-moesp"]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"quantities": ["vaf_net_tru"]}, "no quantity 'vaf_net_tru' \\(did you mean 'vaf_net_true'"),
        ({"quantities": ["K", "K"]}, "quantities: 'K' is listed twice"),
        ({"quantities": []}, "at least 1"),
        ({"difference": ["riv"]}, "at least 2"),
        ({"difference": ["riv", "riv"]}, "difference: 'riv' is listed twice"),
        ({"band": "median"}, "'mean' or 'trials'"),
        ({"panels": ["K"]}, "panels"),
    ],
)
def test_wrong_settings_are_refused(values, message):
    with pytest.raises(ValidationError, match=message):
        SweepSettings(**values)


@pytest.mark.parametrize(
    ("values", "varied", "message"),
    [
        ({"methods": ["moesp"]}, VARIED, "methods: there is no method 'moesp'"),
        ({"difference": ["riv", "eiv"]}, VARIED, "difference: there is no method 'eiv'"),
        ({"axes": ["voluntary"]}, VARIED, "axes: there is no varied parameter 'voluntary'"),
        ({}, [], "no setting and no option differs"),
        ({"quantities": ["vaf_reflex_measured"]}, VARIED, "against: null has no vaf_reflex_measured; it has vaf_net"),
    ],
)
def test_pictures_of_what_a_study_lacks_are_refused(values, varied, message):
    with pytest.raises(ValueError, match=message):
        check_sweep(SweepSettings(**values), varied, METHODS)


def test_what_a_study_has_is_accepted():
    settings = SweepSettings(methods=["riv"], difference=["pr-moesp", "riv"], axes=["riv.delay", "reflex_gain"])
    check_sweep(settings, VARIED, METHODS)


def test_scores_against_the_measured_torque_have_no_truth():
    settings = SweepSettings(quantities=["K_error", "vaf_net_true"])
    with pytest.raises(ValueError, match="against: measured has no vaf_net_true; it has vaf_net_measured"):
        check_sweep(settings, VARIED, METHODS, "measured")
