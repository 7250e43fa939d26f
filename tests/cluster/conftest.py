import importlib.util

import pytest
from slurm import Missing, Slurm, install
from workflow_runs import Run, read_results


@pytest.fixture(scope="session")
def slurm(tmp_path_factory):
    """A Slurm of one node."""
    if importlib.util.find_spec("snakemake_executor_plugin_slurm") is None:
        pytest.skip("Snakemake's plugin for Slurm is not installed: pip install 'ankleloop[cluster]'.")
    slurm = Slurm(tmp_path_factory.mktemp("slurm"))
    try:
        install()
        slurm.start()
    except Missing as reason:
        pytest.skip(str(reason))
    except BaseException:
        slurm.stop()
        raise
    yield slurm
    slurm.stop()


@pytest.fixture
def start_cluster(start, slurm, repository):
    """Start a run of the study in a folder, on the cluster."""

    def start_cluster(folder, *arguments):
        return start(folder, "--workflow-profile", str(repository / "profiles" / "slurm"), *arguments)

    return start_cluster


@pytest.fixture(scope="session")
def local(repository, study_file, tmp_path_factory):
    """Results of a run on this machine alone."""
    folder = tmp_path_factory.mktemp("local")
    run = Run(repository, folder, folder.with_suffix(".log"), "--configfile", str(study_file))
    assert run.wait() == 0, run.text
    return read_results(folder)
