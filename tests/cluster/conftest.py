import importlib.util
import os
import sys
from pathlib import Path

import pytest
import yaml

sys.path.insert(0, str(Path(__file__).parents[1] / "long"))

from runs import STUDY, Run, read_results
from slurm import Missing, Slurm, install


def python_path(repository):
    """The library of the copy, and what this process has; its plugins may stand in its path alone."""
    return os.pathsep.join([str(repository / "src"), *os.environ.get("PYTHONPATH", "").split(os.pathsep)])


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


@pytest.fixture(scope="session")
def repository(copy_repository):
    """A copy of the repository without results and without compiled kernels."""
    return copy_repository()


@pytest.fixture(scope="session")
def study_file(tmp_path_factory):
    """Configuration of one small study: two points in four chunks, two methods, and its notebook."""
    path = tmp_path_factory.mktemp("config") / "study.yaml"
    path.write_text(yaml.safe_dump(STUDY), encoding="utf-8")
    return path


@pytest.fixture
def start(repository, study_file, tmp_path):
    """Start a run of the study in a folder."""
    runs = []

    def start(folder, *arguments, **environment):
        folder.mkdir(exist_ok=True)
        log = tmp_path / f"run{len(runs)}.log"
        environment = {"PYTHONPATH": python_path(repository), **environment}
        run = Run(repository, folder, log, "--configfile", str(study_file), *arguments, **environment)
        runs.append(run)
        return run

    yield start
    for run in runs:
        if run.process.poll() is None:
            run.kill(jobs=True)


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
    path = python_path(repository)
    run = Run(repository, folder, folder.with_suffix(".log"), "--configfile", str(study_file), PYTHONPATH=path)
    assert run.wait() == 0, run.text
    return read_results(folder)
