"""Files of the library whose bytes have changed: read right, or refused with their name, and never fatal."""

import sys
import textwrap
import time

import h5py
import numpy as np
import pytest

from ankleloop import DataError, load_estimate, load_trial, save_estimate, save_trial, simulate
from ankleloop.errors import ResourceError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.regressors import torque_dataset
from ankleloop.trials import reading_process
from ankleloop.trials.files import LENGTH, append_checksum, has_right_checksum
from ankleloop.trials.reading_process import name_errors, readable_file
from ankleloop.trials.trial_files import load_trials, save_trials


@pytest.fixture(scope="module")
def estimate():
    rng = np.random.default_rng(0)
    torques = {name: rng.standard_normal(50) for name in ("net", "intrinsic", "reflex")}
    return Estimate("riv", torque_dataset(np.arange(50) / 100.0, 100.0, **torques), None, {"K": 150.0}, {"delay": 0.04})


@pytest.fixture(scope="module")
def whole(estimate, tmp_path_factory):
    """Every kind of file, as bytes."""
    folder = tmp_path_factory.mktemp("whole")
    trial = simulate(seed=1, duration=2.0)
    save_trial(trial, folder / "trial.nc")
    save_trials([trial, trial], folder / "trials.nc")
    save_estimate(estimate, folder / "estimate.nc")
    save_estimate(estimate, folder / "estimate.mat")
    return {path.name: path.read_bytes() for path in folder.iterdir()}


READERS = {
    "trial.nc": lambda path: [load_trial(path)],
    "trials.nc": lambda path: list(load_trials(path)),
    "estimate.nc": lambda path: [load_estimate(path).torque],
    "estimate.mat": lambda path: [load_estimate(path).torque],
}
WITH_CHECKSUM = [name for name in READERS if name.endswith(".nc")]


@pytest.fixture
def replace_program(monkeypatch):
    """Let the other process be one that runs these statements first."""

    def replace(statements):
        begin = "import os, sys; sys.path.insert(0, sys.argv[1]); from ankleloop.trials import reading_server"
        monkeypatch.setattr(
            reading_process, "PROGRAM", "\n".join([begin, textwrap.dedent(statements), "reading_server.main()"])
        )

    server = reading_process._Server()
    monkeypatch.setattr(reading_process, "_current", server)
    yield replace
    server.stop()


@pytest.mark.parametrize("name", WITH_CHECKSUM)
def test_a_whole_file_is_read_by_this_process(whole, tmp_path, name, monkeypatch):
    monkeypatch.setattr(sys, "executable", "/bin/false")  # so that no other process starts
    (tmp_path / name).write_bytes(whole[name])
    assert READERS[name](tmp_path / name)


@pytest.mark.parametrize("name", WITH_CHECKSUM)
def test_every_changed_byte_is_noticed(whole, tmp_path, name, monkeypatch):
    monkeypatch.setattr(sys, "executable", "/bin/false")
    rng = np.random.default_rng(0)
    for place in rng.choice(len(whole[name]) - LENGTH, 50, replace=False):
        content = bytearray(whole[name])
        content[place] ^= 1 << rng.integers(8)
        (tmp_path / name).write_bytes(content)
        with pytest.raises(DataError, match=rf"{tmp_path / name}: .* \(its checksum is wrong: bytes have changed"):
            READERS[name](tmp_path / name)


@pytest.mark.parametrize("name", WITH_CHECKSUM)
def test_a_file_without_a_checksum_is_read_all_the_same(whole, tmp_path, name):
    (tmp_path / name).write_bytes(whole[name])
    expected = READERS[name](tmp_path / name)
    (tmp_path / name).write_bytes(whole[name][:-LENGTH])
    assert has_right_checksum(tmp_path / name) is None
    for before, after in zip(expected, READERS[name](tmp_path / name), strict=True):
        assert after.identical(before)
        assert [variable.dtype for variable in after.variables.values()] == [
            variable.dtype for variable in before.variables.values()
        ]
    assert [file.name for file in tmp_path.iterdir()] == [name]


def test_a_file_that_another_program_changes_has_no_wrong_checksum(whole, tmp_path):
    path = tmp_path / "trial.nc"
    path.write_bytes(whole["trial.nc"])
    with h5py.File(path, "r+") as file:
        file["torque"][3] += 1.0
        file.attrs["comment"] = "corrected"
    assert has_right_checksum(path) is None
    trial = load_trial(path)
    assert trial.attrs["comment"] == "corrected"


@pytest.mark.parametrize(
    ("name", "statement", "reason"),
    [
        ("trials.nc", "while True: pass", r"stopped after \d s, [01] s is the limit for its size"),
        ("estimate.mat", "os.kill(os.getpid(), 11)", "it crashed the process that reads it, SIGSEGV"),
        ("trial.nc", "x = bytearray(1 << 33)", r"it needs more than 1\.\d GB of memory"),
    ],
)
def test_a_file_that_halts_or_kills_its_library_is_refused(
    whole, tmp_path, name, statement, reason, monkeypatch, replace_program
):
    if "bytearray" in statement and sys.platform != "linux":
        pytest.skip("other systems do not limit the address space")
    replace_program(f"""
        def copy(path):
            {statement}
        reading_server._copy_netcdf = reading_server._copy_matlab = copy
    """)
    monkeypatch.setattr(reading_process, "SECONDS", 0.5)
    content = whole[name]
    (tmp_path / name).write_bytes(content[:-LENGTH] if name in WITH_CHECKSUM else content)
    start = time.monotonic()
    with pytest.raises(DataError, match=rf"{tmp_path / name}: not a readable .* \({reason}\): it is damaged, or of"):
        READERS[name](tmp_path / name)
    assert time.monotonic() - start < 10.0


def test_samples_in_other_files_are_refused(tmp_path):
    layout = h5py.VirtualLayout((300,), "f8")
    layout[:] = h5py.VirtualSource(tmp_path / "gone.h5", "position", (300,))
    with h5py.File(tmp_path / "a.nc", "w") as file:
        file.create_virtual_dataset("position", layout)
    with pytest.raises(DataError, match=r"a.nc: not a readable .*the samples of position are in other files"):
        load_trial(tmp_path / "a.nc")


def test_a_reader_that_the_system_kills_says_nothing_about_the_file(whole, tmp_path, replace_program):
    """As where memory is short."""
    replace_program("""
        def copy(path):
            os.kill(os.getpid(), 9)
        reading_server._copy_netcdf = copy
    """)
    (tmp_path / "trial.nc").write_bytes(whole["trial.nc"][:-LENGTH])
    with pytest.raises(ResourceError, match=r"trial.nc: the process .* was killed \(SIGKILL\), .*: free memory"):
        load_trial(tmp_path / "trial.nc")


def test_errors_of_libraries_get_the_name_of_the_file_and_the_remedy(tmp_path):
    (tmp_path / "x.nc").write_bytes(b"content")
    append_checksum(tmp_path / "x.nc")
    message = r"x.nc: not a readable thing \(KeyError: 'k'\): it is damaged.*: buy it\.$"
    for context in (readable_file, name_errors):
        with pytest.raises(DataError, match=message) as e, context(tmp_path / "x.nc", "thing", "buy it"):
            raise KeyError("k")
        assert isinstance(e.value.__cause__, KeyError)
        with pytest.raises(DataError, match=r"^as it is$"), context(tmp_path / "x.nc", "thing", "buy it"):
            raise DataError("as it is")
