"""Properties of public functions that hold for every input: whatever is true of one record is true of its parts."""

import h5py
import numpy as np
import pandas as pd
import pytest
import scipy.io
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

from ankleloop import (
    METHODS,
    LongRecord,
    check_trial,
    identify,
    method_options,
    new_trial,
    read_trial,
    segment,
    simulate,
)
from ankleloop.signals.decimation import decimate, decimation_margin
from ankleloop.trials.trial import remove_drift

RATE = 500.0
SAMPLES = 400

few = settings(max_examples=20, deadline=None)
seeds = st.integers(0, 2**32 - 1)


def draw_signals(seed, channels=3, samples=SAMPLES):
    """Signals of a slow random walk, which no check refuses."""
    return np.cumsum(np.random.default_rng(seed).standard_normal((channels, samples)), axis=1) * 1e-3


@pytest.fixture(scope="module")
def trial():
    return simulate(seed=1, duration=15.0)


# --- new_trial and segment


@few
@given(seeds, st.sampled_from(["f8", "f4", "i2"]), st.sampled_from(["list", "row", "column", "masked", "series"]))
def test_a_trial_has_the_numbers_of_its_arrays_whatever_holds_them(seed, kind, holder):
    position, torque, reference = draw_signals(seed)
    # Counts of a converter; a position of a radian from one sample to the next would be refused.
    torque, reference = (1e5 * torque).astype(kind), (1e5 * reference).astype(kind)
    holders = {
        "list": np.ndarray.tolist,
        "row": lambda x: x[None],
        "column": lambda x: x[:, None],
        "masked": np.ma.masked_array,
        "series": pd.Series,
    }
    hold = holders[holder]
    trial = new_trial(hold(position), hold(torque), RATE, hold(reference))
    for name, signal in (("position", position), ("torque", torque), ("reference", reference)):
        assert trial[name].dtype == np.float64
        np.testing.assert_array_equal(trial[name], signal.astype(float))


@few
@given(seeds)
def test_a_trial_does_not_change_with_the_arrays_that_it_was_made_of(seed):
    position, torque, reference = draw_signals(seed)
    trial = new_trial(position, torque, RATE, reference)
    copy = trial.copy(deep=True)
    for signal in (position, torque, reference):
        signal += 1.0
    assert trial.identical(copy)


@few
@given(seeds, st.tuples(*[st.integers(0, SAMPLES)] * 3).map(sorted))
def test_segments_side_by_side_are_the_segment_of_both(seed, edges):
    first, middle, last = (edge + 5 * k for k, edge in enumerate(edges))
    position, torque = draw_signals(seed, 2, SAMPLES + 10)
    trial = new_trial(position, torque, RATE)
    whole = segment(trial, first / RATE, last / RATE)
    parts = [segment(trial, *(edge / RATE for edge in ends)) for ends in ((first, middle), (middle, last))]
    assert xr.concat(parts, dim="time").equals(whole)
    assert segment(whole, middle / RATE, 1e9).equals(parts[1])


# --- signals


@few
@given(seeds, st.integers(2, 6), st.integers(0, 2), st.integers(0, 30))
def test_decimated_channels_are_those_of_each_alone_and_of_a_record_that_starts_later(seed, factor, derivative, shift):
    x = draw_signals(seed, 3, 2000)
    first = decimation_margin(factor) + shift
    options = {"rate": RATE, "derivative": derivative}
    together = decimate(x, factor, first, 20, **options)
    scale = np.abs(together).max()
    for row, channel in zip(together, x, strict=True):
        np.testing.assert_allclose(decimate(channel, factor, first, 20, **options), row, atol=1e-12 * scale)
    np.testing.assert_allclose(
        decimate(x[:, shift:], factor, first - shift, 20, **options), together, atol=1e-8 * scale
    )


@few
@given(seeds, st.integers(2, 6), st.integers(0, 2))
def test_decimation_has_no_phase(seed, factor, derivative):
    """The record read backwards gives the samples backwards; a velocity changes its sign."""
    x = draw_signals(seed, 1, 1000)[0]
    first, count = decimation_margin(factor), 20
    last = x.size - 1 - (first + factor * (count - 1))
    forward, backward = (
        decimate(signal, factor, start, count, derivative=derivative) for signal, start in ((x, first), (x[::-1], last))
    )
    np.testing.assert_allclose(backward[::-1], (-1) ** derivative * forward, atol=1e-9 * np.abs(forward).max())


@few
@given(seeds, st.integers(0, 5), st.lists(st.floats(-10, 10), min_size=1, max_size=6))
def test_drift_of_a_torque_is_removed_whatever_it_was(seed, degree, coefficients):
    position, torque = draw_signals(seed, 2)
    grid = np.linspace(-1.0, 1.0, SAMPLES)
    polynomial = np.polynomial.Polynomial(coefficients[: degree + 1])(grid)
    clean = remove_drift(new_trial(position, torque, RATE), degree)
    drifting = remove_drift(new_trial(position, torque + polynomial, RATE), degree)
    np.testing.assert_allclose(drifting["torque"], clean["torque"], atol=1e-11)
    np.testing.assert_allclose(remove_drift(clean, degree)["torque"], clean["torque"], atol=1e-13)


# --- files


@settings(max_examples=4, deadline=None)
@given(seeds)
def test_a_record_is_the_same_trial_in_every_file_format(tmp_path_factory, seed):
    folder = tmp_path_factory.mktemp("formats")
    position, torque, reference = draw_signals(seed)
    signals = {"position": position, "torque": torque, "command": reference}
    table = pd.DataFrame(signals)
    for name in ("a.csv", "a.csv.gz"):
        table.to_csv(folder / name, index=False)
    scipy.io.savemat(folder / "a.mat", signals)
    for name in ("a.h5", "v73.mat"):
        with h5py.File(folder / name, "w") as file:
            for key, values in signals.items():
                file[key] = values
    data = xr.Dataset({key: ("time", values) for key, values in signals.items()})
    data.to_netcdf(folder / "a.nc", engine="h5netcdf")
    data.to_netcdf(folder / "classic.nc", engine="scipy")
    expected = new_trial(position, torque, RATE, reference)
    paths = sorted(folder.iterdir())
    assert len(paths) == 7
    for path in paths:
        assert read_trial(path, reference="command", sampling_rate=RATE).equals(expected), path.name


@settings(max_examples=10, deadline=None)
@given(seeds, st.integers(0, SAMPLES - 2), st.integers(2, SAMPLES))
def test_a_piece_of_a_long_record_is_that_of_the_trial(tmp_path_factory, seed, start, length):
    path = tmp_path_factory.mktemp("record") / "a.h5"
    position, torque = draw_signals(seed, 2)
    with h5py.File(path, "w") as file:
        file["position"], file["torque"] = np.rad2deg(position), torque
    options = {"position_unit": "deg", "torque_sign": -1, "sampling_rate": RATE}
    stop = min(start + length, SAMPLES)
    piece = LongRecord(path, reference=None, **options).read(start, stop)
    whole = read_trial(path, **options)
    for name in ("time", "position", "torque"):
        np.testing.assert_array_equal(piece[name], whole[name][start:stop])


# --- identification and scores


@pytest.mark.parametrize("method", METHODS)
def test_an_identification_changes_nothing_and_options_have_their_defaults(trial, method):
    copy = trial.copy(deep=True)
    first, second = (identify(trial, method, **options) for options in ({}, method_options(method)))
    assert trial.identical(copy)
    assert first.torque.identical(second.torque)
    assert (first.stiffness, first.reflex) == (second.stiffness, second.reflex)


def test_the_order_of_merged_trials_does_not_change_the_verdict():
    trials = [simulate(seed=seed, duration=10.0) for seed in (1, 2, 3)]
    check, expected = check_trial(trials[::-1]), check_trial(trials)
    assert (check.verdict, check.loop, check.methods) == (expected.verdict, expected.loop, expected.methods)
