"""Commands of ankleloop, with their exit status."""

from contextlib import redirect_stderr, redirect_stdout
from functools import partial
from io import StringIO
from pathlib import Path

import numpy as np

from ankleloop_lab.command_line.main import main
from bad_inputs.bad_input import BadInput
from bad_inputs.inputs import (
    POSITION,
    SIGNALS,
    TORQUE,
    csv_file,
    csv_text,
    cut_off,
    mat_file,
    text_file,
)

DATA, USAGE = 1, 2
TWO = np.stack([POSITION, TORQUE])
DEGREES = {"time": SIGNALS["time"], "angle_deg": POSITION, "torque": TORQUE}


def run(arguments: str, path: Path) -> tuple[int, str]:
    """Run a command of ankleloop in this process, with a file as the first argument of its verb."""
    verb, *options = arguments.split()
    with redirect_stdout(StringIO()) as output, redirect_stderr(output):
        status = main([verb, str(path), *options])
    return status, " ".join(output.getvalue().split())  # click breaks lines


def row(wrong: str, make, arguments: str, status: int, *says: str) -> BadInput:
    """A row of a command with its exit status."""
    return BadInput(wrong, make, partial(run, arguments), says, error=None, status=status)


def in_braces(folder: Path) -> Path:
    """A new configuration, in a folder that has a file with braces in its name."""
    text_file("a{1}.csv", csv_text(DEGREES))(folder)
    return folder / "new.yaml"


def claimed(folder: Path) -> Path:
    """A recording whose results another command is writing."""
    (folder / "a.csv-results" / ".ankleloop").mkdir(parents=True)
    return csv_file()(folder)


def identified(folder: Path) -> Path:
    """A recording beside results that somebody has made of it."""
    (folder / "a.csv-results").mkdir()
    (folder / "a.csv-results" / "a.html").write_text("the page of yesterday")
    return csv_file()(folder)


ROWS = [
    row(
        "two positions",
        csv_file(ankle_angle=POSITION),
        "check",
        USAGE,
        "2 variables may be the",
        "--position NAME",
    ),
    row(
        "no such variable",
        csv_file(),
        "check --torque moment",
        DATA,
        "'moment'; the file has: time, position",
    ),
    row(
        "degrees that are said to be radians",
        text_file("a.csv", csv_text(DEGREES)),
        "check --position-unit rad",
        DATA,
        "angle_deg is in 'deg' according to the file",
        "next: ankleloop check",
        "--position-unit deg",
    ),
    row(
        "trials in rows",
        mat_file(position=TWO, torque=TWO[::-1]),
        "check",
        DATA,
        "position (2, 300) is no single channel",
        "next: ankleloop check",
        '--position "position[0, :]" --torque "torque[0, :]"',
    ),
    row(
        "channels in columns",
        mat_file(data=TWO.T, position=1.0, torque=1.0),
        "check",
        USAGE,
        "the file has: data (300, 2).",
        "a part of one, as 'data[:, 0]'",
        "--position NAME",
    ),
    row("half a file", cut_off(mat_file()), "check", DATA, "error: a.mat:", "file is whole"),
    row(
        "results that exist",
        identified,
        "identify",
        USAGE,
        "the file exists already",
        "next: ankleloop identify",
        "--overwrite",
    ),
    row("a case of a table", csv_file(), "check --case 1", DATA, "case chooses a trial of an .flb"),
    row(
        "a stop behind the end",
        csv_file(),
        "check --stop 0.7",
        DATA,
        "a.csv: stop is 0.7 s, and the record ends at 0.6 s",
        "--stop S",
    ),
    row(
        "a torque in ft·lb that is read as N·m",
        text_file(
            "a.csv", csv_text({**DEGREES, "torque_ftlb": TORQUE}).replace(",torque,", ",emg,")
        ),
        "check --torque-unit Nm",
        DATA,
        "next: ankleloop check",
        '--torque-unit "ft·lbf"',
    ),
    row(
        "an unknown unit",
        csv_file(),
        "check --torque-unit xyz",
        USAGE,
        "torque_unit must be a unit",
    ),
    row(
        "braces in a name",
        in_braces,
        "study a{1}.csv",
        USAGE,
        "Snakemake takes the braces of",
        "a{1}.csv for wildcards: rename it",
    ),
    row(
        "results that another command is writing",
        claimed,
        "identify",
        USAGE,
        ".ankleloop: another command is writing its results: wait for it",
    ),
]
