"""Units and origins are a matter of choice: they change an estimate as physics says, and in no other way."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ankleloop import METHODS, identify, simulate
from ankleloop.joint.prepared import prepare

OWN_BASIS = ("parallel-cascade", "real-time", "riv-tv")  # have the rectifier alone
VARIANTS = [
    *((method, {"basis": basis}) for method in METHODS if method not in OWN_BASIS for basis in ("chebyshev", "spline")),
    *((method, {"basis": "rectifier"}) for method in METHODS),
    ("pr-moesp", {"basis": "rectifier", "input_matrices": "instruments"}),
    ("pr-moesp", {"free_b": True}),
    ("parallel-cascade", {"max_passes": 1, "rank": "mdl"}),
    ("riv", {"delay": None}),
]
PREDICTING = [variant for variant in VARIANTS if variant[0] != "real-time"]
FEW = settings(max_examples=2, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
LINEAR = ("K", "B", "I", "G")
TOLERANCE = 1e-6  # of the parameters: least squares on nearly dependent Hankel rows multiplies rounding
CHANNELS = ("position", "torque", "reference")


@pytest.fixture(scope="module")
def trial():
    return simulate(seed=1, duration=20.0, voluntary=0.2)


@pytest.fixture(scope="module")
def estimates(trial):
    prepared = prepare(trial)
    return {str(variant): identify(prepared, variant[0], **variant[1]) for variant in VARIANTS}


def change(trial, factors=(1.0, 1.0, 1.0), constants=(0.0, 0.0, 0.0)):
    """The trial with factors and constants for position, torque and reference."""
    values = zip(CHANNELS, factors, constants, strict=True)
    return trial.assign({name: factor * trial[name] + constant for name, factor, constant in values})


def check_parameters(changed, estimate, factor=1.0):
    """K, B, I and G times a factor; everything else as before. The threshold is a velocity, of a basis that has one."""
    for values, others in ((estimate.stiffness, changed.stiffness), (estimate.reflex, changed.reflex)):
        assert set(values) == set(others)
        for name in set(values) - {"threshold"}:
            expected = values[name] * (factor if name in LINEAR else 1.0)
            assert others[name] == pytest.approx(expected, rel=TOLERANCE), name


def check_torques(changed, estimate, factor=1.0):
    for name, torque in estimate.torque.items():
        scale = factor * float(torque.std())
        np.testing.assert_allclose(changed.torque[name].values, factor * torque.values, atol=1e-5 * scale, rtol=0)


@pytest.mark.parametrize("variant", VARIANTS, ids=str)
@FEW
@given(factor=st.floats(-3, 3).map(lambda exponent: 10.0**exponent))
def test_a_factor_of_the_torque_is_that_of_the_parameters(trial, estimates, variant, factor):
    estimate, changed = estimates[str(variant)], identify(change(trial, (1.0, factor, 1.0)), variant[0], **variant[1])
    check_parameters(changed, estimate, factor)
    check_torques(changed, estimate, factor)


@pytest.mark.parametrize("variant", VARIANTS, ids=str)
@FEW
@given(factor=st.floats(-2, 0.5).map(lambda exponent: 10.0**exponent))
def test_a_factor_of_the_position_divides_the_parameters(trial, estimates, variant, factor):
    estimate = estimates[str(variant)]
    changed = identify(change(trial, (factor, 1.0, factor)), variant[0], **variant[1])
    check_parameters(changed, estimate, 1.0 / factor)
    check_torques(changed, estimate)
    if "threshold" in estimate.reflex:
        assert changed.reflex["threshold"] == pytest.approx(factor * estimate.reflex["threshold"], rel=1e-3, abs=1e-6)


@pytest.mark.parametrize("variant", VARIANTS, ids=str)
@FEW
@given(
    constants=st.tuples(st.floats(-3, 3), st.floats(-100, 100), st.floats(-3, 3)), start=st.sampled_from([-7.0, 100.0])
)
def test_constants_and_the_start_of_the_time_change_nothing(trial, estimates, variant, constants, start):
    other = change(trial, constants=constants).assign_coords(time=trial["time"] + start)
    other["time"].attrs = trial["time"].attrs
    estimate, changed = estimates[str(variant)], identify(other, variant[0], **variant[1])
    check_parameters(changed, estimate)
    check_torques(changed, estimate)
    assert changed.diagnostics["warnings"] == estimate.diagnostics["warnings"]
    np.testing.assert_allclose(changed.torque["time"] - start, estimate.torque["time"], atol=1e-9)


@pytest.mark.parametrize("variant", PREDICTING, ids=str)
def test_constants_of_another_trial_do_not_change_its_prediction(trial, estimates, variant):
    other = simulate(seed=2, duration=5.0)
    moved = change(other, constants=(0.7, -40.0, 2.0)).assign_coords(time=other["time"] + 50.0)
    estimate = estimates[str(variant)]
    check_torques(estimate.predict(moved), estimate.predict(other))


@pytest.mark.parametrize("method", METHODS)
def test_a_prepared_trial_and_a_batch_give_what_single_trials_give(trial, method):
    trials = [trial, simulate(seed=2, duration=20.0)]
    shared = [prepare(part) for part in trials]
    for other in METHODS:  # whatever other methods have computed before
        identify(shared[0], other)
    batch = [identify(part, method) for part in shared]
    for part, estimate in zip(trials, batch, strict=True):
        single = identify(part, method)
        assert single.torque.identical(estimate.torque)
        assert (single.stiffness, single.reflex, single.intervals) == (
            estimate.stiffness,
            estimate.reflex,
            estimate.intervals,
        )
        assert single.diagnostics["warnings"] == estimate.diagnostics["warnings"]
