"""What is recorded during a live estimate can be read as trials."""

import numpy as np

from ankleloop import LiveEstimate, read_trial
from ankleloop.trials.channels import CHANNELS
from ankleloop_lab.live.record import Record


def test_behind_a_gap_there_is_another_trial_and_no_file_is_replaced(tmp_path):
    (tmp_path / "record-2.csv").touch()
    samples = np.random.default_rng(1).uniform(-0.01, 0.01, (3, 1000))
    samples[1, 900] = np.nan
    numbers = np.delete(np.arange(1000), slice(500, 700))
    with Record(tmp_path / "record.csv", 1000.0) as record:
        live = LiveEstimate(1000.0, record=record)
        for piece in (numbers[:300], numbers[200:300], numbers[300:]):
            live.add(*samples[:, piece], 7.0 + piece / 1000.0)
    names = [path.name for path in record.paths]
    assert names == ["record.csv", "record-3.csv", "record-4.csv"]
    for path, part in zip(record.paths, ((0, 500), (700, 900), (901, 1000)), strict=True):
        trial = read_trial(path)
        assert np.array_equal([trial[name] for name in CHANNELS], samples[:, slice(*part)])


def test_a_sender_that_is_started_again_has_a_file_of_its_own(tmp_path):
    """Its samples are neither dropped until its clock has caught up, nor joined to those before."""
    samples = np.random.default_rng(1).uniform(-0.01, 0.01, (3, 1000))
    with Record(tmp_path / "record.csv", 1000.0) as record:
        live = LiveEstimate(1000.0, record=record)
        live.add(*samples[:, :600], np.arange(600) / 1000.0)
        live.add(*samples[:, 600:], np.arange(400) / 1000.0)
    for path, part in zip(record.paths, ((0, 600), (600, 1000)), strict=True):
        trial = read_trial(path)
        assert np.array_equal([trial[name] for name in CHANNELS], samples[:, slice(*part)])
