import importlib.util
import time

import pytest
from slurm import Missing, Slurm, install
from workflow_runs import Run, list_differences, read_results


@pytest.fixture
def finish(start):
    """Unlock a folder and run the study to its end, as the documentation says; return the results."""

    def finish(folder, *, unlock=True):
        if unlock:
            run = start(folder, "--unlock")
            assert run.wait() == 0, run.text
        run = start(folder, "--rerun-incomplete")
        assert run.wait() == 0, run.text
        return read_results(folder)

    return finish


@pytest.fixture(scope="session")
def undisturbed(repository, study_file, tmp_path_factory):
    """Results of a run that nothing disturbs, and the time that it takes [s].

    A first run compiles the kernels of the copy; the second has the same results and is measured.
    """
    results = []
    for name in ("first", "second"):
        folder = tmp_path_factory.mktemp(name)
        begin = time.monotonic()
        run = Run(repository, folder, folder.with_suffix(".log"), "--configfile", str(study_file))
        assert run.wait() == 0, run.text
        results.append(read_results(folder))
    assert not list_differences(*results)
    return results[-1], time.monotonic() - begin


@pytest.fixture(scope="session")
def unfinished(repository, study_file, undisturbed, tmp_path_factory):
    """A folder in which every trial is identified, and nothing is reported yet."""
    folder = tmp_path_factory.mktemp("unfinished")
    run = Run(
        repository,
        folder,
        folder.with_suffix(".log"),
        "--configfile",
        str(study_file),
        "--until",
        "identify",
    )
    assert run.wait() == 0, run.text
    return folder


@pytest.fixture(scope="session")
def slurm(tmp_path_factory):
    """A Slurm of one node."""
    if importlib.util.find_spec("snakemake_executor_plugin_slurm") is None:
        pytest.skip(
            "Snakemake's plugin for Slurm is not installed: pip install 'ankleloop[cluster]'."
        )
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
        return start(
            folder, "--workflow-profile", str(repository / "profiles" / "slurm"), *arguments
        )

    return start_cluster
