import numpy as np
import pytest

from ankleloop import DataError, new_trial, simulate
from ankleloop.batch import load_trials, save_trials


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
