"""Whether a joint is the same from the beginning to the end of a record, and in all trials that are merged."""

import numpy as np
import pytest

from ankleloop import DataError, identify, simulate
from ankleloop.methods.riv.constancy import Constancy


def change_torque(trial, change):
    torque = change(trial["torque"].to_numpy())
    return trial.assign(torque=trial["torque"].copy(data=torque))


def double_later(torque):
    return np.where(np.arange(torque.size) < torque.size // 2, torque, 2.0 * torque)


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


@pytest.mark.parametrize("method", ["riv", "riv-tv"])
def test_a_gain_that_doubles_is_told_with_its_size(trial, method):
    options = {} if method == "riv" else {"cycle_onsets": np.arange(0.0, 48.0)}
    doubled = change_torque(trial, double_later)
    (text,) = identify(doubled, method, **options).diagnostics["warnings"]
    assert text.startswith("from the middle on K, B, I and G are ")
    assert "a gain of position or torque" in text
    assert float(text.split(" are ")[1].split()[0]) == pytest.approx(2.0, abs=0.2)


def test_a_reflex_in_the_middle_alone_is_told(trial):
    """Of which the halves have the same share."""
    without = simulate(seed=5, reflex_gain=0.0)
    is_middle = np.abs(np.arange(trial.sizes["time"]) / trial.sizes["time"] - 0.5) < 1 / 6
    mixed = trial.copy()
    for name in ("position", "torque"):
        mixed[name] = ("time", np.where(is_middle, trial[name], without[name]))
    (text,) = identify(mixed, "riv").fit_warnings
    assert text.startswith("in the middle half G ")


@pytest.mark.parametrize("seed", range(2))
def test_a_gain_that_drifts_is_told_with_its_size(seed):
    drifting = simulate(seed=seed)
    drifting["torque"] = drifting["torque"] * np.linspace(1.0, 1.3, drifting.sizes["time"])
    (text,) = identify(drifting, "riv").warnings
    assert text.startswith("from the middle on K, B, I and G are ")
    ratio = float(text.split(" are ")[1].split()[0])
    assert ratio == pytest.approx(1.225 / 1.075, abs=0.05)


def test_a_joint_that_changes_is_remarked_and_its_means_are_trusted():
    """Its inertia does not change with it."""
    changing = simulate(
        seed=3,
        variation="time",
        stiffness_table=tuple(np.linspace(180.0, 110.0, 10)),
        gain_table=tuple(np.linspace(19.0, 8.0, 10)),
    )
    estimate = identify(changing, "riv")
    assert estimate.trusted
    (text,) = estimate.remarks
    assert text.startswith("from the middle on K is ")
    assert "the values are means over the record" in text


@pytest.mark.parametrize("number", [1, 6])
def test_a_trial_of_another_stiffness_is_named_and_widens_the_intervals(trials, number):
    others = list(trials)
    others[number - 1] = simulate(seed=60, duration=10.0, stiffness=210.0)
    estimate = identify(others, "riv")
    (text,) = estimate.diagnostics["warnings"]
    assert text.startswith(f"trial {number} of 6 differs: K ")
    own, rest = (
        identify(part, "riv").stiffness["K"]
        for part in (others[number - 1], others[: number - 1] + others[number:])
    )
    stated = float(text.split(": K ")[1].split()[0])
    assert stated == pytest.approx(100.0 * (own / rest - 1.0), rel=0.3)
    assert estimate.diagnostics["intervals"] == "between trials"
    widths = [np.ptp(each.intervals["K"]) for each in (estimate, identify(trials, "riv"))]
    assert widths[0] > 3.0 * widths[1]
    # A covariance between six trials has rank five, so that its correlations are near one.
    text = repr(estimate)
    assert "intervals: for the mean over all trials like these (6)" in text
    assert "correlated: cannot be judged" in text
    assert estimate.correlation.empty


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


@pytest.mark.parametrize("method", ["riv", "riv-tv"])
def test_intervals_between_trials_can_be_asked_for(trials, method):
    options = {} if method == "riv" else {"cycle_onsets": [np.arange(0.0, 9.0)] * len(trials)}
    usual = identify(trials, method, **options)
    estimate = identify(trials, method, intervals="between trials", **options)
    assert estimate.stiffness == usual.stiffness
    assert "intervals: for the mean over these trials (6)" in repr(usual)
    assert (estimate.diagnostics["intervals"], estimate.freedom) == ("between trials", 5)
    assert "for the mean over all such trials" in estimate.methods_text()
    with pytest.raises(DataError, match=r"intervals between trials need several trials"):
        identify(trials[0], method, intervals="between trials")


def test_a_passive_trial_is_told_in_units():
    """A reflex over one of nearly zero would be thousands of per cent."""
    passive = [simulate(seed=seed, duration=20.0, reflex_gain=0.0) for seed in (1, 2, 3)]
    texts = identify([*passive, simulate(seed=4, duration=20.0)], "riv").warnings
    assert texts[-1].startswith("trial 4 of 4 differs: G +1")
    assert " N·m·s/rad: " in texts[-1]


def test_the_variance_between_trials_is_that_of_a_mean():
    """Of n equal trials s²/n, with the standard deviation s that divides by n - 1."""
    deviations = np.array([[1.0, -2.0, 4.0, -3.0]])
    constancy = Constancy(
        merged=True,
        shares=np.full(4, 0.25),
        influence=deviations,
        deviations={},
        errors={},
        scores=np.zeros(4),
        probability=0.0,
        scatter=np.zeros((4, 4)),
    )
    assert constancy.covariance.item() == pytest.approx(np.var(deviations, ddof=1) / 4)
