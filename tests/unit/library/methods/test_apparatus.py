"""The method for a device without a subject, against devices whose parameters are known."""

import os
from pathlib import Path

import numpy as np
import pytest
from scipy import signal

from ankleloop import (
    check_trial,
    identify,
    load_estimate,
    new_trial,
    read_trial,
    save_estimate,
    segment,
    simulate,
    subtract,
)
from ankleloop.errors import DataError
from ankleloop.joint.prepared import prepare
from ankleloop.methods.apparatus import is_device
from ankleloop.signals.decimation import differentiate

RATE = 1000.0
SERVO = 2 * np.pi * 10.0  # rad/s


def slide(*, friction, noise, seed=1, duration=40.0, inertia=2.0, viscosity=5.0, stiffness=0.0):
    """A slide in a closed loop: its command, through a servo, and a disturbance that moves it as well."""
    rng = np.random.default_rng(seed)
    samples = int(duration * RATE)
    command = 0.1 * np.repeat(rng.integers(0, 2, samples // 500) - 0.5, 500)
    smooth = signal.lfilter(*servo([SERVO**2]), command)
    disturbance = noise * signal.lfilter(*servo([SERVO**2]), rng.standard_normal(samples))
    # The disturbance moves the slide, and is measured as a torque.
    position = smooth + 0.004 * signal.lfilter(*servo([SERVO**2]), disturbance)
    velocity = differentiate(position, RATE)
    acceleration = differentiate(velocity, RATE)
    torque = inertia * acceleration + viscosity * velocity + stiffness * position
    torque += friction * np.sign(velocity) - 3.0 - disturbance
    return new_trial(position, torque, RATE, command)


def servo(numerator):
    """Numerator and denominator of a low-pass of the second order at the recording rate."""
    denominator = [1.0, 1.6 * SERVO, SERVO**2]
    top, bottom, _ = signal.cont2discrete((numerator, denominator), 1 / RATE, "bilinear")
    return top.ravel(), bottom


@pytest.fixture(scope="module")
def rough():
    return slide(friction=4.0, noise=20.0)


def test_without_noise_every_parameter_is_that_of_the_device():
    trial = slide(friction=4.0, noise=0.0, stiffness=30.0)
    estimate = identify(trial, "apparatus")
    truth = {"K": 30.0, "B": 5.0, "I": 2.0, "friction": 4.0, "offset": -3.0}
    for name, value in truth.items():
        assert estimate[name] == pytest.approx(value, rel=0.01), name
    assert estimate.vaf_net > 99.9


def test_fed_back_torque_does_not_bias_it_and_intervals_hold_the_truth():
    truth = {"B": 5.0, "I": 2.0, "friction": 4.0, "offset": -3.0}
    held = []
    for seed in range(20):
        estimate = identify(slide(friction=4.0, noise=20.0, seed=seed), "apparatus")
        intervals = estimate.intervals
        held += [intervals[name][0] < value < intervals[name][1] for name, value in truth.items()]
    assert np.mean(held) > 0.88


def test_least_squares_on_the_same_record_is_biased(rough):
    instrumental = identify(rough, "apparatus")
    direct = identify(rough, "apparatus", reference="position")
    low, high = instrumental.intervals["B"]
    assert low < 5.0 < high
    assert not low < direct["B"] < high


def test_a_stiffness_that_the_record_does_not_show_is_zero_and_said(rough):
    estimate = identify(rough, "apparatus")
    assert estimate["K"] == 0.0
    assert estimate.diagnostics["missing"] == ["K: the record shows no stiffness, so it is 0."]
    assert set(estimate.intervals) == {"B", "I", "friction", "offset"}


def test_a_torque_of_the_other_sign_is_warned_about(rough):
    estimate = identify(rough.assign(torque=-rough["torque"]), "apparatus")
    warnings = " ".join(estimate.warnings)
    assert "I = -2 kg·m² is negative, which no device has: check signs" in warnings


def test_its_band_ends_where_it_is_told(rough):
    estimate = identify(rough, "apparatus", highest_frequency=10.0)
    assert estimate.diagnostics["noise_frequency"].max() == pytest.approx(10.0, abs=0.05)
    assert estimate["I"] == pytest.approx(2.0, rel=0.05)


def test_it_predicts_another_record_and_its_file_is_read(rough, tmp_path):
    estimate = identify(rough, "apparatus")
    save_estimate(estimate, tmp_path / "empty.nc")
    same = load_estimate(tmp_path / "empty.nc")
    other = slide(friction=4.0, noise=0.0, seed=2)
    assert same.predict(other).vaf_net > 99.5
    assert "ankleloop" in estimate.methods_text()
    assert "reflex delay" not in repr(estimate)


def test_a_check_offers_it_for_a_device_and_not_for_a_joint(rough):
    check = check_trial(rough)
    assert check.verdict != "refused"
    assert check.methods["apparatus"] == {}
    assert "device without a subject" in check.findings[-1].text
    joint = check_trial(simulate(seed=1, duration=30.0))
    assert "apparatus" not in joint.methods
    assert "device" not in joint.findings[-1].text


@pytest.mark.parametrize(
    ("settings", "friction", "expected"),
    [
        ({"reflex_gain": 0.0}, 0.0, False),  # a passive joint
        ({"reflex_gain": 0.0}, 2.0, True),  # a spring on a bearing
        ({"reflex_gain": 13.0}, 2.0, False),  # a joint on a bearing
    ],
)
def test_a_device_has_friction_and_no_reflex(settings, friction, expected):
    trial = simulate(seed=1, duration=30.0, **settings)
    velocity = differentiate(trial["position"].values, RATE)
    rubbed = trial.assign(torque=trial["torque"] + friction * np.sign(velocity))
    assert is_device([prepare(rubbed)], "reference", 100.0) is expected


@pytest.mark.skipif(
    "ANKLELOOP_RECORDINGS" not in os.environ,
    reason="set ANKLELOOP_RECORDINGS to the folder with DATA_EMPS.mat to run this",
)
def test_a_machine_in_closed_loop_has_the_published_parameters():
    """M, Fv and Fc of Janot, Gautier and Brunot (2019), by least squares of the inverse model."""
    trial = read_trial(
        Path(os.environ["ANKLELOOP_RECORDINGS"], "DATA_EMPS.mat"),
        position="qm",
        torque="vir",
        reference="qg",
        position_unit=1.0,
        torque_unit=35.15,
    )
    check = check_trial(trial)
    assert check.verdict != "refused"
    assert "apparatus" in check.methods
    published = {"I": (95.11, 0.01), "B": (203.5, 0.04), "friction": (20.39, 0.04)}
    for highest in (None, 20.0, 10.0):
        estimate = identify(trial, "apparatus", highest_frequency=highest)
        for name, (value, share) in published.items():
            assert estimate[name] == pytest.approx(value, rel=share), (highest, name)
        assert not estimate.warnings
    middle = 0.5 * float(trial["time"][-1])
    apparatus = identify(segment(trial, 0.0, middle), "apparatus")
    other = segment(trial, middle, 2.0 * middle)
    assert apparatus.predict(other).vaf_net > 99.5
    with pytest.raises(DataError, match="say nothing about the joint"):
        identify(subtract(other, apparatus))


@pytest.mark.parametrize("seed", range(20))
def test_a_rotor_without_a_spring_gets_no_advice_about_signs(seed):
    rotor = make_rotor(seed)
    estimates = [identify(rotor, method) for method in ("apparatus", "riv")]
    texts = [text for estimate in estimates for text in [*estimate.warnings, *estimate.remarks]]
    texts += check_trial(rotor).reasons
    assert not [text for text in texts if "sign" in text]


def make_rotor(seed):
    """I 0.001, B 0.12, 60 s at 200 Hz, with noise in the torque behind the recorder's filter."""
    rng = np.random.default_rng(seed)
    fine = 2000.0
    samples = int(62 * fine)
    command = 0.04 * np.repeat(rng.integers(0, 2, samples // 200) - 0.5, 200)
    top, bottom, _ = signal.cont2discrete(
        ([(2 * SERVO) ** 2], [1.0, 3.2 * SERVO, (2 * SERVO) ** 2]), 1 / fine, "bilinear"
    )
    position = signal.lfilter(top.ravel(), bottom, command)
    velocity = np.gradient(position, 1 / fine)
    torque = 0.001 * np.gradient(velocity, 1 / fine) + 0.12 * velocity
    filters = signal.bessel(4, 60.0, fs=fine, norm="phase", output="sos")
    channels = [position, torque, command, rng.standard_normal(samples)]
    position, torque, command, noise = (
        signal.sosfilt(filters, channel)[2000::10][: 60 * 200] for channel in channels
    )
    torque = torque + 0.3 * torque.std() / noise.std() * noise
    return new_trial(position, torque, 200.0, command)
