"""A short, deterministic part of the fuzzer (`make fuzz`), the files that failed once, and the fuzzer itself."""

import warnings
from pathlib import Path

import h5py
import numpy as np
import pytest
from fuzz import fuzz
from fuzz.corpus import POSITION, READERS, make_corpus
from fuzz.mutation import mutate

from ankleloop import DataError, read_trial
from ankleloop.studies.checking import ConfigError
from ankleloop.studies.config_files import check_config_file

FILES = 12  # of each reader


@pytest.mark.parametrize("reader", READERS)
def test_damaged_files_are_read_or_refused(reader, tmp_path):
    counts, failures = fuzz.fuzz(reader, range(FILES), 60.0, 2026, tmp_path)
    assert failures == {}
    assert counts["files"] == FILES == counts["read"] + counts["refused"]


@pytest.mark.parametrize("reader", [reader for reader in READERS if reader not in ("config", "csv.gz")])
def test_whole_files_are_read(reader, tmp_path):
    for suffix, content in make_corpus(reader):
        path = tmp_path / f"a{suffix}"
        path.write_bytes(content)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of a table without an end of its last line
            trial = read_trial(path, sampling_rate=200.0)
        np.testing.assert_allclose(trial.position, POSITION, atol=6e-6)


def test_files_are_the_same_in_every_run():
    corpus = make_corpus("csv")
    contents = [fuzz.make_file("csv", number, 7, corpus)[1] for number in range(20)]
    assert contents == [fuzz.make_file("csv", number, 7, corpus)[1] for number in range(20)]
    assert len(set(contents)) > 15


def test_mutations_change_files_of_any_length():
    rng = np.random.default_rng(0)
    for content in (b"", b"a", b"ab,1.5\n" * 50):
        changed = [mutate(content, [content, b"x"], rng) for _ in range(200)]
        assert all(isinstance(other, bytes) for other in changed)
        assert len(set(changed)) > (20 if len(content) > 5 else 1)


@pytest.mark.parametrize("error", [MemoryError, RuntimeError, KeyError, SystemError])
def test_other_errors_are_failures(error, tmp_path, monkeypatch):
    def fail(*_, **__):
        raise error

    monkeypatch.setattr(fuzz, "read_trial", fail)
    counts, failures = fuzz.fuzz("csv", range(3), 60.0, 1, tmp_path)
    assert counts["failures"] == len(failures) == 3
    assert {path.name for path in tmp_path.iterdir()} == set(failures)  # they are left for a look


def test_slow_files_and_messages_without_a_file_are_failures(tmp_path, monkeypatch):
    path = tmp_path / "a.csv"
    path.write_bytes(make_corpus("csv")[0][1])
    rng = np.random.default_rng(0)
    monkeypatch.setattr(fuzz, "LONGEST", 0.0)
    assert fuzz.try_file("csv", path, rng)[0] == "failures"
    monkeypatch.undo()

    def refuse(*_, **__):
        raise DataError("something is wrong")

    monkeypatch.setattr(fuzz, "read_trial", refuse)
    assert fuzz.try_file("csv", path, rng) == (
        "failures",
        "the message does not name the file: something is wrong",
    )


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
