import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PARTS = ("Snakefile", "workflow", "config", "notebooks", "data", "src", "profiles")
sys.path.insert(0, str(ROOT / "workflow"))


def pytest_addoption(parser):
    parser.addoption(
        "--update-expected",
        action="store_true",
        help="write tests/regression/expected anew from the reduced configuration instead of comparing with it",
    )


@pytest.fixture(scope="session")
def house(tmp_path_factory):
    """A copy of the repository, as a user has it."""
    folder = tmp_path_factory.mktemp("house")
    for part in PARTS:
        copy = shutil.copytree if (ROOT / part).is_dir() else shutil.copy
        extra = {"ignore": shutil.ignore_patterns("__pycache__")} if (ROOT / part).is_dir() else {}
        copy(ROOT / part, folder / part, **extra)
    return folder


@pytest.fixture(scope="session")
def snakemake():
    """Run snakemake in a copy, and return what it says."""

    def run(folder, *arguments, check=True, **environment):
        program = Path(sys.executable).with_name("snakemake")
        inherited = {k: v for k, v in os.environ.items() if k != "ANKLELOOP_RECORDINGS"}
        path = f"{program.parent}{os.pathsep}{os.environ['PATH']}"
        ran = subprocess.run(
            [str(program), "--cores", "2", *arguments],
            cwd=folder,
            env={**inherited, "PYTHONPATH": str(folder / "src"), "PATH": path, **environment},
            capture_output=True,
            text=True,
        )
        assert not check or ran.returncode == 0, ran.stdout + ran.stderr
        return ran.stdout + ran.stderr

    return run


@pytest.fixture(scope="session")
def made(house, snakemake):
    """The whole paper, reduced by config/ci.yaml."""
    snakemake(house, "--configfile", "config/ci.yaml")
    return house
