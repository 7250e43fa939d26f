"""A user who may write neither the folder of the library nor the home, as on the nodes of some clusters."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from workflow_runs import PROGRAM, list_differences, read_results

NOBODY = "65534"
CODE = """
import pathlib, warnings
with warnings.catch_warnings(record=True) as records:
    warnings.simplefilter("default")  # as a user has it: once from one place
    import ankleloop
    trial = ankleloop.simulate(seed=1, duration=12.0)
print(len([record for record in records if "NUMBA_CACHE_DIR" in str(record.message)]), trial.torque.values.sum().hex())
for folder in (pathlib.Path.home(), pathlib.Path(ankleloop.__file__).parent):
    try:
        (folder / "file").touch()
    except PermissionError:
        continue
    raise SystemExit(f"{folder} can be written")
"""


@pytest.fixture
def folders():
    """A home that can only be read, and folders `work` and `tmp`; those of pytest are closed to all other users."""
    with tempfile.TemporaryDirectory() as path:
        folder = Path(path)
        folder.chmod(0o755)
        for name in ("home", "work", "tmp"):
            (folder / name).mkdir()
        (folder / "home").chmod(0o555)
        for name in ("work", "tmp"):
            shutil.chown(folder / name, int(NOBODY), int(NOBODY))
        yield folder


@pytest.fixture
def run_as_nobody(folders):
    """Run a program as a user without any rights but to read, in a folder that it may write."""
    if os.geteuid() != 0 or not shutil.which("setpriv"):
        pytest.skip("only root can become a user who may write nothing.")
    # Python itself may lie in a folder of root: this user may read everything.
    user = ["setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups"]
    user += ["--inh-caps=+dac_read_search", "--ambient-caps=+dac_read_search"]

    def run(*command, **environment):
        variables = {
            name: value for name, value in os.environ.items() if name != "ANKLELOOP_RECORDINGS"
        }
        process = subprocess.run(
            [*user, *map(str, command)],
            cwd=folders / "work",
            env={
                **variables,
                "HOME": str(folders / "home"),
                "TMPDIR": str(folders / "tmp"),
                **environment,
            },
            capture_output=True,
            text=True,
        )
        assert process.returncode == 0, process.stdout + process.stderr
        return process.stdout

    return run


@pytest.fixture
def source(repository, tmp_path):
    """The library without compiled kernels, in a folder that is not that user's."""
    folder = tmp_path / "library"
    shutil.copytree(repository / "src", folder, ignore=shutil.ignore_patterns("__pycache__"))
    path = os.environ.get("PYTHONPATH", "")
    return os.pathsep.join([str(folder), path]).rstrip(os.pathsep)


def test_kernels_are_compiled_in_memory_or_kept_where_a_variable_says(
    run_as_nobody, source, folders
):
    warned, value = run_as_nobody(sys.executable, "-c", CODE, PYTHONPATH=source).split()
    assert warned == "1"
    folder = folders / "work" / "kernels"
    for _ in range(2):
        answer = run_as_nobody(
            sys.executable, "-c", CODE, PYTHONPATH=source, NUMBA_CACHE_DIR=str(folder)
        )
        assert answer.split() == ["0", value]
        files = sorted(folder.rglob("*.nbc"))
        assert files
    assert sorted(folder.rglob("*.nbc")) == files


def test_a_study_runs_with_a_cache_of_its_own(
    run_as_nobody, source, repository, study_file, undisturbed, folders
):
    """The results are those of another user, but for the name of who has made them."""
    expected = dict(undisturbed[0])
    snakefile = repository / "Snakefile"
    path = f"{PROGRAM.parent}{os.pathsep}{os.environ['PATH']}"
    cache = str(folders / "work" / "cache")
    arguments = (PROGRAM, "--cores", "2", "--snakefile", snakefile, "--configfile", study_file)
    run_as_nobody(*arguments, PYTHONPATH=source, PATH=path, XDG_CACHE_HOME=cache)
    results = read_results(folders / "work")
    provenance, own = (json.loads(files.pop("provenance.json")) for files in (expected, results))
    assert provenance | {"agent": own["agent"]} == own
    assert not list_differences(expected, results)
