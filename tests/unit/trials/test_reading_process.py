"""Damaged files: whatever they do to the library of their format, the program that asked for them goes on."""

import json
import os
import resource
import signal
import struct
import subprocess
import sys
import textwrap
import threading
import time

import h5py
import numpy as np
import pytest
import scipy.io

from ankleloop.errors import DataError, ResourceError
from ankleloop.trials import reading_process
from ankleloop.trials.reading_options import ReadingOptions
from ankleloop.trials.reading_process import read_channels

RATE = 500.0
P = 0.02 * np.sin(np.arange(300) / 10)
TQ = 3.0 * np.cos(np.arange(300) / 10)
OPTIONS = ReadingOptions()


@pytest.fixture
def server(monkeypatch):
    """The process that reads files."""
    server = reading_process._Server()
    monkeypatch.setattr(reading_process, "_current", server)
    yield server
    server.stop()


def write_mat(path):
    scipy.io.savemat(path, {"position": P, "torque": TQ, "fs": RATE})
    return path


def write_crashing_mat(path):
    """A file of which one byte is wrong: that of the type of the samples, which scipy takes as an index in memory."""
    content = bytearray(write_mat(path).read_bytes())
    content[content.index(struct.pack("<II", 9, 8 * P.size)) + 1] ^= 1 << 7
    path.write_bytes(content)
    return path


def assert_reads(path):
    channels = read_channels(path, OPTIONS)
    np.testing.assert_array_equal(np.ravel(channels["position"].values), P)
    np.testing.assert_array_equal(np.ravel(channels["torque"].values), TQ)
    assert channels["sampling_rate"].values.item() == RATE


def test_a_crash_refuses_the_file_and_no_other(tmp_path, server):
    good, bad = write_mat(tmp_path / "good.mat"), write_crashing_mat(tmp_path / "bad.mat")
    for _ in range(2):
        assert_reads(good)
        with pytest.raises(DataError, match=r"^bad.mat: cannot be read as .mat \(.*\): check that the file is whole"):
            read_channels(bad, OPTIONS)
    assert_reads(good)


def replace_reader(monkeypatch, server, statement):
    """Let the process run a statement where it would open a file."""
    program = f"""
        import os, sys, time
        sys.path.insert(0, sys.argv[1])
        from ankleloop.trials import reading_server
        from ankleloop.trials.scipy_files import MatContents
        class Reader(MatContents):
            def __init__(self, path):
                if path.name == "a.mat":
                    {statement}
                super().__init__(path)
        reading_server.choose_reader = lambda path: Reader
        reading_server.main()
    """
    monkeypatch.setattr(reading_process, "PROGRAM", textwrap.dedent(program))


def test_a_slow_disk_says_nothing_about_the_file(tmp_path, server, monkeypatch):
    monkeypatch.setattr(reading_process, "SECONDS", 0.1)
    replace_reader(monkeypatch, server, "time.sleep(600)")
    assert_reads(write_mat(tmp_path / "b.mat"))
    monkeypatch.setattr(reading_process, "START_SECONDS", 0.5)
    with pytest.raises(ResourceError, match=r"^a.mat: the file was not read within \d+ s: the computer is busy, or"):
        read_channels(write_mat(tmp_path / "a.mat"), OPTIONS)


def test_a_file_that_grows_while_it_is_read(tmp_path, server, monkeypatch):
    replace_reader(monkeypatch, server, "open(path, 'ab').write(bytes(8)) and 0")
    with pytest.raises(DataError, match=r"^a.mat: the file has changed while it was read: wait until it is whole"):
        read_channels(write_mat(tmp_path / "a.mat"), OPTIONS)


def test_a_halt_refuses_the_file_in_time(tmp_path, server, monkeypatch):
    monkeypatch.setattr(reading_process, "SECONDS", 0.5)
    replace_reader(monkeypatch, server, "while True: pass")
    bad, good = write_mat(tmp_path / "a.mat"), write_mat(tmp_path / "b.mat")
    assert_reads(good)
    start = time.monotonic()
    with pytest.raises(DataError, match=r"^a.mat: .* \(stopped after \d+ s, [01] s is the limit for its size\): check"):
        read_channels(bad, OPTIONS)
    assert time.monotonic() - start < 30.0
    monkeypatch.setattr(reading_process, "SECONDS", 10.0)
    assert_reads(good)


BROKEN = json.dumps({"kind": "channel", "role": "position", "name": "p", "unit": "", "shape": [2], "type": "<f8"})


@pytest.mark.parametrize(
    ("statement", "reason"),
    [
        ("x = bytearray(1 << 32)", r"it needs more than 1.1 GB of memory"),
        (f"os.write(3, {BROKEN!r}.encode() + bytes([10, 1])); os._exit(0)", r"it crashed the process that reads it"),
    ],
    ids=["memory", "an answer that breaks off"],
)
def test_a_failure_refuses_the_file_and_no_other(tmp_path, server, monkeypatch, statement, reason):
    if "bytearray" in statement and sys.platform != "linux":
        pytest.skip("other systems do not limit the address space")
    replace_reader(monkeypatch, server, statement)
    with pytest.raises(DataError, match=rf"^a.mat: cannot be read as .mat \({reason}\): check"):
        read_channels(write_mat(tmp_path / "a.mat"), OPTIONS)
    assert_reads(write_mat(tmp_path / "b.mat"))


def test_ctrl_c_leaves_no_half_answer(tmp_path, server, monkeypatch):
    replace_reader(monkeypatch, server, "time.sleep(3)")
    bad, good = write_mat(tmp_path / "a.mat"), write_mat(tmp_path / "b.mat")
    assert_reads(good)
    timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        read_channels(bad, OPTIONS)
    assert_reads(good)


def test_a_killed_process_is_started_again(tmp_path, server):
    good = write_mat(tmp_path / "a.mat")
    assert_reads(good)
    os.killpg(server._process.pid, signal.SIGKILL)
    server._process.wait()
    assert_reads(good)


def test_files_of_the_current_folder_are_not_imported(tmp_path, server, monkeypatch):
    (tmp_path / "numpy.py").write_text("raise SystemExit('the wrong numpy')")
    (tmp_path / "h5py.py").write_text("raise SystemExit('the wrong h5py')")
    monkeypatch.chdir(tmp_path)
    assert_reads(write_mat(tmp_path / "a.mat"))


def test_the_process_ends_with_its_program(tmp_path):
    good = write_mat(tmp_path / "a.mat")
    script = f"""
        from ankleloop.trials import reading_process
        from ankleloop.trials.reading_options import ReadingOptions
        reading_process.read_channels({str(good)!r}, ReadingOptions())
        print(reading_process._current._process.pid)
    """
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", textwrap.dedent(script)], capture_output=True, timeout=60
    )
    assert run.returncode == 0, run.stderr
    assert run.stderr == b""
    with pytest.raises(ProcessLookupError):
        os.kill(int(run.stdout), 0)


def test_only_wanted_variables_are_read(tmp_path, server):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["position"], file["torque"] = P, TQ
        file.attrs["sampling_rate"] = RATE
        file.create_dataset("video", (400_000_000,), "f8", chunks=(1_000_000,), fillvalue=1.0)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert_reads(path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000  # kB; the data set has 3.2 GB
