"""Faults of single channels against definitions that are slow and plain."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ankleloop import new_trial, simulate
from ankleloop.checks.channels import (
    CHANNEL_CHECKS,
    check_clipping,
    check_gaps,
    check_rest,
    check_spikes,
)
from ankleloop.joint.prepared import prepare


def with_torque(values, rate=1000.0, **channels):
    position = 0.01 * np.sin(np.arange(len(values)) / 50.0)
    return prepare(new_trial(channels.pop("position", position), values, rate, **channels))


def faults_of(trial):
    findings = [
        check(prepare(trial), name) for check in CHANNEL_CHECKS for name in ("position", "torque")
    ]
    return [finding for finding in findings if finding.verdict != "ok"]


def count_clipped(x):
    """Samples at an end: a run of five, and five times as many as at each of the five next values, on average."""
    numbers = []
    for edge, levels in ((x.max(), np.unique(x)[::-1]), (x.min(), np.unique(x))):
        text = "".join("1" if value == edge else "0" for value in x)
        nearby = np.mean([np.sum(x == level) for level in levels[1:6]])
        numbers.append(
            text.count("1") if "11111" in text and text.count("1") > 5 * max(nearby, 1) else 0
        )
    return max(numbers)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.integers(3, 40), st.floats(0.5, 1.0), st.floats(0.0, 0.3))
def test_clipping_is_what_the_plain_definition_counts(seed, levels, high, low):
    rng = np.random.default_rng(seed)
    x = np.round(levels * np.sin(0.05 * np.arange(400) + rng.random()) + rng.standard_normal(400))
    x = np.clip(x, *np.quantile(x, [low, high]))
    if np.ptp(x) == 0:
        return
    finding = check_clipping(with_torque(x), "torque")
    count = count_clipped(x)
    assert (finding.verdict != "ok") == (count > 0)
    if count:
        assert finding.text.startswith(f"{count} samples")


def test_clipping_names_its_place():
    x = np.random.default_rng(1).standard_normal(2000)
    x[700:720] = 9.0
    finding = check_clipping(with_torque(x), "torque")
    assert finding.verdict == "refused"
    assert "20 samples (1 %)" in finding.text
    assert "first at sample 700 (0.7 s)" in finding.text


def test_a_rest_counts_where_another_channel_moves():
    rng = np.random.default_rng(1)
    moving = rng.standard_normal(10_000)
    torque = moving.copy()
    torque[4000:5500] = 0.3
    finding = check_rest(with_torque(torque), "torque")
    assert (
        "1500 samples (15 %) of the torque keep one value, first from 4000 to 5499 (4 … 5.499 s)"
        in finding.text
    )
    position = 0.01 * np.sin(np.arange(10_000) / 50.0)
    position[4000:5500] = 0.002
    both = with_torque(torque, position=position)  # a perturbation that pauses
    assert check_rest(both, "torque").verdict == check_rest(both, "position").verdict == "ok"
    reference = 0.02 * np.sin(np.arange(10_000) / 50.0)
    moved = with_torque(moving, position=position, reference=reference)
    assert check_rest(moved, "position").verdict == "refused"
    torque[4000:7500], position[4000:7500] = 0.3, 0.002  # a third of the record
    assert check_rest(with_torque(torque, position=position), "torque").verdict == "refused"


def test_a_coarse_converter_is_no_fault():
    trial = simulate(seed=1, duration=10.0)
    coarse = trial.assign(
        torque=trial["torque"].round(0),
        position=trial["position"].copy(data=np.round(trial["position"] / 2e-3) * 2e-3),
    )
    assert faults_of(coarse) == []


@pytest.mark.parametrize("rate", [200.0, 1000.0, 5000.0])
def test_a_spike_stands_out_at_any_rate_and_a_step_does_not(rate):
    trial = simulate(seed=1, duration=10.0, recording_rate=rate, antialias_cutoff=0.2 * rate)
    assert check_spikes(prepare(trial), "torque").verdict == "ok"
    size, sample = 15.0 * float(trial["torque"].std()), int(4.321 * rate)
    spike, step = trial["torque"].values.copy(), trial["torque"].values.copy()
    spike[sample] += size
    step[sample:] += size
    assert (
        check_spikes(
            prepare(trial.assign(torque=trial["torque"].copy(data=step))), "torque"
        ).verdict
        == "ok"
    )
    finding = check_spikes(prepare(trial.assign(torque=trial["torque"].copy(data=spike))), "torque")
    assert f"at sample {sample} (" in finding.text


def test_sparse_pulses_are_no_spikes():
    for seed in range(3):
        trial = simulate(
            seed=seed,
            duration=20.0,
            perturbation="pulses",
            switching_interval=2.0,
            closed_loop=False,
            snr_db=None,
        )
        assert faults_of(trial) == []


@pytest.mark.parametrize("kind", ["held", "line"])
def test_filled_gaps_are_found(kind):
    trial = simulate(seed=1, duration=20.0)
    torque = trial["torque"].to_numpy().copy()
    for start in range(1000, 19_000, 2000):
        end = torque[start] if kind == "held" else torque[start + 300]
        torque[start : start + 300] = np.linspace(torque[start], end, 300, endpoint=False)
    finding = check_gaps(prepare(trial.assign(torque=("time", torque))), "torque")
    assert finding.verdict == "warning"
    assert finding.text.startswith(
        "9 stretches of the torque (14 % of the record) are exactly straight, the first from"
    )


@pytest.mark.parametrize("bits", [8, 12, None])
def test_a_joint_at_rest_is_no_filled_gap(bits):
    trial = simulate(seed=1, duration=20.0, closed_loop=False, switching_interval=0.4)
    if bits:
        step = float(np.ptp(trial["position"].to_numpy())) / 2**bits
        trial["position"] = np.round(trial["position"] / step) * step
    assert check_gaps(prepare(trial), "position").verdict == "ok"
