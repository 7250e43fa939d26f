"""Tables that list the recordings of a study."""

from functools import partial
from pathlib import Path

from ankleloop.studies.checking import ConfigError
from ankleloop.studies.recording_settings import Recording, read_recordings
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import missing, text_file


def read_table(path: Path, **defaults) -> dict[str, list[Recording]]:
    """Read a table of recordings, as the workflow does."""
    return read_recordings(str(path), defaults)


row = partial(rows_of(read_table), error=ConfigError)


def table(*lines: str, header: str = "file,subject,torque_sign"):
    """A table of these lines."""
    return text_file("table.csv", "\n".join([header, *lines]) + "\n")


ROWS: list[BadInput] = [
    row("there is no table", missing("table.csv"), "table.csv: the file cannot be read"),
    row(
        "semicolons between the cells",
        table("a.mat;S1;1", header="file;subject;torque_sign"),
        "table.csv, line 1: columns have names of their own, with commas between them (no semicolons",
    ),
    row(
        "unknown column",
        table("a.mat,1", header="file,torqe_sign"),
        "table.csv",
        "unknown key 'torqe_sign'",
        "did you mean 'torque_sign'",
    ),
    row(
        "more cells than columns",
        table("a.mat,S1,1,7"),
        "table.csv, line 2: the row does not fit the 3 columns",
        "quotes",
    ),
    row(
        "a number with a decimal comma",
        table('a.mat,"3,5"', header="file,start"),
        "table.csv, line 2 → start: must be a finite number",
        "'3,5'",
    ),
    row("a name twice", table("a.mat,S1", "b.mat,S1", header="file,name"), "table.csv, line 3: the name 'S1' is taken"),
]
