"""The test for closed loop: what it calls open is open as far as K is concerned, whatever it has seen."""

import numpy as np
import pytest
from scipy import signal as sps
from scipy import stats

from ankleloop import DataError, segment, simulate
from ankleloop.checks.loop import LARGEST_BIAS, feedback_test, fit_stiffness, path_bias
from ankleloop.joint.prepared import prepare
from ankleloop.signals.responses import project_on_reference, unseen_share

ASSUMED = np.array([1.1, 7.1, 250.0])
LOADS = {
    "assumed": ASSUMED,
    "light": (0.1, 10.0, 100.0),
    "stiff": 10 * ASSUMED,
    "stiffer": 100 * ASSUMED,
}


def regressors(trial):
    return prepare(trial).regressors(
        delay=0.04, basis="rectifier", identification_rate=100.0, reference="reference"
    )


def run_feedback_test(*trials):
    return feedback_test([regressors(trial) for trial in trials])


def shake(trial, seed, size):
    """A servo that does not follow: part of its command, below 8 Hz, is missing in the recorded reference."""
    movement = sps.sosfiltfilt(
        sps.butter(2, 8.0, fs=1000.0, output="sos"),
        np.random.default_rng(seed).standard_normal(trial.sizes["time"]),
    )
    reference = trial["reference"]
    return trial.assign(
        reference=reference + size * float(reference.std()) * movement / movement.std()
    )


@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize("duration", [15.0, 50.0])
def test_feedback_is_detected(load, duration):
    tests = [
        run_feedback_test(simulate(seed=seed, load=LOADS[load], duration=duration))
        for seed in range(8)
    ]
    assert [test.loop for test in tests] == ["closed"] * 8
    assert min(test.work for test in tests) > 0.05


@pytest.mark.parametrize("voluntary", [0.0, 1.0])
@pytest.mark.parametrize("duration", [10.0, 50.0])
def test_a_stiff_servo_is_open_in_a_short_record_too(voluntary, duration):
    for seed in range(6):
        test = run_feedback_test(
            simulate(seed=seed, closed_loop=False, voluntary=voluntary, duration=duration)
        )
        assert test.loop == "open"
        assert test.limit < 0.1


@pytest.mark.parametrize("duration", [6.0, 8.0])
def test_few_segments_are_an_error_that_says_what_is_needed(duration):
    with pytest.raises(DataError, match=r"the test needs 4: record \d\S* s more") as error:
        run_feedback_test(simulate(seed=1, duration=duration))
    missing = float(str(error.value).split()[-3])
    assert run_feedback_test(simulate(seed=1, duration=duration + missing + 0.05)).loop == "closed"


def test_short_trials_are_tested_together():
    """Each alone has too few segments."""
    for closed_loop, loop in ((True, "closed"), (False, "open")):
        trials = [simulate(seed=seed, duration=6.0, closed_loop=closed_loop) for seed in range(6)]
        assert run_feedback_test(*trials).loop == loop


@pytest.mark.parametrize(("stiffer", "voluntary"), [(10, 1.0), (30, 1.0), (100, 1.0)])
def test_bias_is_that_of_least_squares(stiffer, voluntary):
    """K of the same seeds in closed less K in open loop, both by least squares with a reflex of any dynamics."""
    differences, tests = [], []
    for seed in range(6):
        options = {"seed": seed, "voluntary": voluntary, "load": stiffer * ASSUMED}
        closed, opened = (
            simulate(**options, closed_loop=closed_loop) for closed_loop in (True, False)
        )
        differences.append(
            fit_stiffness([regressors(closed)]) - fit_stiffness([regressors(opened)])
        )
        tests.append(run_feedback_test(closed))
    expected = np.mean(differences) / 1.5
    assert np.mean([test.bias for test in tests]) == pytest.approx(expected, rel=0.2)
    assert all(test.bias - test.margin < expected < test.bias + test.margin for test in tests)


def test_feedback_that_is_hidden_is_not_called_open():
    """A shaking servo hides feedback that biases K by four per cent: with time it is detected, and never excluded."""
    outcomes = {10.0: [], 60.0: []}
    for seed in range(8):
        trial = shake(
            simulate(seed=seed, load=30 * ASSUMED, voluntary=1.0, duration=60.0), seed, 0.1
        )
        for duration, tests in outcomes.items():
            tests.append(run_feedback_test(segment(trial, 0.0, duration)))
    assert {test.loop for test in outcomes[10.0]} == {"undecided"}
    assert {test.loop for test in outcomes[60.0]} <= {"closed", "undecided"}
    assert [test.loop for test in outcomes[60.0]].count("closed") >= 6
    for test in outcomes[10.0]:
        assert test.limit > LARGEST_BIAS
        assert test.sufficient_duration > test.duration


@pytest.mark.parametrize("gain", [13.0, 30.0])
def test_a_servo_that_does_not_follow_is_not_feedback(gain):
    """The torque follows a movement that the reference does not explain; an active reflex even does work."""
    tests = [
        run_feedback_test(
            shake(
                simulate(seed=seed, closed_loop=False, reflex_gain=gain, duration=60.0), seed, 0.1
            )
        )
        for seed in range(12)
    ]
    assert "closed" not in {test.loop for test in tests}
    if gain == 13.0:
        assert [test.loop for test in tests].count("open") >= 10


@pytest.mark.parametrize(("samples", "alternative"), [(1200, "greater"), (3000, "two-sided")])
def test_frequency_of_false_alarms(samples, alternative):
    """Independent coloured residuals: the p-value is uniform; with few segments it is too large, never too small."""
    rng = np.random.default_rng(1)
    record = regressors(simulate(seed=1, duration=samples / 100 + 2, closed_loop=False))
    p = []
    for _ in range(200):
        r = rng.standard_normal(record.torque.size)
        e, v = (sps.lfilter([1.0], [1.0, -0.95], rng.standard_normal(r.size)) for _ in range(2))
        p.append(feedback_test([Signals(r + 0.1 * e, r + v, r)]).p_value)
    assert np.mean(np.array(p) < 0.01) <= 0.03
    assert stats.kstest(p, "uniform", alternative=alternative).pvalue > 1e-3


class Signals:
    """Position, torque and reference in the place of regressors."""

    rate = 100.0

    def __init__(self, position, torque, reference):
        velocity = np.gradient(position, 0.01)
        columns = [
            position,
            velocity,
            np.gradient(velocity, 0.01),
            np.maximum(np.roll(velocity, 4), 0.0),
        ]
        self.inputs, self.torque, self.reference = np.column_stack(columns), torque, reference


def test_projection_is_that_of_least_squares():
    """Against numpy's least squares with the leads and lags written out."""
    record = regressors(simulate(seed=1, duration=12.0))
    channels = np.column_stack([record.inputs[:, 0], record.torque])
    projection = project_on_reference([record.reference], [channels], record.rate)
    r = record.reference
    lagged = np.column_stack([r[80 - lag : r.size - 15 - lag] for lag in range(-15, 81)])
    lagged = lagged - lagged.mean(axis=0)
    target = channels[80:-15] - channels[80:-15].mean(axis=0)
    expected = target - lagged @ np.linalg.lstsq(lagged, target, rcond=1e-3)[0]
    np.testing.assert_allclose(projection.residuals[0], expected, atol=1e-6 * target.std())
    rank = np.linalg.matrix_rank(lagged, tol=1e-3 * np.linalg.norm(lagged, 2))
    assert projection.shrinkage == pytest.approx(1.0 - rank / len(lagged))


def share(trial):
    record = regressors(trial)
    return unseen_share([record.reference], [record.inputs[:, 0]], record.rate)


def test_share_of_the_position_that_the_reference_predicts():
    trial = simulate(seed=1)
    assert share(trial) == pytest.approx(0.95, abs=0.02)
    other = trial.assign(
        reference=trial["reference"].copy(data=simulate(seed=2)["reference"].values)
    )
    assert share(other) < 0.02


def test_paths_are_correlated_by_a_prbs_and_not_by_pulses():
    """Without noise K beside the reflex is true."""
    options = {"seed": 1, "closed_loop": False, "snr_db": None, "voluntary": 0.0}
    prbs = [regressors(simulate(**options))]
    pulses = [regressors(simulate(**options, perturbation="pulses", switching_interval=0.2))]
    assert fit_stiffness(prbs) == pytest.approx(150.0, rel=2e-3)
    assert path_bias(prbs) > 25
    assert abs(path_bias(pulses)) < 5
