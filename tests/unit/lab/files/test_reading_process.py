"""Damaged files: whatever they do to the library of their format, they are refused by name, and the program goes on."""

import os
import signal
import struct
import subprocess
import sys
import textwrap
import threading

import h5py
import numpy as np
import pytest
import scipy.io

from ankleloop import load_estimate, load_trial, read_trial, save_estimate, save_trial, simulate
from ankleloop.errors import DataError, ResourceError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.regressors import torque_dataset
from ankleloop.trials import guarded_process, readable_files
from ankleloop.trials.files import CHECKSUM_LENGTH, has_checksum
from ankleloop.trials.trial_files import load_trials, save_trials
from ankleloop_lab.files import reading_process

RATE = 500.0
P = 0.02 * np.sin(np.arange(300) / 10)
TQ = 3.0 * np.cos(np.arange(300) / 10)


# Of recordings, and of files of the library.
PROCESSES = (reading_process.process, readable_files.process)
PROGRAMS = (
    """
        from ankleloop_lab.files import reading_process
        from ankleloop_lab.files.matlab_files import MatContents
        class Reader(MatContents):
            def __init__(self, path):
                fail(path)
                super().__init__(path)
        reading_process.choose_container = lambda path: Reader
        reading_process.main()
    """,
    """
        from ankleloop.trials import readable_files
        try_matlab = readable_files.TASKS["matlab"]
        def read(path):
            fail(path)
            yield from try_matlab(path)
        readable_files.TASKS["matlab"] = read
        readable_files.main()
    """,
)


@pytest.fixture(autouse=True)
def _new_process(monkeypatch):
    """Each test has processes of its own that read files."""
    for process in PROCESSES:
        process.stop()
    yield
    for process in PROCESSES:
        process.stop()


def write_mat(path):
    scipy.io.savemat(path, {"position": P, "torque": TQ, "fs": RATE})
    return path


def assert_reads(path):
    trial = read_trial(path)
    np.testing.assert_array_equal(trial.torque, TQ)
    assert trial.attrs["sampling_rate"] == RATE


@pytest.fixture
def replace_reader(monkeypatch):
    """Let the process run a statement where it would open a.mat."""

    def replace(statement):
        starts = f"""
            import os, signal, sys, time
            sys.path.insert(0, sys.argv[1])
            def fail(path):
                if path.name == "a.mat":
                    {statement}
        """
        for process, program in zip(PROCESSES, PROGRAMS, strict=True):
            text = textwrap.dedent(starts) + textwrap.dedent(program)
            monkeypatch.setattr(process, "program", text)

    return replace


def test_a_crash_refuses_the_file_and_no_other(tmp_path):
    good, bad = write_mat(tmp_path / "good.mat"), write_mat(tmp_path / "bad.mat")
    content = bytearray(bad.read_bytes())
    # A wrong type of the samples, which scipy takes as an index in memory.
    content[content.index(struct.pack("<II", 9, 8 * P.size)) + 1] ^= 1 << 7
    bad.write_bytes(content)
    for _ in range(2):
        assert_reads(good)
        with pytest.raises(
            DataError,
            match=r"^bad.mat: not a readable .mat file \(.*: check that the file is whole",
        ):
            read_trial(bad)
    assert_reads(good)


@pytest.mark.posix
def test_a_process_that_never_answers(tmp_path, replace_reader, monkeypatch):
    monkeypatch.setattr(guarded_process, "SECONDS", 0.01)
    monkeypatch.setattr(guarded_process, "STARTING", 4.0)
    replace_reader(
        "os.kill(os.getpid(), signal.SIGSTOP)"
    )  # it stops, and no clock of its own goes on
    with pytest.raises(ResourceError, match=r"^a.mat: .* did not answer in time"):
        read_trial(write_mat(tmp_path / "a.mat"))
    monkeypatch.setattr(guarded_process, "SECONDS", 10.0)
    assert_reads(write_mat(tmp_path / "b.mat"))


MEMORY = r"it needs more than 1.1 GB of memory"
# What the process does in place of opening a file, and what is said of the file.
LIMITS_AND_SIGNALS = {
    "while True: pass": r"stopped after \d+ s, the limit for its size",
    "x = bytearray(1 << 32)": MEMORY,
    "os.kill(os.getpid(), 11)": "it crashed the process that reads it, status -11",
}
FAILURES = {
    **LIMITS_AND_SIGNALS,
    "os.write(3, bytes([9, 0])); os._exit(0)": "it crashed the process .* status 0",
    "print('{}', flush=True); raise RecursionError('too deep')": "RecursionError: too deep",
}


@pytest.mark.parametrize(
    "statement",
    [
        pytest.param(statement, marks=pytest.mark.posix if statement in LIMITS_AND_SIGNALS else ())
        for statement in FAILURES
    ],
)
def test_a_failure_refuses_the_file_and_no_other(tmp_path, replace_reader, monkeypatch, statement):
    if FAILURES[statement] == MEMORY and sys.platform != "linux":
        pytest.skip("other systems do not limit the address space")
    replace_reader(statement)
    monkeypatch.setattr(guarded_process, "SECONDS", 0.5)
    bad, good = write_mat(tmp_path / "a.mat"), write_mat(tmp_path / "b.mat")
    assert_reads(good)
    with pytest.raises(
        DataError, match=rf"^a.mat: not a readable .mat file \({FAILURES[statement]}\): it is"
    ):
        read_trial(bad)
    with pytest.raises(
        DataError,
        match=rf"{bad.name}: not a readable .* \({FAILURES[statement]}\): it is damaged, or of",
    ):
        load_estimate(bad)
    assert_reads(good)


@pytest.mark.posix
def test_a_reader_that_the_system_kills_says_nothing_about_the_file(tmp_path, replace_reader):
    """As where memory is short."""
    replace_reader("os.kill(os.getpid(), 9)")
    for read in (read_trial, load_estimate):
        with pytest.raises(ResourceError, match=r"a.mat: the process .* was killed.*: free memory"):
            read(write_mat(tmp_path / "a.mat"))


@pytest.fixture
def _interruptible():
    """Interrupts raise an error, also in a background job, which ignores them."""
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, handler)


@pytest.mark.usefixtures("_interruptible")
@pytest.mark.posix
def test_ctrl_c_leaves_no_half_answer(tmp_path, replace_reader):
    replace_reader("time.sleep(3)")
    bad, good = write_mat(tmp_path / "a.mat"), write_mat(tmp_path / "b.mat")
    assert_reads(good)
    timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        read_trial(bad)
    assert_reads(good)


def test_files_of_the_current_folder_are_not_imported(tmp_path, monkeypatch):
    (tmp_path / "numpy.py").write_text("raise SystemExit('the wrong numpy')")
    (tmp_path / "h5py.py").write_text("raise SystemExit('the wrong h5py')")
    monkeypatch.chdir(tmp_path)
    assert_reads(write_mat(tmp_path / "a.mat"))


@pytest.mark.posix
def test_the_process_ends_with_its_program(tmp_path):
    good = write_mat(tmp_path / "a.mat")
    script = f"""
        from ankleloop_lab.files import reading_process
        reading_process.read_channels({str(good)!r}, None, "find", variables={{"torque": None}})
        print(reading_process.process._process.pid)
    """
    command = [sys.executable, "-W", "error", "-c", textwrap.dedent(script)]
    run = subprocess.run(command, capture_output=True, timeout=60)
    assert (run.returncode, run.stderr) == (0, b"")
    with pytest.raises(ProcessLookupError):
        os.kill(int(run.stdout), 0)


# --- Files of the library, whose bytes have changed


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Every kind of file, as bytes."""
    folder = tmp_path_factory.mktemp("whole")
    trial, rng = simulate(seed=1, duration=2.0), np.random.default_rng(0)
    torques = dict(zip(("net", "intrinsic", "reflex"), rng.standard_normal((3, 50)), strict=True))
    torque = torque_dataset(np.arange(50) / 100.0, 100.0, **torques)
    estimate = Estimate("riv", torque, {"K": 150.0}, {"delay": 0.04})
    save_trial(trial, folder / "trial.nc")
    save_trials([trial, trial], folder / "trials.nc", [("a", 0), ("a", 1)])
    save_estimate(estimate, folder / "estimate.nc")
    save_estimate(estimate, folder / "estimate.mat")
    return {path.name: path.read_bytes() for path in folder.iterdir()}


READERS = {
    "trial.nc": lambda path: [load_trial(path)],
    "trials.nc": lambda path: list(load_trials(path)),
    "estimate.nc": lambda path: [load_estimate(path).torque],
}


@pytest.mark.parametrize("name", READERS)
def test_every_changed_byte_is_noticed_by_this_process(whole, tmp_path, name, monkeypatch):
    monkeypatch.setattr(sys, "executable", "no-python")  # so that no other process starts
    (tmp_path / name).write_bytes(whole[name])
    assert READERS[name](tmp_path / name)
    rng = np.random.default_rng(0)
    for place in rng.choice(len(whole[name]) - CHECKSUM_LENGTH, 20, replace=False):
        content = bytearray(whole[name])
        content[place] ^= 1 << rng.integers(8)
        (tmp_path / name).write_bytes(content)
        with pytest.raises(
            DataError, match=rf"{name}: .* \(its checksum is wrong: bytes have changed"
        ):
            READERS[name](tmp_path / name)


@pytest.mark.parametrize("name", READERS)
def test_a_file_without_a_checksum_is_read_all_the_same(whole, tmp_path, name):
    (tmp_path / name).write_bytes(whole[name])
    expected = READERS[name](tmp_path / name)
    (tmp_path / name).write_bytes(whole[name][:-CHECKSUM_LENGTH])
    assert not has_checksum(tmp_path / name)
    for before, after in zip(expected, READERS[name](tmp_path / name), strict=True):
        assert after.identical(before)
        assert after.dtypes == before.dtypes
    assert [file.name for file in tmp_path.iterdir()] == [name]


def test_a_file_that_another_program_changes_has_no_wrong_checksum(whole, tmp_path):
    path = tmp_path / "trial.nc"
    path.write_bytes(whole["trial.nc"])
    with h5py.File(path, "r+") as file:
        file["torque"][3] += 1.0
        file.attrs["comment"] = "corrected"
    assert not has_checksum(path)
    assert load_trial(path).attrs["comment"] == "corrected"


def test_samples_in_other_files_are_refused(tmp_path):
    layout = h5py.VirtualLayout((300,), "f8")
    layout[:] = h5py.VirtualSource(tmp_path / "gone.h5", "position", (300,))
    with h5py.File(tmp_path / "a.nc", "w") as file:
        file.create_virtual_dataset("position", layout)
        file.create_dataset("external", (300,), "f8", external=[(str(tmp_path / "a.raw"), 0, 2400)])
        file["torque"] = TQ
    for name in ("position", "external"):
        with pytest.raises(
            DataError, match=rf"a.nc: the samples of {name} are in other files: copy"
        ):
            read_trial(tmp_path / "a.nc", position=name)
