from pathlib import Path
from types import SimpleNamespace

import pytest

from ankleloop import simulate
from ankleloop_lab.command_line.main import main
from ankleloop_lab.files.demo_files import write_recording


@pytest.fixture
def run(capsys, coarse_pictures):
    """Run a command in this process; it gives its status, its standard output and its standard error."""

    def run_command(*arguments):
        capsys.readouterr()
        status = main([str(argument) for argument in arguments])
        output = capsys.readouterr()
        return SimpleNamespace(status=status, out=output.out, err=output.err)

    return run_command


@pytest.fixture(scope="session")
def trial():
    """A simulated trial in closed loop."""
    return simulate(seed=1, duration=20.0)


@pytest.fixture
def recording(trial, tmp_path) -> Path:
    """The trial as a CSV file, with angles in degrees."""
    path = tmp_path / "S1 (pre).csv"
    write_recording(trial, path, "csv")
    return path
