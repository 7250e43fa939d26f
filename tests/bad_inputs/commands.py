"""Commands, with their exit status: a plan of the workflow, and setting up the environment."""

import os
import subprocess
import sys
from functools import partial
from pathlib import Path

from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import text_file

TITLE = "Commands"
ROOT = Path(__file__).parents[2]


def _run(folder: Path, command: list[str], **environment: str) -> subprocess.CompletedProcess:
    inherited = {name: value for name, value in os.environ.items() if name != "ANKLELOOP_RECORDINGS"}
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    paths = {"PATH": path, "PYTHONPATH": str(ROOT / "src"), **environment}
    return subprocess.run(command, cwd=folder, env=inherited | paths, capture_output=True, text=True, check=False)


def plan(config: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess:
    """Plan the workflow with a configuration beside that of the repository: snakemake --dry-run."""
    program = str(Path(sys.executable).with_name("snakemake"))
    snakefile = ["--snakefile", str(ROOT / "workflow" / "Snakefile"), "--configfile", str(config)]
    return _run(config.parent, [program, "--dry-run", "--cores", "1", *snakefile, *arguments], **environment)


def set_up(python: Path) -> subprocess.CompletedProcess:
    """Set up an environment with a Python: make setup."""
    environment = f"VENV={python.parent / 'environment'}"
    return _run(ROOT, ["make", "setup", environment, f"PYTHON={python if python.is_file() else ''}"])


def _old_python(folder: Path) -> Path:
    """A program that says of itself that it is Python 3.9."""
    program = folder / "python3"
    program.write_text('#!/bin/sh\n[ "$1" = --version ] && echo "Python 3.9.2" && exit 0\nexit 1\n')
    program.chmod(0o755)
    return program


def _recordings(folder: Path) -> Path:
    """A study of a recording that is not there."""
    study = "{kind: recordings, folder: '${LABORATORY}', files: {S1: {file: a.mat}}, methods: {a: {method: riv}}}"
    return text_file("config.yaml", f"run: [r]\nstudies: {{r: {study}}}\n")(folder)


row = partial(rows_of(plan), error=None, status=1, shown="snakemake --dry-run")

ROWS: list[BadInput] = [
    row(
        "a study that does not exist",
        text_file("config.yaml", "run: [table9]\n"),
        "config: run: there is no study 'table9'",
    ),
    row(
        "a folder of recordings in a variable that is not set",
        _recordings,
        "LABORATORY",
    ),
]
if os.name == "posix":
    make = partial(rows_of(set_up), error=None, status=2, shown="make")
    ROWS += [
        make("a Python that is too old", _old_python, "Python 3.9.2 is too old: ankleloop needs Python 3.11 or newer"),
        make("no Python", lambda folder: folder / "python3", "There is no Python on this machine"),
    ]
