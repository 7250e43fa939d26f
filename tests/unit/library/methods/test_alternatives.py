"""Effects that a model lacks: each is named with its size, and what it does to K, B, I and G is a warning."""

import re

import numpy as np
import pandas as pd
import pytest
from scipy import signal

from ankleloop import identify, new_trial, simulate
from ankleloop.joint.prepared import prepare
from ankleloop.joint.verdicts import TOLERANCE
from ankleloop.methods.riv.alternatives import Alternative, choose_likeliest, with_alternatives

LOADS = ((1.1, 7.1, 250.0), (0.1, 10.0, 100.0))
QUIET = {"snr_db": None, "voluntary": 0.0}
CYCLES = {"cycle_onsets": np.arange(0.0, 48.0)}


def rebuild(trial, change=lambda torque: torque, rate=1000.0, sign=1.0):
    position, torque, reference = (
        sign * trial[name].to_numpy() for name in ("position", "torque", "reference")
    )
    return new_trial(position, change(torque), rate, reference)


def high_pass(torque):
    return signal.lfilter(*signal.butter(1, 0.5, "high", fs=1000.0), torque - torque.mean())


def rub(trial):
    velocity = np.gradient(trial["position"].to_numpy(), 1e-3)
    return rebuild(trial, lambda torque: torque + 2.0 * np.tanh(velocity / 0.02))


FAULTS = {
    "ms after the position": lambda trial: rebuild(
        trial, lambda x: np.concatenate([np.full(5, x[0]), x[:-5]])
    ),
    "high-pass of 0.": lambda trial: rebuild(trial, high_pass),
    "friction of": rub,
    "in the other direction": lambda trial: rebuild(trial, sign=-1.0),
    "flat where it is large": lambda trial: rebuild(
        trial, lambda torque: 10.0 * np.tanh(torque / 10.0)
    ),
}


def stretch(trial):
    position = trial["position"].to_numpy()
    return position - position.mean()


def react(trial, size):
    """A reaction 160 ms after the movement, through a muscle of 30 ms."""
    late = np.concatenate([np.zeros(160), stretch(trial)[:-160]])
    return size * signal.lfilter(*signal.bilinear([1.0], [0.03, 1.0], 1000.0), late)


ALONE = "ask the subject not to intervene"
# Torque that an effect adds, what to do, and the numbers in its name.
JOINTS = {
    "N·m/rad against it": (lambda trial: react(trial, 60.0), ALONE, [160.0, 60.0]),
    "N·m/rad with it": (lambda trial: react(trial, -60.0), ALONE, [160.0, 60.0]),
    "crosstalk of the command": (
        lambda trial: 40.0 * trial["reference"].to_numpy(),
        "separate the cables",
        [40.0],
    ),
    "stiffness that grows": (lambda trial: 1e5 * stretch(trial) ** 3, "perturb less", []),
}


@pytest.fixture(scope="module")
def trial():
    return simulate(seed=21)


@pytest.mark.parametrize(("method", "options"), [("riv", {"delay": 0.04}), ("riv-tv", CYCLES)])
@pytest.mark.parametrize("effect", FAULTS)
def test_what_an_instrument_does_to_a_record_is_a_warning(trial, effect, method, options):
    estimate = identify(FAULTS[effect](trial), method, **options)
    text = " ".join(estimate.diagnostics["warnings"])
    assert "the model lacks something that depends on the movement" in text
    assert any(effect in row["effect"] for row in estimate.diagnostics["alternatives"])
    if effect != "in the other direction":  # many effects imitate a reflex that is absent
        assert effect in text


@pytest.mark.parametrize(("method", "options"), [("riv", {}), ("riv-tv", CYCLES)])
@pytest.mark.parametrize("effect", JOINTS)
def test_an_effect_of_subject_or_joint_is_named_with_its_size_and_shifts(
    trial, effect, method, options
):
    torque, advice, numbers = JOINTS[effect]
    estimate = identify(rebuild(trial, lambda x: x + torque(trial)), method, **options)
    (text,) = estimate.diagnostics["warnings"]
    assert effect in text
    assert advice in text
    (first, *_) = estimate.diagnostics["alternatives"]
    stated = [float(number) for number in re.findall(r"[\d.]+", first["effect"])]
    assert stated == pytest.approx(numbers, rel=0.2)
    corrected = estimate.stiffness["K"] * (1.0 + first["shifts"]["K"])
    assert corrected == pytest.approx(150.0, rel=0.1)
    low, high = estimate.intervals["K"]
    assert low <= corrected <= high


def test_two_effects_at_once_are_both_named(trial):
    torque = 60.0 * trial["reference"].to_numpy() + 1e5 * stretch(trial) ** 3
    (text,) = identify(rebuild(trial, lambda x: x + torque), "riv").diagnostics["warnings"]
    first, second = text.split("Beside it, ")
    assert "stiffness that grows with the stretch" in first
    size = second.split("crosstalk of the command in the torque of ")[1].split()[0]
    assert float(size) == pytest.approx(60.0, rel=0.15)


def test_merged_trials_have_the_effects_of_a_long_one():
    trials = [simulate(seed=seed, duration=12.0) for seed in range(5)]
    assert "alternatives" not in identify(trials, "riv").diagnostics
    crossed = [part.assign(torque=part["torque"] + 40.0 * part["reference"]) for part in trials]
    (text,) = identify(crossed, "riv").diagnostics["warnings"]
    assert "crosstalk of the command in the torque of " in text


@pytest.mark.parametrize("settings", [{}, {"load": (0.1, 10.0, 100.0)}])
@pytest.mark.parametrize(("method", "options"), [("riv", {}), ("riv-tv", CYCLES)])
def test_an_axis_that_is_turned_round_names_the_signs_of_the_file(method, options, settings):
    """Position and torque with the other sign: the rectifier sees the wrong half."""
    trial = rebuild(simulate(seed=21, **settings), sign=-1.0)
    for signs, words in (
        ({}, "position_sign=-1, torque_sign=-1 to read_trial"),
        ({"torque_sign": -1}, "position_sign=-1, torque_sign=1 to read_trial"),
        ({"position_sign": -1, "torque_sign": -1}, "position_sign=1, torque_sign=1 to read_trial"),
    ):
        diagnostics = identify(trial.assign_attrs(signs), method, **options).diagnostics
        (text,) = diagnostics["warnings"]
        assert "in the other direction" in text
        assert f"if the axis is turned round, give {words}" in text
        turned = {name: -signs.get(name, 1) for name in ("position_sign", "torque_sign")}
        assert diagnostics["remedy"] == turned


@pytest.mark.parametrize(
    ("effect", "name", "truth"),
    [("ms after the position", "I", 0.015), ("high-pass of 0.", "G", 13.0)],
)
def test_intervals_take_in_what_the_likely_cause_does(trial, effect, name, truth):
    estimate = identify(FAULTS[effect](trial), "riv")
    low, high = estimate.intervals[name]
    value = (estimate.stiffness | estimate.reflex)[name]
    assert abs(value / truth - 1.0) > 0.15
    assert low < truth < 1.1 * high
    (first, *_) = estimate.diagnostics["alternatives"]
    assert value * (1.0 + first["shifts"][name]) == pytest.approx(truth, rel=0.12)


@pytest.mark.parametrize("rate", [1000.0, 500.0])
def test_a_delay_far_from_the_assumed_one_is_a_warning(rate):
    """Also that of a record whose time is stretched: the reflex comes twice as late."""
    trial = rebuild(simulate(seed=3, delay=0.08 if rate == 1000.0 else 0.04), rate=rate)
    for method, options in (("riv", {}), ("riv", {"delay": 0.04}), ("riv-tv", CYCLES)):
        text = " ".join(identify(trial, method, **options).diagnostics["warnings"])
        assert "delay" in text, (method, options)


@pytest.mark.parametrize(
    "settings",
    [{}, {"closed_loop": False}, {"voluntary": 1.0}, QUIET, {**QUIET, "closed_loop": False}],
)
def test_a_complete_model_lacks_nothing(settings):
    trial = simulate(seed=4, **settings)
    for method, options in (("riv", {}), ("riv-tv", CYCLES)):
        estimate = identify(trial, method, **options)
        assert "alternatives" not in estimate.diagnostics
        assert estimate.diagnostics["warnings"] == []


@pytest.mark.parametrize("method", ["riv", "riv-tv"])
@pytest.mark.parametrize("settings", [{}, {"load": (0.1, 10.0, 100.0), "voluntary": 0.5}])
def test_a_passive_joint_is_a_result(settings, method):
    """K, B and I are right, G is zero within its interval, and the dynamics of no reflex are not given."""
    estimate = identify(simulate(seed=5, reflex_gain=0.0, **settings), method)
    assert estimate.diagnostics["warnings"] == []
    for name, truth in {"K": 150.0, "B": 0.8, "I": 0.015, "G": 0.0}.items():
        low, high = estimate.intervals[name]
        assert low < truth < high
    assert "omega_n" not in estimate.reflex
    assert "no reflex" in " ".join(estimate.diagnostics["missing"])


BASES = [{"basis": "spline", "degree": 8}, {"basis": "chebyshev", "degree": 8}]


@pytest.mark.parametrize("options", BASES)
def test_a_passive_joint_has_no_threshold_and_so_no_gain(options):
    """A curve of noise is a ramp by chance, of any gain."""
    for seed in (1, 2, 5):
        trial = simulate(seed=seed, duration=40.0, reflex_gain=0.0)
        estimate = identify(trial, "riv", **options)
        assert set(estimate.reflex) == {"delay"}
        assert set(estimate.intervals) == {"K", "B", "I"}
        (text,) = estimate.diagnostics["missing"]
        assert 'no reflex, as of a passive joint; basis="rectifier" gives G' in text


@pytest.mark.parametrize("options", BASES)
def test_a_threshold_is_no_turned_axis(options):
    """The ramp begins at the threshold; where few velocities exceed it there is no gain, and that is said."""
    for seed in (3, 8):
        estimate = identify(
            simulate(seed=seed, duration=50.0, reflex_threshold=0.3), "riv", **options
        )
        assert estimate.warnings == []
        low, high = estimate.intervals["G"]
        assert low < 13.0 < high
        assert high - low < 5.0
        estimate = identify(
            simulate(seed=seed, duration=50.0, reflex_threshold=0.5), "riv", **options
        )
        assert estimate.warnings == []
        assert "G" not in estimate.reflex
        assert "which only" in estimate.diagnostics["missing"][0]


def test_intervals_of_every_confidence_hold_what_the_model_lacks():
    """As those of 95 %: an effect that the record shows is no matter of confidence."""
    trial = simulate(seed=4, duration=50.0, reflex_threshold=0.2)
    estimate = identify(trial, "riv")
    shifted = estimate.stiffness["K"] * (1.0 + estimate.diagnostics["shifts"]["K"])
    low, high = estimate.interval(0.5)["K"]
    assert low <= shifted <= high
    expected = pd.DataFrame(estimate.intervals)
    pd.testing.assert_frame_equal(pd.DataFrame(estimate.interval(0.95)), expected)


@pytest.mark.parametrize("seed", range(3))
def test_what_moves_a_parameter_by_less_than_the_tolerance_is_remarked(seed):
    """A torque 0.5 ms late moves I by some per cent: the interval holds both values, and the estimate is trusted."""
    trial = simulate(seed=seed, recording_rate=2000.0, snr_db=20.0)
    torque = np.roll(trial["torque"].to_numpy(), 1)
    late = trial.assign(torque=("time", torque))
    assert identify(late, "riv", tolerance=0.005).warnings
    estimate = identify(late, "riv")
    assert estimate.warnings == []
    assert estimate.trusted
    (text,) = estimate.remarks
    assert text.startswith("the record shows one of: a torque recorded 0.")
    shifts = estimate.diagnostics["shifts"]
    assert 0.01 < max(map(abs, shifts.values())) < TOLERANCE
    for name, shift in shifts.items():
        low, high = estimate.intervals[name]
        assert low <= estimate[name] <= high
        assert low <= estimate[name] * (1.0 + shift) <= high
    assert text in repr(estimate)


def pass_low(x, cutoff):
    return signal.sosfilt(signal.bessel(2, cutoff, fs=1000.0, output="sos"), x)


def resonate(x):
    """A fixture of 50 Hz with a damping ratio of 0.05."""
    omega = 2.0 * np.pi * 50.0
    return signal.lfilter(*signal.bilinear([omega**2], [1.0, 0.1 * omega, omega**2], 1000.0), x)


# What an instrument does to position and torque.
INSTRUMENTS = {
    "a low-pass of one channel alone": lambda p, tq: (p, pass_low(tq, 100.0)),
    "a compliance between joint and sensor": lambda p, tq: (p + tq / 800.0, tq),
    "a resonance of the fixture": lambda p, tq: (p, resonate(tq)),
}


@pytest.mark.parametrize("load", [(1.1, 7.1, 250.0), (0.1, 10.0, 100.0)])
@pytest.mark.parametrize("cause", INSTRUMENTS)
def test_causes_that_look_alike_are_all_named(cause, load):
    """None of them is called a crosstalk or a stiffness that grows."""
    trial = simulate(seed=21, load=load, snr_db=20.0)
    channels = (trial[name].to_numpy() for name in ("position", "torque"))
    position, torque = INSTRUMENTS[cause](*channels)
    changed = new_trial(position, torque, 1000.0, trial["reference"].to_numpy())
    estimate = identify(changed, "riv")
    (text,) = estimate.warnings + estimate.remarks
    assert "ne of: a torque recorded" in text
    assert cause in text


@pytest.mark.parametrize("seed", range(2))
def test_a_missing_filter_is_among_the_causes_that_look_alike(seed):
    """Aliasing of what lies above half the rate."""
    fast = simulate(
        seed=seed, recording_rate=5000.0, antialias_cutoff=2000.0, snr_db=30.0, load=LOADS[seed]
    )
    position, torque, reference = (
        fast[name].to_numpy()[::5] for name in ("position", "torque", "reference")
    )
    estimate = identify(new_trial(position, torque, 1000.0, reference), "riv")
    assert estimate.trusted
    (text,) = estimate.remarks
    assert text.startswith("the record shows one of: a torque recorded 0.")
    assert "no filter before sampling" in text


@pytest.mark.parametrize("seed", range(2))
def test_a_large_threshold_is_named(seed):
    """Its size is too small: the derivative is that of a small one."""
    trial = simulate(seed=seed, reflex_threshold=1.0, load=LOADS[seed])
    (text,) = identify(trial, "riv").warnings
    assert "A threshold of the reflex of about 0.3" in text


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("threshold", [0.1, 0.3])
def test_a_threshold_of_the_reflex_is_named_with_its_size(seed, threshold):
    trial = simulate(seed=seed, reflex_threshold=threshold, load=LOADS[seed % 2])
    estimate = identify(trial, "riv")
    text = " ".join(estimate.warnings + estimate.remarks).lower()
    size = float(text.split("a threshold of the reflex of about ")[1].split()[0])
    assert size == pytest.approx(threshold, rel=0.5)
    assert abs(estimate["K"] * (1.0 + estimate.diagnostics["shifts"]["K"]) / 150.0 - 1.0) < 0.08
    if threshold == 0.3:
        assert 'take basis="spline"' in estimate.warnings[0]


def test_shifts_of_effects_beside_one_another_add_up():
    """Two that are each below the tolerance are warned of together."""
    likeliest = Alternative("torque_lag", 1e-3, 9.0, {"K": 0.02, "I": 0.07})
    other = Alternative("friction", 0.1, 5.0, {"K": 0.01, "I": 0.06})
    trial = simulate(seed=1, duration=20.0)
    estimate = identify(trial, "riv")
    single = with_alternatives(estimate, [likeliest], prepare(trial), TOLERANCE)
    assert single.trusted
    assert len(single.remarks) == 1
    both = with_alternatives(estimate, [likeliest, other], prepare(trial), TOLERANCE)
    assert not both.trusted
    assert "Beside it, a friction of 0.1 N·m" in both.warnings[0]
    assert both.diagnostics["shifts"]["I"] == pytest.approx(0.13)


def test_effects_that_the_record_does_not_tell_apart_are_all_named():
    lag = Alternative("torque_lag", 1e-3, 9.0, {"K": 0.02, "I": 0.07})
    crosstalk = Alternative("crosstalk", 20.0, 8.8, {"K": -0.2})
    (likeliest,) = choose_likeliest([crosstalk, lag])
    assert likeliest.effect == "torque_lag"
    trial = simulate(seed=1, duration=20.0)
    estimate = identify(trial, "riv")
    (text,) = with_alternatives(estimate, [likeliest], prepare(trial), TOLERANCE).warnings
    assert (
        "One of: a torque recorded 1 ms after the position (moves K by +2 %, I by +7 %: record"
        in text
    )
    assert "; a crosstalk of the command in the torque of 20 N·m/rad (" in text
