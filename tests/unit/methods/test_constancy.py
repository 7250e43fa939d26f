"""Whether a joint is the same from the beginning to the end of a record, and in all trials that are merged."""

import numpy as np
import pytest

from ankleloop import identify, simulate
from ankleloop.methods.riv.constancy import NAMES, compare_parts, divide

MIDDLE = 25_000  # sample of a record of 50 s
RNG = np.random.default_rng(3)


def change_torque(trial, change):
    torque = change(trial["torque"].to_numpy())
    return trial.assign(torque=trial["torque"].copy(data=torque))


def double_later(torque):
    return np.where(np.arange(torque.size) < torque.size // 2, torque, 2.0 * torque)


def lose_samples(torque):
    return np.concatenate([torque[:MIDDLE], torque[MIDDLE + 20 :], np.full(20, torque[-1])])


def delay(torque):
    return np.concatenate([np.full(8, torque[0]), torque[:-8]])


def warnings_of(trials):
    return identify(trials, "riv").diagnostics["warnings"]


@pytest.fixture(scope="module")
def trial():
    return simulate(seed=5)


@pytest.fixture(scope="module")
def trials():
    return [simulate(seed=seed, duration=10.0) for seed in range(50, 56)]


def test_a_gain_that_doubles_is_told_with_its_size(trial):
    (text,) = warnings_of(change_torque(trial, double_later))
    assert text.startswith("from the middle on K is ")
    assert "look for a gain that did" in text
    for name in NAMES:
        words = text.split(f"{name} is ")[1]
        assert float(words.split()[0]) == pytest.approx(2.0, abs=0.25), name


def test_lost_samples_are_a_change_from_the_middle_on(trial):
    (text, *_) = warnings_of(change_torque(trial, lose_samples))
    assert text.startswith("from the middle on ")
    assert "samples that were lost" in text or "samples were lost" in text


@pytest.mark.parametrize("number", [1, 4, 6])
def test_a_trial_of_another_stiffness_is_named_and_widens_the_intervals(trials, number):
    others = list(trials)
    others[number - 1] = simulate(seed=60, duration=10.0, stiffness=210.0)
    estimate = identify(others, "riv")
    (text,) = estimate.diagnostics["warnings"]
    assert text.startswith(f"trial {number} of 6 differs: K ")
    stated = float(text.split(": K ")[1].split()[0])
    rest = identify(others[: number - 1] + others[number:], "riv")
    own = identify(others[number - 1], "riv").stiffness["K"] / rest.stiffness["K"] - 1.0
    assert stated == pytest.approx(100.0 * own, rel=0.3)
    assert "leave it out" in text
    assert estimate.diagnostics["intervals"] == "between trials"
    low, high = estimate.intervals["K"]
    good_low, good_high = identify(trials, "riv").intervals["K"]
    assert high - low > 3.0 * (good_high - good_low)
    assert low < 150.0 + 60.0 / 6.0 < high


def test_a_trial_that_was_recorded_late_is_named_as_such(trials):
    others = [trials[0], change_torque(trials[1], delay), *trials[2:]]
    (text, *_) = warnings_of(others)
    assert text.startswith("trial 2 of 6 differs: the torque is recorded ")
    assert "later than in the others" in text
    assert 3.0 < float(text.split("recorded ")[1].split()[0]) < 8.0


@pytest.mark.parametrize("settings", [{}, {"voluntary": 0.5}, {"load": (0.1, 10.0, 100.0)}])
def test_trials_of_one_joint_do_not_differ(settings):
    estimate = identify(
        [simulate(seed=seed, duration=10.0, **settings) for seed in range(80, 85)], "riv"
    )
    assert estimate.diagnostics["warnings"] == []
    assert estimate.diagnostics["intervals"] == "asymptotic"


def test_intervals_that_are_asked_for_are_not_those_between_trials(trials):
    others = [*trials[:5], simulate(seed=60, duration=10.0, stiffness=210.0)]
    for kind in ("asymptotic", "robust"):
        assert identify(others, "riv", intervals=kind).diagnostics["intervals"] == kind


def test_a_joint_that_changes_slowly_and_little_has_the_mean(trial):
    """K goes up and down by 4 %: its mean is right, and nothing is said."""
    changing = simulate(seed=5, variation="time", stiffness_variation=0.04)
    estimate = identify(changing, "riv")
    assert estimate.diagnostics["warnings"] == []
    low, high = estimate.intervals["K"]
    assert low < 150.0 < high


def test_a_record_is_halved_and_trials_are_parts():
    starts, shares = divide([101])
    assert starts.tolist() == [0, 50]
    assert shares == pytest.approx([50 / 101, 51 / 101])
    starts, shares = divide([30, 10, 60])
    assert starts.tolist() == [0, 30, 40]
    assert shares == pytest.approx([0.3, 0.1, 0.6])


def test_parts_of_a_regression_deviate_as_their_own_regressions_do():
    """With equal parts and orthonormal regressors, what a part contributes gives its own least squares."""
    parts = [np.linalg.qr(RNG.standard_normal((50, 4)))[0] for _ in range(3)]
    targets = [RNG.standard_normal(50) for _ in parts]
    own = np.array([part.T @ target for part, target in zip(parts, targets, strict=True)])
    whole = own.mean(axis=0)
    sums = np.array(
        [part.T @ (target - part @ whole) for part, target in zip(parts, targets, strict=True)]
    ).T
    rows = dict(zip(NAMES, np.eye(4), strict=True))
    covariance = np.eye(4) / 3.0
    constancy = compare_parts(sums, np.full(3, 1 / 3), 3.0 * np.eye(4), covariance, rows)
    for number, name in enumerate(NAMES):
        np.testing.assert_allclose(constancy.deviations[name], own[:, number] - whole[number])
        np.testing.assert_allclose(constancy.errors[name], np.sqrt(2.0 / 3.0))
    expected = np.cov(own.T) / 3.0
    np.testing.assert_allclose(constancy.covariance, expected, atol=1e-12)
    assert 0.0 < constancy.probability < 1.0
