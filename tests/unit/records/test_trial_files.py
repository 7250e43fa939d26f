import numpy as np
import pytest

from ankleloop import DataError, new_trial, simulate
from ankleloop.joint import regressors
from ankleloop.joint.once import made_once
from ankleloop.joint.regressors import build_regressors, decimated, share_channels
from ankleloop.records.trial_files import load_blocks, load_trials, save_trials
from ankleloop.signals.decimation import decimate


def trials(count=3, samples=50, **more):
    rng = np.random.default_rng(0)
    return [
        new_trial(*(0.01 * rng.standard_normal((2, samples))), 100.0, subject="S1", number=k, **more)
        for k in range(count)
    ]


def test_round_trip_is_bit_exact(tmp_path):
    batch = [*trials(), trials(1)[0].assign_attrs(note="only here")]
    save_trials(batch, tmp_path / "batch.nc")
    loaded = list(load_trials(tmp_path / "batch.nc"))
    assert len(loaded) == 4
    for before, after in zip(batch, loaded, strict=True):
        assert after.attrs == before.attrs
        assert {type(value) for value in after.attrs.values()} <= {int, float, str}
        for name in before.variables:
            np.testing.assert_array_equal(after[name], before[name])
            assert after[name].attrs == before[name].attrs


def test_simulated_trials_keep_their_truths_and_parameters(tmp_path):
    seeds = [np.random.SeedSequence([1, k]) for k in range(2)]
    batch = [simulate(seed=seed, duration=5.0, reflex_gain=7.0) for seed in seeds]
    save_trials(batch, tmp_path / "batch.nc")
    for before, after in zip(batch, load_trials(tmp_path / "batch.nc"), strict=True):
        assert after.attrs["reflex_gain"] == 7.0
        assert after.attrs["seed"] == before.attrs["seed"]
        np.testing.assert_array_equal(after["torque_reflex"], before["torque_reflex"])


def test_what_does_not_belong_together(tmp_path):
    with pytest.raises(DataError, match="no trials"):
        save_trials([], tmp_path / "batch.nc")
    with pytest.raises(DataError, match="trial 1 differs from trial 0"):
        save_trials([*trials(1), *trials(1, samples=60)], tmp_path / "batch.nc")
    with pytest.raises(DataError, match="no folder"):
        save_trials(trials(1), tmp_path / "nowhere" / "batch.nc")
    assert list(tmp_path.iterdir()) == []


def test_single_precision_halves_the_file_and_rounds_far_below_a_converter(tmp_path):
    batch = [simulate(seed=k, duration=10.0) for k in range(3)]
    for precision in ("double", "single"):
        save_trials(iter(batch), tmp_path / f"{precision}.nc", precision=precision)
    assert (tmp_path / "single.nc").stat().st_size < 0.6 * (tmp_path / "double.nc").stat().st_size
    for before, after in zip(batch, load_trials(tmp_path / "single.nc"), strict=True):
        assert after["torque"].dtype == np.float64
        for name in before.data_vars:
            error = np.abs(after[name] - before[name]).max() / np.abs(before[name]).max()
            assert error < 1e-7
    with pytest.raises(ValueError, match="unknown precision 'half'; known: double, single"):
        save_trials(batch, tmp_path / "half.nc", precision="half")


def test_what_is_constant_takes_a_number_for_each_trial(tmp_path):
    quiet = [simulate(seed=k, duration=10.0, snr_db=None, voluntary=0.0) for k in range(3)]
    loud = [simulate(seed=k, duration=10.0) for k in range(3)]
    save_trials(quiet, tmp_path / "quiet.nc")
    save_trials(loud, tmp_path / "loud.nc")
    assert (tmp_path / "quiet.nc").stat().st_size < 0.75 * (tmp_path / "loud.nc").stat().st_size
    for before, after in zip(quiet, load_trials(tmp_path / "quiet.nc"), strict=True):
        np.testing.assert_array_equal(after["torque_noise"], before["torque_noise"])
        assert after["torque_noise"].sizes == before["torque_noise"].sizes


def test_more_trials_than_are_read_at_a_time(tmp_path):
    batch = trials(37)
    save_trials(batch, tmp_path / "batch.nc")
    assert [trial.attrs["number"] for trial in load_trials(tmp_path / "batch.nc")] == list(range(37))


def test_blocks_share_one_pass_for_each_signal(tmp_path, monkeypatch):
    save_trials([simulate(seed=k, duration=5.0, snr_db=None, voluntary=0.0) for k in range(3)], tmp_path / "batch.nc")
    given = {"delay": 0.04, "basis": "rectifier", "identification_rate": 100.0, "reference": "reference"}
    alone = [build_regressors(trial, **given) for trial in load_trials(tmp_path / "batch.nc")]
    passes = []

    def counted(x, *args, **options):
        passes.append(np.shape(x))
        return decimate(x, *args, **options)

    monkeypatch.setattr(regressors, "decimate", counted)
    with made_once():
        ((trials_of_block, signals),) = load_blocks(tmp_path / "batch.nc")
        assert set(signals) == {"position", "torque", "reference", "torque_intrinsic", "torque_reflex"}
        share_channels(trials_of_block, signals, 100.0, 0.04)
        assert passes == [(3, 5000)] * 7  # four torques and references, and the position with two derivatives
        for trial, before in zip(trials_of_block, alone, strict=True):
            found = build_regressors(trial, **given)
            truth = decimated(trial, "torque_reflex", found.time, 100.0)
            for name in ("inputs", "torque", "reference"):
                np.testing.assert_array_equal(getattr(found, name), getattr(before, name))
            assert truth.shape == found.torque.shape
    assert len(passes) == 7 + 3  # the rectified velocity of each trial, and nothing twice
