"""Commands, with their exit status: those of ankleloop, and a plan of the workflow."""

import os
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from functools import partial
from io import StringIO
from pathlib import Path

from ankleloop.command_line.main import main
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import POSITION, TIME, TORQUE, csv_file, csv_text, cut_off, mat_file, missing, text_file

ROOT = Path(__file__).parents[2]


def plan(config: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess:
    """Plan the workflow with a configuration beside that of the repository: snakemake --dry-run."""
    program = str(Path(sys.executable).with_name("snakemake"))
    snakefile = ["--snakefile", str(ROOT / "workflow" / "Snakefile"), "--configfile", str(config)]
    command = [program, "--dry-run", "--cores", "1", *snakefile, *arguments]
    inherited = {name: value for name, value in os.environ.items() if name != "ANKLELOOP_RECORDINGS"}
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    variables = inherited | {"PATH": path, "PYTHONPATH": str(ROOT / "src"), **environment}
    return subprocess.run(command, cwd=config.parent, env=variables, capture_output=True, text=True, check=False)


def verb(*arguments: str) -> partial:
    """Run a command of ankleloop in this process; FILE among its arguments is the input."""
    return partial(_run_verb, arguments)


def _run_verb(arguments: tuple[str, ...], path: Path) -> subprocess.CompletedProcess:
    command = [argument.replace("FILE", str(path)) for argument in arguments]
    output, errors = StringIO(), StringIO()
    with redirect_stdout(output), redirect_stderr(errors):
        status = main(command)
    text = " ".join(errors.getvalue().split())  # click breaks lines
    return subprocess.CompletedProcess(command, status, output.getvalue(), text)


def _identified(folder: Path) -> Path:
    """A recording beside results that somebody has made of it."""
    (folder / "a.csv-results").mkdir()
    (folder / "a.csv-results" / "a.html").write_text("the page of yesterday")
    return csv_file()(folder)


def _recordings(folder: Path) -> Path:
    """A study of a recording that is not there."""
    study = "{kind: recordings, folder: '${LABORATORY}', files: {S1: {file: a.mat}}, methods: {a: {method: riv}}}"
    return text_file("config.yaml", f"run: [r]\nstudies: {{r: {study}}}\n")(folder)


DATA, USAGE = 1, 2
row = partial(rows_of(plan), error=None, status=DATA)

ROWS: list[BadInput] = [row("a folder of recordings in a variable that is not set", _recordings, "LABORATORY")]
ROWS += [
    rows_of(verb(*arguments))(wrong, make, *says, error=None, status=status)
    for wrong, make, arguments, status, says in (
        (
            "two variables that may be the position",
            csv_file(ankle_angle=POSITION),
            ("check", "FILE"),
            USAGE,
            ("a.csv: 2 variables may be the position: position, ankle_angle.", "--position NAME"),
        ),
        (
            "a variable that is not in the file",
            csv_file(),
            ("check", "FILE", "--torque", "moment"),
            DATA,
            ("a.csv: there is no variable 'moment'; the file has: time, position, torque.",),
        ),
        (
            "a position in degrees that is said to be in rad",
            text_file("a.csv", csv_text({"time": TIME, "angle_deg": POSITION, "torque": TORQUE})),
            ("check", "FILE", "--position-unit", "rad"),
            DATA,
            ("angle_deg is in 'deg' according to the file", "next: ankleloop check", "--position-unit deg"),
        ),
        (
            "half a file",
            cut_off(mat_file()),
            ("check", "FILE"),
            DATA,
            ("error: a.mat:", "file is whole"),
        ),
        (
            "results that exist",
            _identified,
            ("identify", "FILE"),
            USAGE,
            ("a.html: the file exists already", "next: ankleloop identify", "--overwrite"),
        ),
        (
            "a sweep over a setting that does not exist",
            missing("a.yaml"),
            ("study", "FILE", "--sweep", "reflexgain"),
            USAGE,
            ("--sweep: there is no setting 'reflexgain'", "reflex_gain"),
        ),
    )
]
