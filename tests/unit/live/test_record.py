"""What is recorded during a live estimate can be read as trials."""

import numpy as np

from ankleloop import read_trial
from ankleloop.live.record import Record
from ankleloop.trials.channels import CHANNELS


def test_behind_a_gap_there_is_another_trial_and_no_file_is_replaced(tmp_path):
    (tmp_path / "record-2.csv").touch()
    samples = np.random.default_rng(1).uniform(-0.01, 0.01, (3, 800))
    numbers = np.delete(np.arange(1000), slice(500, 700))
    with Record(tmp_path / "record.csv", 1000.0) as record:
        for piece in (slice(0, 300), slice(300, 300), slice(300, None)):
            channels = dict(zip(CHANNELS, samples[:, piece], strict=True))
            record.add({**channels, "time": 7.0 + numbers[piece] / 1000.0})
    assert [path.name for path in record.paths] == ["record.csv", "record-3.csv"]
    parts = [read_trial(path) for path in record.paths]
    for part, expected in zip(parts, (samples[:, :500], samples[:, 500:]), strict=True):
        assert np.array_equal([part[name] for name in CHANNELS], expected)
