"""Reading of files that are not to be trusted: the tests that take long."""

import gzip
import os
import subprocess
import sys
import textwrap
import time

import numpy as np
import pytest
import scipy.io

from ankleloop import identify, load_estimate, load_trial, save_estimate, save_trial, simulate
from ankleloop.errors import DataError
from ankleloop.trials import reading_process
from ankleloop.trials.files import LENGTH
from ankleloop.trials.reading_options import ReadingOptions
from ankleloop.trials.reading_process import read_channels
from ankleloop.trials.trial_files import load_trials, save_trials

OPTIONS = ReadingOptions()


def test_a_bomb_of_gzip_is_refused(tmp_path):
    with gzip.open(tmp_path / "a.csv.gz", "wb", compresslevel=9) as file:
        file.write(b"time,position,torque\n")
        for _ in range(50):
            file.write(b"0,0,0\n" * 500_000)
    with pytest.raises(DataError, match=r"a.csv.gz: the table has [\d,]+ samples .* at most 20,000,000"):
        read_channels(tmp_path / "a.csv.gz", OPTIONS)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_a_fork_of_the_program_takes_a_process_of_its_own(tmp_path):
    good = tmp_path / "a.mat"
    scipy.io.savemat(good, {"position": np.arange(300.0), "torque": np.arange(300.0), "fs": 500.0})
    script = f"""
        import os, sys
        from ankleloop.trials.reading_options import ReadingOptions
        from ankleloop.trials.reading_process import read_channels, stop
        def read(): return float(read_channels({str(good)!r}, ReadingOptions())["position"].values.sum())
        expected = read()
        children = []
        for _ in range(3):
            child = os.fork()
            if child == 0:
                equal = all(read() == expected for _ in range(5))
                stop()
                os._exit(0 if equal else 1)
            children.append(child)
        equal = all(read() == expected for _ in range(5))
        statuses = [os.waitpid(child, 0)[1] for child in children]
        sys.exit(statuses != [0, 0, 0] or not equal)
    """
    assert subprocess.run([sys.executable, "-c", textwrap.dedent(script)], timeout=60).returncode == 0


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Every kind of file of the library without its checksum, which would betray all that follows; and its reader."""
    folder = tmp_path_factory.mktemp("whole")
    trial = simulate(seed=1, duration=10.0)
    estimate = identify(trial, "pr-moesp")
    save_trial(trial, folder / "trial.nc")
    save_trials([trial, trial], folder / "trials.nc")
    save_estimate(estimate, folder / "estimate.nc")
    save_estimate(estimate, folder / "estimate.mat")
    return {path.name: path.read_bytes()[: -LENGTH if path.suffix == ".nc" else None] for path in folder.iterdir()}


FILE_READERS = {
    "trial.nc": load_trial,
    "trials.nc": lambda path: list(load_trials(path)),
    "estimate.nc": load_estimate,
    "estimate.mat": load_estimate,
}


@pytest.mark.parametrize("name", FILE_READERS)
def test_zeros_over_some_bytes_neither_kill_nor_halt_the_reader(files, tmp_path, name, monkeypatch):
    """As after a fault of the disk, here and there in the first part of the file, where the structure is."""
    monkeypatch.setattr(reading_process, "SECONDS", 2.0)
    generator = np.random.default_rng(2008)
    content, path, refused = files[name], tmp_path / name, 0
    for start in generator.integers(0, min(len(content), 8000), 60):
        length = int(generator.integers(1, 400))
        path.write_bytes(content[:start] + bytes(length) + content[start + length :])
        begin = time.monotonic()
        try:
            FILE_READERS[name](path)
        except DataError as error:
            refused += 1
            assert name in str(error)  # noqa: PT017
        assert time.monotonic() - begin < 60.0
    assert refused > 0
