"""Nothing is overwritten unasked, and a writer that fails or is killed leaves nothing behind."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from ankleloop import (
    DataError,
    identify,
    load_trial,
    save_estimate,
    save_trial,
    simulate,
)
from ankleloop.trials.files import (
    _partial_path,
    atomic_file,
    atomic_netcdf,
    write_csv,
    write_netcdf,
)
from ankleloop.trials.group_files import write_groups
from ankleloop.trials.trial_files import save_trials
from ankleloop_lab.recordings.files import export_estimate
from ankleloop_workflow.tables.estimate_tables import write_estimates


@pytest.fixture(scope="module")
def trial():
    return simulate(seed=1, duration=20.0)


@pytest.fixture(scope="module")
def estimate(trial):
    return identify(trial, "pr-moesp")


GROUPS = {"": xr.Dataset(attrs={"a": 1.0}), "x": xr.Dataset({"k": ("n", np.arange(3.0))})}


def write_text(path, **options):
    with atomic_file(path, **options) as partial:
        partial.write_text("new")


def write_stream(path, **options):
    with atomic_netcdf(path, **options) as file:
        file.dimensions = {"n": 3}
        file.create_variable("k", ("n",), float)[:] = np.arange(3.0)


def save_figure(path, **options):
    from matplotlib.figure import Figure

    from ankleloop.plotting.style import save_figure

    save_figure(Figure(), path.with_suffix(""), **options)


def write_estimate(estimate, path, **options):
    with write_estimates(path, **options) as table:
        table.add(estimate, point="only", name="m", number=0)


# Every function that writes: the name of its file, and the call with the trial, its estimate and the path.
WRITERS = {
    "atomic_file": ("x.txt", lambda t, e, path, **o: write_text(path, **o)),
    "atomic_netcdf": ("x.nc", lambda t, e, path, **o: write_stream(path, **o)),
    "write_netcdf": ("x.nc", lambda t, e, path, **o: write_netcdf({"": t}, path, **o)),
    "write_groups.nc": ("x.nc", lambda t, e, path, **o: write_groups(GROUPS, path, "v", **o)),
    "write_groups.mat": ("x.mat", lambda t, e, path, **o: write_groups(GROUPS, path, "v", **o)),
    "save_trial": ("x.nc", lambda t, e, path, **o: save_trial(t, path, **o)),
    "save_trials": ("x.nc", lambda t, e, path, **o: save_trials([t], path, [("a", 0)], **o)),
    "save_estimate.nc": ("x.nc", lambda t, e, path, **o: save_estimate(e, path, **o)),
    "save_estimate.mat": ("x.mat", lambda t, e, path, **o: save_estimate(e, path, **o)),
    "estimate table": ("x.parquet", lambda t, e, path, **o: write_estimate(e, path, **o)),
    "export_estimate.csv": ("x.csv", lambda t, e, path, **o: export_estimate(e, path, **o)),
    "write_csv": ("x.csv", lambda t, e, path, **o: write_csv(t.to_dataframe().head(), path, **o)),
    "save_figure": ("x.png", lambda t, e, path, **o: save_figure(path, **o)),
}
writers = pytest.mark.parametrize("writer", WRITERS)


@writers
def test_an_existing_file_is_replaced_only_with_overwrite(trial, estimate, tmp_path, writer):
    name, write = WRITERS[writer]
    path = tmp_path / name
    path.write_text("the only recording")
    with pytest.raises(DataError, match=rf"{name}: the file exists already: .*overwrite=True"):
        write(trial, estimate, path)
    assert path.read_text() == "the only recording"
    assert os.listdir(tmp_path) == [name]
    write(trial, estimate, path, overwrite=True)
    assert path.read_bytes() != b"the only recording"
    assert not [item for item in os.listdir(tmp_path) if item.startswith(".")]
    for item in tmp_path.iterdir():
        item.write_bytes(b"")  # as modules for temporary files make one: nothing is lost
    write(trial, estimate, path)
    assert path.stat().st_size > 0


# --- What is no file


@pytest.mark.posix
def test_outputs_that_are_no_files(tmp_path):
    for path, message in (
        (tmp_path, "this is a folder or a device"),
        (tmp_path / "none" / "x.nc", "there is no folder .*: make it first"),
        (tmp_path / ("x" * 300), r"cannot be written \(File name too long\)"),
    ):
        with pytest.raises(DataError, match=message):
            write_text(path, overwrite=True)
    (tmp_path / "lost").symlink_to("nowhere")
    with pytest.raises(DataError, match="exists already"):
        write_text(tmp_path / "lost")


@pytest.mark.posix
def test_inputs_that_are_no_files(tmp_path):
    for path, message in (
        (tmp_path, "this is a folder or a device, no file"),
        (tmp_path / ("x" * 300), r"cannot be opened \(File name too long\)"),
    ):
        with pytest.raises(DataError, match=message):
            load_trial(path)


# --- A disk that is full, a folder that is read-only

LIMITED = """
import resource, signal, sys
from itertools import product
from pathlib import Path
sys.path.insert(0, sys.argv[1])
import test_files
from ankleloop import identify, simulate
from ankleloop.errors import ResourceError

trial = simulate(seed=1, duration=20.0)
estimate = identify(trial, "pr-moesp")
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
for (limit, exists), writer in product(((4, False), (20_000, True)), test_files.WRITERS):
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
    name, write = test_files.WRITERS[writer]
    path = Path(sys.argv[2]) / str(limit) / f"{writer}-{exists}" / name
    path.parent.mkdir(parents=True)
    if exists:
        path.write_text("good")
    try:
        write(trial, estimate, path, overwrite=exists)
    except ResourceError as error:
        print(limit, writer, exists, [item.name for item in path.parent.iterdir()], error, sep="|")
"""


@pytest.mark.posix
def test_a_full_disk_leaves_the_good_file_and_nothing_else(tmp_path):
    """A file that reaches the limit of its size fails like one on a full disk; HDF5 alone would crash the process."""
    command = [sys.executable, "-c", LIMITED, str(Path(__file__).parent), str(tmp_path)]
    run = subprocess.run(command, capture_output=True, text=True)
    assert (run.returncode, run.stderr) == (0, "")
    lines = [line.split("|") for line in run.stdout.splitlines()]
    refused = {limit: {line[1] for line in lines if line[0] == limit} for limit in ("4", "20000")}
    assert refused["4"] == {*WRITERS} - {"atomic_file"}  # what `write_text` writes is not larger
    assert refused["20000"] >= {
        "write_netcdf",
        "save_trial",
        "save_trials",
    }  # in the middle of the samples
    for limit, writer, exists, items, message in lines:
        name = WRITERS[writer][0]
        path = tmp_path / limit / f"{writer}-{exists}" / name
        assert items == (f"['{name}']" if exists == "True" else "[]"), writer
        assert exists == "False" or path.read_text() == "good"
        assert (
            f"{path}: the file cannot be written (File too large): free space in the folder {path.parent}"
            in message
        )


@pytest.mark.posix
def test_a_folder_that_is_read_only(trial):
    with pytest.raises(
        DataError, match=r"^/sys/x.nc: the file cannot be written \(.*\): .*the folder /sys"
    ):
        save_trial(trial, "/sys/x.nc")


# --- Processes that are killed, and several writers

WRITER = """
import sys, time
from ankleloop.trials.files import atomic_file, atomic_netcdf
with atomic_netcdf(sys.argv[1]) as file:
    print("ready", flush=True)
    time.sleep(60)
"""


def start_writer(path):
    process = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "ready\n"
    return process


@pytest.mark.posix
def test_the_partial_file_of_a_killed_writer_is_removed_and_that_of_a_living_one_is_not(tmp_path):
    path = tmp_path / "torques.nc"
    dead, living = start_writer(path), start_writer(path)
    dead.send_signal(signal.SIGKILL)
    dead.communicate()
    assert len(os.listdir(tmp_path)) == 2
    write_text(tmp_path / "other.nc")  # the partial files of another file are not touched
    write_text(tmp_path / "torques.nc.nc")
    assert len(os.listdir(tmp_path)) == 4
    write_text(path)
    (partial,) = [name for name in os.listdir(tmp_path) if name.startswith(".")]
    assert f"-{living.pid}-" in partial
    living.kill()
    living.communicate()
    write_text(path, overwrite=True)
    assert sorted(os.listdir(tmp_path)) == ["other.nc", "torques.nc", "torques.nc.nc"]


@pytest.mark.parametrize("name", ["a[b]*?.nc", "ä" * 120 + ".nc", "x" * 250])
@pytest.mark.posix
def test_partial_files_of_unusual_names(tmp_path, name):
    write_text(tmp_path / name)
    assert os.listdir(tmp_path) == [name]
    assert len(os.fsencode(_partial_path(tmp_path / name).name)) <= 255
