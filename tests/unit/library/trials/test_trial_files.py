import numpy as np
import pytest

from ankleloop import DataError, new_trial, simulate
from ankleloop.trials.trial_files import load_rows, load_trial_of, load_trials, save_trials

INDEX = [("a", k) for k in range(5)]


def make_trials(count=3, samples=50, **attributes):
    rng = np.random.default_rng(0)
    return [
        new_trial(
            *(0.01 * rng.standard_normal((2, samples))), 100.0, subject="S1", number=k, **attributes
        )
        for k in range(count)
    ]


def test_trials_of_several_points_in_one_file(tmp_path):
    trials, index = make_trials(4), [("a", 0), ("a", 1), ("b", 0), ("b", 1)]
    save_trials(trials, tmp_path / "trials.nc", index)
    assert [row[:2] for row in load_rows(tmp_path / "trials.nc")] == index
    wanted = [index[2], index[1]]
    rows = list(load_rows(tmp_path / "trials.nc", wanted))
    assert [row[:2] for row in rows] == wanted
    for row, trial in zip(rows, (trials[2], trials[1]), strict=True):
        np.testing.assert_array_equal(row[2]["torque"], trial["torque"])
        assert row[2].attrs == trial.attrs


def test_a_point_whose_trials_are_in_several_files(tmp_path):
    trials = make_trials(5)
    save_trials(trials[:3], tmp_path / "0.nc", INDEX[:3])
    save_trials(trials[3:], tmp_path / "1.nc", INDEX[3:])
    paths = [tmp_path / "0.nc", tmp_path / "1.nc"]
    for number in (0, 4):
        loaded = load_trial_of(paths, "a", number)
        np.testing.assert_array_equal(loaded["torque"], trials[number]["torque"])
    with pytest.raises(DataError, match="no trial file has trial 0 of the point 'b'"):
        load_trial_of(paths, "b", 0)


def test_single_precision_halves_the_file_and_rounds_far_below_a_converter(tmp_path):
    (trial,) = make_trials(1, samples=10_000)
    for precision in ("double", "single"):
        save_trials([trial], tmp_path / f"{precision}.nc", INDEX[:1], precision)
    assert (tmp_path / "single.nc").stat().st_size < 0.7 * (tmp_path / "double.nc").stat().st_size
    (loaded,) = load_trials(tmp_path / "single.nc")
    np.testing.assert_allclose(loaded["torque"], trial["torque"], rtol=1e-7)


def test_constant_signals_take_no_space(tmp_path):
    quiet = [simulate(seed=k, duration=10.0, snr_db=None, voluntary=0.0) for k in range(3)]
    save_trials(quiet, tmp_path / "quiet.nc", INDEX[:3])
    size = 3 * quiet[0]["torque_noise"].nbytes
    assert (tmp_path / "quiet.nc").stat().st_size < (len(quiet[0].data_vars) - 1.5) * size
    for before, after in zip(quiet, load_trials(tmp_path / "quiet.nc"), strict=True):
        np.testing.assert_array_equal(after["torque_noise"], before["torque_noise"])


def test_attributes_in_which_trials_differ_keep_their_values_and_types(tmp_path):
    trials = [
        trial.assign_attrs(gain=gain)
        for trial, gain in zip(make_trials(3), (2, 2.0, 3), strict=True)
    ]
    trials[2].attrs.pop("subject")
    save_trials(trials, tmp_path / "trials.nc", INDEX[:3])
    for before, after in zip(trials, load_trials(tmp_path / "trials.nc"), strict=True):
        assert after.attrs == before.attrs
        assert type(after.attrs["gain"]) is type(before.attrs["gain"])
