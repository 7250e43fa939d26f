"""What is recorded during a live estimate can be read as trials."""

import numpy as np

from ankleloop import read_trial
from ankleloop.live.record import Record


def test_behind_a_gap_there_is_another_trial_and_no_file_is_replaced(tmp_path):
    (tmp_path / "record-2.csv").write_text("mine")
    samples = np.random.default_rng(1).uniform(-0.01, 0.01, (3, 800))
    numbers = np.delete(np.arange(1000), slice(500, 700))
    record = Record(tmp_path / "record.csv", 1000.0)
    for piece in (slice(0, 300), slice(300, 300), slice(300, None)):
        position, torque, reference = samples[:, piece]
        time = 7.0 + numbers[piece] / 1000.0
        record.add({"position": position, "torque": torque, "reference": reference, "time": time})
    record.close()
    assert [path.name for path in record.paths] == ["record.csv", "record-3.csv"]
    parts = [read_trial(path) for path in record.paths]
    assert [part.sizes["time"] for part in parts] == [500, 300]
    for name, values in zip(("position", "torque", "reference"), samples, strict=True):
        np.testing.assert_allclose(
            np.concatenate([part[name] for part in parts]), values, rtol=1e-8
        )
    assert (tmp_path / "record-2.csv").read_text() == "mine"
