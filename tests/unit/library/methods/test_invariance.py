"""Units and origins are a matter of choice: they change an estimate as physics says, and in no other way."""

import numpy as np
import pytest
from method_options import basis_options

from ankleloop import identify, simulate
from ankleloop.joint.prepared import prepare
from ankleloop.methods.registry import JOINT_METHODS

VARIANTS = [
    *(
        (method, options)
        for method in JOINT_METHODS
        for options in basis_options(method, "chebyshev", "spline", "rectifier")
    ),
    ("pr-moesp", {"basis": "rectifier", "input_matrices": "instruments"}),
    ("pr-moesp", {"free_b": True}),
]
LINEAR = ("K", "B", "I", "G")
TOLERANCE = (
    1e-6  # of the parameters: least squares on nearly dependent Hankel rows multiplies rounding
)
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
    return trial.assign(
        {name: factor * trial[name] + constant for name, factor, constant in values}
    )


def check_estimate(changed, estimate, of_parameters=1.0, of_torques=1.0):
    """K, B, I, G and torques times a factor; all else as before, but for the threshold, which is a velocity."""
    for values, others in (
        (estimate.stiffness, changed.stiffness),
        (estimate.reflex, changed.reflex),
    ):
        assert set(values) == set(others)
        for name in set(values) - {"threshold"}:
            expected = values[name] * (of_parameters if name in LINEAR else 1.0)
            assert others[name] == pytest.approx(expected, rel=TOLERANCE), name
    check_torques(changed, estimate, of_torques)


def check_torques(changed, estimate, factor=1.0):
    for name, torque in estimate.torque.items():
        scale = factor * float(torque.std())
        np.testing.assert_allclose(
            changed.torque[name].values, factor * torque.values, atol=1e-5 * scale, rtol=0
        )


@pytest.mark.parametrize("variant", VARIANTS, ids=str)
def test_factors_are_those_of_the_parameters(trial, estimates, variant):
    (method, options), estimate, rng = variant, estimates[str(variant)], np.random.default_rng(1)
    factor = 10.0 ** rng.uniform(-3, 3)
    check_estimate(
        identify(change(trial, (1.0, factor, 1.0)), method, **options), estimate, factor, factor
    )
    factor = 10.0 ** rng.uniform(-2, 0.5)
    changed = identify(change(trial, (factor, 1.0, factor)), method, **options)
    check_estimate(changed, estimate, 1.0 / factor)
    if "threshold" in estimate.reflex:
        assert changed.reflex["threshold"] == pytest.approx(
            factor * estimate.reflex["threshold"], rel=1e-3, abs=1e-6
        )


@pytest.mark.parametrize("variant", VARIANTS, ids=str)
@pytest.mark.parametrize("start", [-7.0, 100.0])
def test_constants_and_the_start_of_the_time_change_nothing(trial, estimates, variant, start):
    other = change(trial, constants=(0.3 * start % 3, start, -2.0)).assign_coords(
        time=trial["time"] + start
    )
    other["time"].attrs = trial["time"].attrs
    estimate, changed = estimates[str(variant)], identify(other, variant[0], **variant[1])
    check_estimate(changed, estimate)
    assert changed.diagnostics["warnings"] == estimate.diagnostics["warnings"]
    np.testing.assert_allclose(changed.torque["time"] - start, estimate.torque["time"], atol=1e-9)
    if estimate.predictor is not None:
        other = simulate(seed=2, duration=5.0)
        moved = change(other, constants=(0.7, -40.0, 2.0)).assign_coords(time=other["time"] + 50.0)
        check_torques(estimate.predict(moved), estimate.predict(other))
