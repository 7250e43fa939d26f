"""Results in a storage of Snakemake instead of the working folder, tried with its plugin for a file system."""

import importlib.util
import shutil

import pytest
from workflow_runs import list_differences, read_results


@pytest.fixture
def storage(tmp_path):
    """Arguments of a run that keeps all results in a storage, and the folder that plays it."""
    if importlib.util.find_spec("snakemake_storage_plugin_fs") is None:
        pytest.skip(
            "Snakemake's plugin for storage in a file system is not installed: pip install 'ankleloop[cluster]'."
        )
    if not shutil.which("rsync"):
        pytest.skip(
            "the plugin for storage in a file system needs the program rsync, which is not installed."
        )
    folder = tmp_path / "storage"
    folder.mkdir()
    return ["--default-storage-provider", "fs", "--default-storage-prefix", str(folder)], folder


def test_results_in_a_storage_are_those_of_one_folder(start, storage, undisturbed, tmp_path):
    arguments, folder = storage
    run = start(tmp_path / "work", *arguments)
    assert run.wait() == 0, run.text
    # Settings of jobs stay in the working folder.
    stored = read_results(folder) | read_results(tmp_path / "work")
    assert not list_differences(undisturbed[0], stored)
    assert not list((tmp_path / "work").glob("results/**/*.nc"))
