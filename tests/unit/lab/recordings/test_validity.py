"""One table says which method is valid in which loop; the check and the analysis go by it."""

import pytest
from method_options import list_one_pass

from ankleloop.methods.registry import JOINT_METHODS
from ankleloop_lab.recordings.validity import describe_validity, reason_against, valid_methods

CORRELATED, UNCORRELATED = 30.0, 2.0
STATES = [("closed", True), ("open", True), ("undecided", True), ("undecided", False)]


@pytest.mark.parametrize(("loop", "reference"), STATES)
@pytest.mark.parametrize("path_bias", [CORRELATED, UNCORRELATED])
@pytest.mark.parametrize("merged", [True, False])
def test_check_and_analysis_agree(loop, reference, path_bias, merged):
    """What the check lists, with its options, is what the analysis does not refuse."""
    methods = valid_methods(loop, reference, path_bias, merged=merged)
    for name in JOINT_METHODS:
        reason = reason_against(
            name, methods.get(name, {}), loop, reference, path_bias, merged=merged
        )
        assert (reason is None) == (name in methods), name
        assert JOINT_METHODS[name].merges or not merged or name not in methods
    text = describe_validity(methods, loop, reference, path_bias, merged=merged)
    assert "  " not in text
    assert text.endswith(".")


def test_open_loop_has_every_method_if_the_perturbation_decorrelates():
    methods = valid_methods("open", True, UNCORRELATED)
    assert set(methods) == set(JOINT_METHODS)
    assert describe_validity(methods, "open", True, UNCORRELATED) == f"{', '.join(methods)}."
    assert set(JOINT_METHODS) - set(valid_methods("open", True, CORRELATED)) == list_one_pass()
    assert "one after the other" in reason_against(
        "parallel-cascade", {"max_passes": 1}, "open", True, CORRELATED
    )


@pytest.mark.parametrize("loop", ["closed", "undecided"])
def test_least_squares_and_the_position_are_refused_unless_the_loop_is_open(loop):
    state = loop, True, CORRELATED
    assert f"the loop is {loop}" in reason_against("pr-moesp", {}, *state)
    instruments = {"input_matrices": "instruments"}
    assert reason_against("pr-moesp", instruments, *state) is None
    for method, options in (("riv", {}), ("eiv-moesp", instruments)):
        assert "open loop only" in reason_against(
            method, {**options, "reference": "position"}, *state
        )
    for method in ("moesp", "parallel-cascade", "real-time"):
        assert "not valid in closed loop" in reason_against(method, {}, *state)
