"""The contract of a trial: each fault is refused by a message that names it."""

import numpy as np
import pytest

from ankleloop.errors import DataError
from ankleloop.signals.sampling import compute_rate
from ankleloop.trials.trial import new_trial, validate

RATE = 1000.0
T = np.arange(500) / RATE
POSITION = 0.02 * np.sin(2 * np.pi * 3 * T)
TORQUE = 3.0 * np.cos(2 * np.pi * 3 * T)
REFERENCE = 0.02 * np.sign(POSITION + 1e-9)


@pytest.fixture
def trial():
    return new_trial(
        POSITION, TORQUE, RATE, REFERENCE, torque_reflex=TORQUE / 3, seed=7, subject="S1"
    )


@pytest.mark.parametrize("name", ["position", "reference", "torque_reflex"])
def test_samples_must_be_finite(trial, name):
    trial[name][[123, 200]] = -np.inf
    message = rf"^x: {name} is not finite at sample 123 \(0.123 s\), 2 samples in all: cut .* or repair the channel"
    with pytest.raises(DataError, match=message):
        validate(trial, source="x")


def test_constant_true_torques_and_two_samples_are_accepted():
    assert new_trial([0.0, 0.001], [1.0, 2.0], RATE, torque_voluntary=np.zeros(2)).time.size == 2


@pytest.mark.parametrize("rate", [1000.0, 5000.0, 20000.0])
def test_position_noise_is_accepted(rate):
    time = np.arange(int(rate)) / rate
    noise = 0.01 * np.random.default_rng(1).standard_normal(time.size)
    position = 0.02 * np.sin(2 * np.pi * 3 * time) + noise
    assert np.max(np.abs(np.diff(position))) * rate > 20.0
    new_trial(position, np.cos(time), rate)


def test_another_type_is_refused(trial):
    single = trial.assign(position=trial.position.astype("float32"))
    with pytest.raises(
        DataError, match=r"position is of type float32 .*, not one float64 for each"
    ):
        validate(single)


def test_a_trial_with_times_needs_no_sampling_rate(trial):
    assert validate(trial.drop_attrs()).attrs == {"sampling_rate": RATE}


@pytest.mark.parametrize(
    ("sample", "message"),
    [
        (0.30004, r"irregular at sample 300 \(0.30004 s\)"),
        (np.nan, "not finite at sample 300: rep"),
    ],
)
def test_time_must_be_regular(trial, sample, message):
    time = np.where(np.arange(500) == 300, sample, T)
    with pytest.raises(DataError, match=message):
        validate(trial.assign_coords(time=("time", time)))


def test_time_in_single_precision_is_regular():
    time = (np.arange(300_000) / RATE).astype(np.float32).astype(float)
    assert compute_rate(time, source="x") == pytest.approx(RATE, rel=1e-6)


@pytest.mark.parametrize("factor", [1e-18, 1e18])
def test_numbers_that_no_joint_has_are_refused(factor):
    with pytest.raises(DataError, match=r"torque varies by .*no channel of a joint does: check"):
        new_trial(POSITION, factor * TORQUE, RATE)
