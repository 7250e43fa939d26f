"""The command: help, exit statuses, messages, colours."""

import pickle
import re
import subprocess
import sys
import warnings

import pytest
from hypothesis import given
from hypothesis import strategies as st

import ankleloop
from ankleloop.errors import ResourceError
from ankleloop_lab.command_line.check import check
from ankleloop_lab.command_line.identify import CHOICE
from ankleloop_lab.command_line.main import DATA, INTERRUPTED, MISTAKE, USAGE
from ankleloop_lab.command_line.reference import REFERENCE, reference_text
from ankleloop_lab.command_line.terminal import correct, name_option, show_correction
from ankleloop_lab.files.reading_process import CONTAINERS

MODULES = """
import sys
from ankleloop_lab.command_line.main import main
main(["--help"])
print([name for name in ("matplotlib", "numba", "pandas", "scipy", "xarray") if name in sys.modules])
"""


def test_the_reference_in_the_repository_is_current():
    current = REFERENCE.read_text(encoding="utf-8")
    assert current == reference_text(), "run: python -m ankleloop_lab.command_line.reference"


def test_help_imports_nothing_that_takes_time():
    process = subprocess.run(
        [sys.executable, "-c", MODULES], capture_output=True, text=True, check=True
    )
    assert process.stdout.splitlines()[-1] == "[]"


def test_the_help_of_check_names_every_suffix():
    assert set(CONTAINERS) <= set(re.split(r"[ ,()]+", check.help))


def test_the_help_of_identify_names_every_method_that_is_offered():
    """It is written there, because the list of methods takes time to import."""
    offered = {name for name, method in ankleloop.METHODS.items() if method.offer}
    assert offered <= set(re.split(r"[ ,(]+", CHOICE))


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

    monkeypatch.setattr("ankleloop_lab.command_line.demo.demo.callback", fail)
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

    monkeypatch.setattr("ankleloop_lab.command_line.demo.demo.callback", warn)
    assert run("demo").err == "warning: a.csv: the file ends within line 3.\n"


@pytest.mark.parametrize(
    ("remedy", "options"),
    [
        ({"sampling_rate": None}, "--sampling-rate HZ"),
        ({"variables": None}, "--variables NAME=VARIABLE"),
        ({"position_unit": "deg"}, "--position-unit deg"),
        ({"start": None, "stop": None}, "--start S --stop S"),
        ({"overwrite": True}, "--overwrite"),
        ({}, ""),
    ],
)
def test_a_remedy_is_a_command_that_is_ready_to_copy(capsys, remedy, options):
    show_correction(remedy, ["check", "a b.csv"])
    assert capsys.readouterr().err == (
        f'next: ankleloop check "a b.csv" {options}\n' if options else ""
    )


VALUES = {
    "torque_sign": ("1", "-1"),
    "position_sign": ("1", "-1"),
    "position_unit": ("rad", "deg"),
    "sampling_rate": ("500.0", "1000.0"),
    "drift": ("0", "1"),
    "subject": ("S1", "drift"),
}
SETTINGS = st.sampled_from([(name, value) for name, values in VALUES.items() for value in values])
SPELLINGS = st.sampled_from(["{} {}", "{}={}"])


@given(
    given_options=st.lists(st.tuples(SETTINGS, SPELLINGS)),
    remedy=st.lists(SETTINGS, min_size=1).map(dict),
    place=st.integers(0, 10),
    ends_options=st.booleans(),
)
def test_the_command_line_reads_a_corrected_command(given_options, remedy, place, ends_options):
    """Whatever the user gave, and however, the remedy is what counts, and all else stays."""
    texts = [spelling.format(name_option(name), value) for (name, value), spelling in given_options]
    texts.insert(
        len(texts) if ends_options else place, f"-- {__file__}" if ends_options else __file__
    )
    words = " ".join(texts).split(" ")
    corrected = correct(words, remedy)
    options = [word.partition("=")[0] for word in corrected]
    assert all(options.count(name_option(name)) == 1 for name in remedy)
    before, after = (check.make_context("check", list(part)).params for part in (words, corrected))
    assert {name: str(after[name]) for name in remedy} == remedy
    assert {name: after[name] for name in after.keys() - remedy} == {
        name: before[name] for name in before.keys() - remedy
    }


@pytest.mark.parametrize("kind", [ankleloop.DataError, ResourceError])
def test_a_remedy_reaches_another_process(kind):
    error = pickle.loads(pickle.dumps(kind("a.csv: the torque has the other sign.", {"drift": 1})))
    assert (str(error), error.remedy) == ("a.csv: the torque has the other sign.", {"drift": 1})


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
