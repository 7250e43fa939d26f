"""The wheel and the source distribution, and an environment that has nothing but what their metadata ask for."""

import os
import subprocess
import sys
import tarfile
from importlib.metadata import distribution
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).parents[2]
BUILD = "import sys; from flit_core import buildapi; print(getattr(buildapi, sys.argv[1])(sys.argv[2]))"


def build(kind, folder, source=ROOT):
    """Build a "wheel" or an "sdist" from a source tree; its path."""
    command = [sys.executable, "-c", BUILD, f"build_{kind}", str(folder)]
    process = subprocess.run(command, cwd=source, capture_output=True, text=True, check=True)
    return folder / process.stdout.split()[-1]


def unpack(sdist, folder):
    """Unpack a source distribution; the folder of its source tree."""
    with tarfile.open(sdist) as archive:
        archive.extraction_filter = getattr(tarfile, "data_filter", None)  # not before Python 3.11.4
        archive.extractall(folder)
    return folder / sdist.name.removesuffix(".tar.gz")


def list_requirements(name):
    """Distributions that one requires without its extras, and those that these require; itself is not among them."""
    names, pending = set(), [name]
    while pending:
        texts = distribution(pending.pop()).requires or ()
        required = [item for item in map(Requirement, texts) if not item.marker or item.marker.evaluate({"extra": ""})]
        pending += [item.name for item in required if item.name not in names]
        names |= {item.name for item in required}
    return names


def make_environment(folder, wheel):
    """An environment with a wheel and the distributions that it requires, those of this environment, and no others."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True)
    python = folder / "bin" / "python"
    packages = Path(run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))").strip())
    for name in list_requirements("ankleloop"):
        installed = distribution(name)
        for part in {file.parts[0] for file in installed.files or () if file.parts[0] not in ("..", "__pycache__")}:
            target = packages / part
            if not target.exists():
                target.symlink_to(installed.locate_file(part))
    install = ["-m", "pip", "--python", str(python), "install", "--quiet", "--no-deps", "--no-index", str(wheel)]
    subprocess.run([sys.executable, *install], check=True)
    return folder / "bin"


def run(program, *arguments, folder=None, check=True):
    """Run a program of an environment, which sees no other path; its output."""
    hidden = ("PYTHON", "VIRTUAL_ENV", "ANKLELOOP", "NUMBA")
    variables = {name: value for name, value in os.environ.items() if not name.startswith(hidden)}
    process = subprocess.run(
        [str(program), *map(str, arguments)], cwd=folder, env=variables, capture_output=True, text=True
    )
    assert not check or process.returncode == 0, process.stdout + process.stderr
    return process.stdout
