"""Estimates during the recording."""

import numpy as np
import pytest

from ankleloop import DataError, LiveEstimate, identify, segment, simulate

RATE = 1000.0
STEP = {"variation": "time", "stiffness_table": [150.0] * 24 + [195.0] * 12}


def read_channels(trial):
    """Position, torque, reference and time of a trial."""
    names = ("position", "torque", "reference", "time")
    return np.stack([trial[name].to_numpy() for name in names])


@pytest.fixture(scope="module")
def trial():
    return simulate(seed=3, duration=24.0, voluntary=0.3)


@pytest.fixture
def channels(trial):
    return read_channels(trial)


def follow(channels, pieces=1, **options):
    """A live estimate of samples that came in so many pieces."""
    with LiveEstimate(RATE, beside=False, **{"every": 2.0, **options}) as live:
        for piece in np.array_split(channels, pieces, axis=1):
            live.add(*piece)
    return live


@pytest.fixture(scope="module")
def history(trial):
    """What is estimated of a trial that comes at once."""
    return follow(read_channels(trial)).history


def test_history_does_not_depend_on_the_pieces(channels):
    channels[1, 5000:5003] = np.nan
    expected = follow(channels).history
    for pieces in (5, 777, 24_000):
        assert follow(channels, pieces).history.equals(expected)


def test_estimate_is_that_of_the_same_samples(trial, channels):
    live = follow(channels, order=3)
    expected = identify(segment(trial, 4.0, 24.0), "riv", order=3)
    row = live.history.iloc[-1]
    numbers = [row["time"], row["G"], row["K_low"], row["K_high"]]
    assert numbers == pytest.approx(
        [24.0, expected.reflex["G"], *expected.intervals["K"]], rel=1e-9
    )
    differences = live.estimate.torque["net"].values - expected.torque["net"].values
    assert np.abs(differences).max() < 1e-9
    assert row["latency"] == pytest.approx(24.0 - float(expected.torque["time"].mean()))


def lose(channels):
    return np.delete(channels, slice(5000, 5100), axis=1)


def blank(channels):
    channels[2, 5000:5100] = np.nan
    return channels


@pytest.mark.parametrize("fault", [lose, blank])
def test_window_begins_anew_behind_a_gap(trial, channels, fault):
    live = follow(fault(channels))
    history = live.history
    assert "samples are missing, the last ones before 5.1 s" in history["warnings"][2]
    assert "10 s are needed in which no sample" in history["failure"][6]
    expected = identify(segment(trial, 5.1, history["time"].iloc[-1]), "riv")
    assert live.estimate.stiffness == pytest.approx(expected.stiffness, rel=1e-9)


def test_samples_that_come_twice_or_late_are_left_out(channels, history):
    again = np.hstack([channels[:, :10_000], channels[:, 4000:]])
    live = follow(again, pieces=29)
    values = live.history.drop_duplicates("time")["K"]
    np.testing.assert_array_equal(values, history["K"])
    assert ["twice or late" in text for text in live.history["warnings"]].index(True) == 5


def test_a_clock_that_stands_still_is_said(channels):
    channels[3, 10_000:] = channels[3, 9999]
    live = follow(channels)
    assert "twice or late" in live.history["warnings"].iloc[-1]
    assert live.history["time"].iloc[-1] == 10.0


def test_a_sample_without_a_stamp_is_a_gap(channels):
    channels[3, 3000] = np.nan
    warnings = follow(channels).history["warnings"]
    assert "a sample without a time was left out before 3.001 s" in warnings[1]


def test_stamps_that_jitter_show_the_gaps_alone(channels):
    channels[3] *= 1.0005
    channels[3] += np.repeat(np.random.default_rng(1).uniform(0.0, 0.016, 800), 30)
    history = follow(np.delete(channels, slice(3000, 3500), axis=1), jitter=0.05).history
    assert history["window"].iloc[-1] == 19.0  # there is one gap
    assert history["warnings"].str.contains("samples are missing").tolist() == [False] + [True] * 10
    assert not history["warnings"].str.contains("samples come").any()


def test_a_gap_within_the_jitter_is_said_where_stamps_do_not_return(channels):
    """By the rule of files: 20 ms of samples are missing, and stamps may be off by 50 ms."""
    channels[3] += np.repeat(np.random.default_rng(1).uniform(0.0, 0.002, 800), 30)
    whole = follow(channels, jitter=0.05).history
    assert not whole["warnings"].str.contains("samples are missing").any()
    history = follow(np.delete(channels, slice(6000, 6020), axis=1), jitter=0.05).history
    warned = history["warnings"].str.contains("stamps shift near", regex=False)
    assert warned.tolist() == [False] * 4 + [True] * (len(history) - 4)  # from 10 s on


@pytest.mark.parametrize("back", [100.0, 10.0])
def test_clock_that_is_set_back_begins_anew(channels, back):
    """Also by less than the window, as of a sender that was started again."""
    channels[3, 12_000:] -= back
    live = follow(channels, pieces=2)
    assert "the times of samples went back before 12 s" in live.history["warnings"].iloc[6]
    assert live.history["window"].iloc[-1] == pytest.approx(12.0)
    assert live.history["time"].is_monotonic_increasing


def test_clock_that_drifts_is_said(channels):
    channels[3] *= 1.002
    assert "samples come at 998.004 Hz" in follow(channels).history["warnings"].iloc[-1]


def test_reference_that_stops_is_said(channels):
    channels[2, 20_000:] = channels[2, 20_000]
    warnings = follow(channels).history["warnings"].iloc[-1]
    assert "the reference has stood still for 2 s" in warnings


def test_fit_that_fails_is_a_row_with_its_reason(channels):
    channels[2, :12_000] = 0.0
    live = follow(channels[:, :12_000])
    assert "reference is constant" in live.history["failure"].iloc[-1]
    assert live.estimate is None
    assert not live.enough({"K": 1.0})


def test_enough_is_a_matter_of_the_half_widths_of_full_windows(channels):
    live = follow(channels)
    rows = live.history[live.history["window"] == 20.0]
    shares = (rows["K_high"] - rows["K"]) / rows["K"]
    share = max(shares.iloc[-1], shares.median())
    assert live.enough({"K": 1.01 * share, "G": 1.0})
    assert not live.enough({"K": 0.99 * share, "G": 1.0})
    assert live.enough_since({"K": 1.0}) == pytest.approx(20.0)  # the window is full


def test_change_of_K_is_found_soon():
    trial = simulate(seed=1, duration=36.0, **STEP)
    change = follow(read_channels(trial)).change
    since, before, after, _, power = change.loc["K"]
    assert since == pytest.approx(24.0, abs=2.1)
    assert after / before == pytest.approx(1.3, abs=0.1)
    assert power > change.loc["G", "power"]
    assert np.isnan(change.loc["G", "since"])


def test_fits_beside_the_reading_lose_no_sample(channels, history):
    with LiveEstimate(RATE, every=2.0) as live:
        for piece in np.array_split(channels, 100, axis=1):
            live.add(*piece)
    row = live.history.drop(columns="warnings").iloc[-1]
    assert row.equals(history.drop(columns="warnings").iloc[-1])


def test_open_loop_needs_no_reference():
    trial = simulate(seed=1, duration=12.0, closed_loop=False)
    live = LiveEstimate(RATE, every=4.0, beside=False, reference="position")
    live.add(trial["position"], trial["torque"])
    low, high = live.estimate.intervals["K"]
    assert low < 150.0 < high


def test_bad_samples_are_refused():
    live = LiveEstimate(RATE)
    with pytest.raises(DataError, match="reference must be an array of real numbers, got None"):
        live.add(0.1, 1.0)
    with pytest.raises(DataError, match="torque has 2 samples but position has 1"):
        live.add(0.1, [1.0, 2.0], 0.1)


def test_windows_that_are_not_full_are_never_enough(trial):
    """Nor do their wider intervals count among those of most windows."""
    channels = read_channels(trial)
    assert not follow(channels[:, :18_000]).enough({"K": 10.0})
    live = follow(channels[:, :22_000], every=0.5)
    rows = live.history[live.history["window"] == 20.0]
    assert len(rows) < len(live.history) / 4
    shares = (rows["K_high"] - rows["K_low"]) / 2.0 / rows["K"]
    assert live.enough({"K": 1.01 * shares.max()})


def test_windows_are_less_the_apparatus(trial):
    plate = {"stiffness": 0.0, "viscosity": 0.1, "inertia": 0.005, "reflex_gain": 0.0}
    empty = simulate(seed=3, duration=20.0, voluntary=0.0, **plate)
    apparatus = identify(empty, "apparatus")
    with LiveEstimate(1000.0, every=5.0, beside=False, apparatus=apparatus) as live:
        live.add(trial.position, trial.torque, trial.reference)
    assert live.estimate.apparatus.startswith("less the apparatus: I 0.00")
    assert not live.history["failure"].iloc[-1]
