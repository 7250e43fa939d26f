"""A short, deterministic part of the fuzzing of tests/nightly, and the files that failed once."""

import warnings
from pathlib import Path

import h5py
import numpy as np
import pytest

from ankleloop import DataError, read_trial
from ankleloop.studies.checking import ConfigError
from ankleloop.studies.config_files import check_config_file

# --- files that failed once


@pytest.mark.parametrize("text", ["a: <<\n", "a: {b: 1, <<: c}\n", "a: [<<]\n", "a: {<<: [{b: 1}, 2]}\n"])
def test_merge_keys_that_merge_nothing(tmp_path, text):
    Path(tmp_path / "config.yaml").write_text(text)
    with pytest.raises(ConfigError, match=r"config.yaml, line 1: << takes over the keys of another mapping"):
        check_config_file(tmp_path / "config.yaml")


def test_a_comma_at_the_end_of_the_header_alone(tmp_path):
    rows = "".join(f"{k / 100},{k * k / 1000},{k}\n" for k in range(9))
    (tmp_path / "a.csv").write_text(f"time,position,torque,\n{rows}")
    np.testing.assert_array_equal(read_trial(tmp_path / "a.csv", position_unit="deg").torque, np.arange(9.0))


def test_nan_that_signals_is_a_missing_sample(tmp_path):
    torque = np.arange(20.0)
    torque[7:8].view(np.uint64)[0] = 0x7FF0000000000001
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["position"], file["torque"] = 0.001 * np.arange(20), torque
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        with pytest.raises(DataError, match=r"a.h5: torque is not finite at sample 7 "):
            read_trial(tmp_path / "a.h5", sampling_rate=200.0)
