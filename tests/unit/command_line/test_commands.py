"""The command: help, exit statuses, messages, colours."""

import os
import subprocess
import sys
import warnings

import pytest

import ankleloop
from ankleloop.command_line.main import DATA, INTERRUPTED, MISTAKE, USAGE
from ankleloop.command_line.terminal import show_correction
from ankleloop.errors import ResourceError

MODULES = """
import sys
from ankleloop.command_line.main import main
main(["--help"])
print([name for name in ("matplotlib", "numba", "pandas", "scipy", "xarray") if name in sys.modules])
"""


def test_help_imports_nothing_that_takes_time():
    process = subprocess.run(
        [sys.executable, "-c", MODULES], capture_output=True, text=True, check=True
    )
    assert process.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize("program", [["ankleloop"], [sys.executable, "-m", "ankleloop"]])
def test_both_entries_are_the_command(program):
    path = f"{os.path.dirname(sys.executable)}{os.pathsep}{os.environ['PATH']}"
    process = subprocess.run(
        [*program, "--version"], capture_output=True, text=True, env={**os.environ, "PATH": path}
    )
    assert (process.returncode, process.stdout) == (0, f"ankleloop {ankleloop.__version__}\n")


@pytest.mark.parametrize(
    ("error", "status", "words"),
    [
        (
            ankleloop.DataError("a.csv: torque is constant: record it again."),
            DATA,
            ["error: a.csv: torque is constant"],
        ),
        (KeyError("delay"), MISTAKE, ["Traceback", "KeyError: 'delay'", "mistake in ankleloop"]),
        (MemoryError("2 GB"), MISTAKE, ["out of memory (2 GB)", "--start S --stop S"]),
        (
            ResourceError("x.nc: the file cannot be written"),
            MISTAKE,
            ["error: x.nc: the file cannot be written"],
        ),
        (
            OSError(28, "No space left on device", "/tmp/x"),
            MISTAKE,
            ["No space left on device: '/tmp/x'", "the disk"],
        ),
        (KeyboardInterrupt(), INTERRUPTED, ["interrupted"]),
    ],
)
def test_status_of_each_error(run, monkeypatch, error, status, words):
    def fail(*args, **options):
        raise error

    monkeypatch.setattr("ankleloop.command_line.demo.demo.callback", fail)
    result = run("demo", "--no-open")
    assert result.status == status
    for word in words:
        assert word in result.err
    assert ("Traceback" in result.err) == ("Traceback" in words)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nothing"], ["No such command 'nothing'"]),
        (["check"], ["Missing argument 'FILE'"]),
        (["check", "nowhere.mat"], ["'nowhere.mat' does not exist"]),
        (["identify", "--order", "2"], ["No such option", "--order"]),
        (["demo", "--duration", "5"], ["--duration", "20"]),
    ],
)
def test_wrong_usage(run, arguments, words):
    result = run(*arguments)
    assert result.status == USAGE
    assert result.err.startswith("Usage: ankleloop")
    for word in words:
        assert word in result.err


def test_warnings_of_the_library_are_lines(run, monkeypatch):
    def warn(**options):
        warnings.warn("a.csv: the file ends within line 3.", UserWarning, stacklevel=2)
        warnings.warn("for programmers", DeprecationWarning, stacklevel=2)
        return 0

    monkeypatch.setattr("ankleloop.command_line.demo.demo.callback", warn)
    assert run("demo").err == "warning: a.csv: the file ends within line 3.\n"


@pytest.mark.parametrize(
    ("message", "options"),
    [
        ("pass sampling_rate in Hz.", "--sampling-rate HZ"),
        ("there are 3 cases: choose one by the option case.", "--case NUMBER"),
        ("pass position_unit='deg', or correct the file.", "--position-unit deg"),
        ("take a shorter part of the recording (start, stop).", "--start S --stop S"),
        ("the loop is closed: input_matrices='instruments'", ""),
        ("sampling_rate is stated as 5 Hz, but fs is 6 Hz: leave sampling_rate out.", ""),
        ("a drift of 7 %: remove it (drift, the degree of a polynomial)", "--drift 1"),
    ],
)
def test_messages_name_the_command(capsys, message, options):
    show_correction(message, ["check", "a b.csv"])
    assert capsys.readouterr().err == (
        f"next: ankleloop check 'a b.csv' {options}\n" if options else ""
    )


TURNED = "Set torque_sign: {} (turn round the torque)"
REVERSED = "give position_sign={}, torque_sign={} to read_trial."


@pytest.mark.parametrize(
    ("words", "message", "options"),
    [
        ([], TURNED.format(-1), "--torque-sign -1"),
        (["--torque-sign", "-1"], TURNED.format(1), "--torque-sign 1"),
        (["--torque-sign=-1", "--drift", "1"], TURNED.format(1), "--drift 1 --torque-sign 1"),
        ([], REVERSED.format(-1, -1), "--position-sign -1 --torque-sign -1"),
        (
            ["--torque-sign", "-1", "--drift", "1"],
            REVERSED.format(-1, 1),
            "--drift 1 --position-sign -1 --torque-sign 1",
        ),
        (["--start", "5"], "take a shorter part (start, stop).", "--start S --stop S"),
    ],
)
def test_a_corrected_command_has_each_option_once(capsys, words, message, options):
    show_correction(message, ["check", "a.csv", *words])
    assert capsys.readouterr().err == f"next: ankleloop check a.csv {options}\n"


def test_a_reader_that_has_seen_enough_is_no_failure(recording):
    """As `head` in a pipe: the exit status is that of the recording."""
    command = [sys.executable, "-m", "ankleloop", "check", str(recording)]
    pipe = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, **pipe) as process:
        process.stdout.close()
        errors = process.stderr.read()
    assert process.returncode == 0
    assert "next: ankleloop identify" in errors
    assert "Error" not in errors
