"""Gaps that were filled: riv leaves them out, and what it is left with says as much as its intervals say."""

import numpy as np
import pytest

from ankleloop import DataError, identify, new_trial, simulate
from ankleloop.joint.prepared import prepare

TRUTHS = {"K": 150.0, "B": 0.8, "I": 0.015, "G": 13.0}


def fill(trial, names, *, bridged=False, share=0.3):
    """Fill gaps of 300 ms by the last value, or by straight lines."""
    rng = np.random.default_rng(1)
    samples = trial.sizes["time"]
    starts = rng.choice(
        np.arange(500, samples - 600, 320), round(share * samples / 300), replace=False
    )
    channels = {name: trial[name].to_numpy().copy() for name in ("position", "torque", "reference")}
    for name in names:
        x = channels[name]
        for start in starts:
            end = x[start + 300] if bridged else x[start]
            x[start : start + 300] = np.linspace(x[start], end, 300, endpoint=False)
    return new_trial(channels["position"], channels["torque"], 1000.0, channels["reference"])


@pytest.fixture(scope="module")
def trial():
    return simulate(seed=21)


@pytest.mark.parametrize("bridged", [False, True])
@pytest.mark.parametrize("names", [("position",), ("torque",), ("position", "torque")])
def test_filled_gaps_are_left_out(trial, names, bridged):
    estimate = identify(fill(trial, names, bridged=bridged), "riv")
    assert estimate.trusted
    (text,) = estimate.remarks
    assert text.startswith("gaps were filled by the last value or a line, 50 of the ")
    for name, truth in TRUTHS.items():
        low, high = estimate.intervals[name]
        assert low < truth < high, name


def test_what_filled_a_gap_does_not_matter(trial):
    held, bridged = (
        identify(fill(trial, ("position", "torque"), bridged=bridged), "riv")
        for bridged in (False, True)
    )
    for name in TRUTHS:
        margin = np.ptp(held.intervals[name]) / 2.0
        assert abs(held.values[name] - bridged.values[name]) < 0.3 * margin, name


def test_intervals_are_as_wide_as_those_of_so_much_less_record(trial):
    whole = identify(trial, "riv")
    gapped = fill(trial, ("position",))
    rest = identify(gapped, "riv")
    prepared = prepare(gapped)
    share = prepared.recorded(prepared.grid(100.0, 0.04)).mean()
    assert 0.3 < share < 0.7
    for name in "KBI":
        ratio = np.ptp(rest.intervals[name]) / np.ptp(whole.intervals[name])
        assert ratio == pytest.approx(share**-0.5, rel=0.35), name


def test_gaps_of_an_open_loop_are_left_out():
    trial = simulate(seed=4, closed_loop=False)
    estimate = identify(fill(trial, ("position",)), "riv", reference="position")
    assert estimate.trusted
    low, high = estimate.intervals["K"]
    assert low < 150.0 < high


def test_a_reference_that_was_filled_as_well_is_a_warning(trial):
    """What moved the joint in the gaps is not known then."""
    filled = fill(trial, ("position", "torque", "reference"), bridged=True)
    estimate = identify(filled, "riv")
    assert "gaps were filled" in " ".join(estimate.warnings)


@pytest.mark.parametrize("method", ["riv-tv", "pr-moesp", "parallel-cascade"])
def test_other_methods_warn(trial, method):
    options = {"cycle_onsets": np.arange(0.0, 48.0)} if method == "riv-tv" else {}
    estimate = identify(fill(trial, ("position",)), method, **options)
    assert "Take riv, which leaves them out" in " ".join(estimate.fit_warnings)
    assert not estimate.trusted


def test_a_record_of_gaps_alone_is_refused(trial):
    with pytest.raises(
        DataError, match=r"filled gaps of position and torque reach .* record again"
    ):
        identify(fill(trial, ("position", "torque"), share=0.9), "riv")


def test_halves_are_weighed_by_what_was_recorded_of_them(trial):
    """A torque that doubles in the middle of a record, whose first half has gaps."""
    torque = trial["torque"].to_numpy() * np.repeat([1.0, 2.0], trial.sizes["time"] // 2)
    for start in range(1000, 24_000, 1000):
        torque[start : start + 300] = torque[start]
    position, reference = (trial[name].to_numpy() for name in ("position", "reference"))
    (text,) = identify(new_trial(position, torque, 1000.0, reference), "riv").warnings
    assert text.startswith("from the middle on K, B, I and G are ")
    assert float(text.split(" are ")[1].split()[0]) == pytest.approx(2.0, abs=0.2)
