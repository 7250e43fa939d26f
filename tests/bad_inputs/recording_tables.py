"""Tables that list the recordings of a study."""

from functools import partial
from pathlib import Path

from ankleloop.studies.checking import ConfigError
from ankleloop.studies.config import Recording
from ankleloop.studies.recording_tables import read_recordings
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import missing, nothing, text_file

TITLE = "Tables of recordings"


def read_table(path: Path, **defaults) -> dict[str, list[Recording]]:
    """Read a table of recordings, as the workflow does."""
    return read_recordings(str(path), defaults)


row = partial(rows_of(read_table), error=ConfigError, shown="snakemake")


def table(*lines: str, header: str = "file,subject,torque_sign"):
    """A table of these lines."""
    return text_file("table.csv", "\n".join([header, *lines]) + "\n")


MARKED = b"\xef\xbb\xbf\r\nfile,subject\r\n\r\na.mat,S1\r\n , \r\nb.mat,S2\r\n,\r\n"


def _has_two_recordings(recordings: dict[str, list[Recording]]) -> None:
    assert {name: part.file for name, (part,) in recordings.items()} == {"S1": "a.mat", "S2": "b.mat"}


def _keeps_the_texts(recordings: dict[str, list[Recording]]) -> None:
    assert {name: part.subject for name, (part,) in recordings.items()} == {"012": "012", "12": "12", "1_2": "1_2"}


ROWS: list[BadInput] = [
    row("there is no table", missing("table.csv"), "there is no table", "table.csv"),
    row("a folder in place of a table", nothing, "the file cannot be read (Is a directory)", "check the path"),
    row("the table is empty", text_file("table.csv", ""), "table.csv", "has no rows"),
    row("a header and no rows", table(), "table.csv has no rows"),
    row("UTF-16", text_file("table.csv", "file\na.mat\n".encode("utf-16")), "table.csv is text in UTF-16"),
    row(
        "semicolons between the cells",
        table("a.mat;S1;1", header="file;subject;torque_sign"),
        "table.csv, line 1: the columns are separated by semicolons",
        "commas",
    ),
    row(
        "no column of files",
        table("S1,1", header="subject,torque_sign"),
        "table.csv, line 2: the key 'file' is missing",
    ),
    row(
        "unknown column",
        table("a.mat,1", header="file,torqe_sign"),
        "table.csv",
        "unknown key 'torqe_sign'",
        "did you mean 'torque_sign'",
    ),
    row(
        "two columns of one name",
        table("a.mat,b.mat", header="file,file"),
        "table.csv, line 1: 2 columns are called 'file'",
    ),
    row("more cells than columns", table("a.mat,S1,1,7"), "table.csv, line 2: '7' is in no named column", "quotes"),
    row("a row without a file", table("a.mat,S1,1", ",S2,1"), "table.csv, line 3: the key 'file' is missing"),
    row("a sign that is a word", table("a.mat,S1,minus"), "table.csv, line 2 → torque_sign", "'minus'"),
    row(
        "a number with a decimal comma",
        table('a.mat,"3,5"', header="file,start"),
        "table.csv, line 2 → start [s]",
        "'3,5'",
    ),
    row(
        "a number with an underscore", table("a.mat,1_0", header="file,start"), "table.csv, line 2 → start [s]", "'1_0'"
    ),
    row("nan as a number", table("a.mat,nan", header="file,start"), "table.csv, line 2 → start [s]", "'nan'"),
    row("a degree of drift of 2.5", table("a.mat,2.5", header="file,drift"), "table.csv, line 2 → drift", "2.5"),
    row("a name twice", table("a.mat,S1", "b.mat,S1", header="file,name"), "table.csv, line 3: the name 'S1' is taken"),
    row(
        "names that differ in case alone",
        table("a.mat,s1", "b.mat,S1", header="file,name"),
        "table.csv",
        "'s1' and 'S1' differ in capitals only",
    ),
    row("a name that is a path", table("a.mat,../S1", header="file,name"), "table.csv, line 2: the name '../S1'"),
    row(
        "one part of a file twice in a batch",
        table("a.mat,x", "a.mat,x", header="file,batch"),
        "table.csv, line 3: the same part of a.mat is in the batch 'x' already",
    ),
    row(
        "a part that ends before it starts",
        table("a.mat,9,3", header="file,start,stop"),
        "table.csv, line 2",
        "stop",
        "start",
    ),
    row("a quote that is not closed", table('"a.mat,S1,1'), "table.csv, line 2: this is not CSV"),
    row("tabulators between the cells", table("a.mat\tS1", header="file\tsubject"), "separated by tabulators"),
    row("a row that is cut off", table("a.mat,S1,1", "b.ma"), "table.csv, line 3: the row has 1 cells of 3", "cut off"),
    row(
        "a name with a space",
        table("a.mat,S 1", header="file,name"),
        "line 2: the name 'S 1' must consist of",
        "column name",
    ),
    row(
        "a name of 300 letters",
        table(f"a.mat,{'a' * 300}", header="file,name"),
        "line 2: the name",
        "at most 100 letters",
    ),
    row(
        "a name of the page of another",
        table("a.mat,S1", "b.mat,S1.html", header="file,name"),
        "S1.html is the page of the",
    ),
    row(
        "a file name with spaces and no name",
        table("my file.mat,,", header="file,name,subject"),
        "the name 'my file.mat'",
    ),
    row("Latin-1", text_file("table.csv", "file\nä.mat\n".encode("latin-1")), "table.csv, line 2: this is not UTF-8"),
    row("bytes of a spreadsheet", text_file("table.csv", b"PK\x03\x04\x14\x00\x06\x00" + bytes(80)), "no text at all"),
    row("hexadecimal", table("a.mat,0x10", header="file,start"), "table.csv, line 2 → start [s]", "'0x10'"),
    row("infinity as a number", table("a.mat,inf", header="file,stop"), "table.csv, line 2 → stop [s]", "'inf'"),
    row("a byte order mark, CRLF and empty rows", text_file("table.csv", MARKED), right=_has_two_recordings),
    row("texts that look like numbers", table("a.mat,012,1", "b.mat,12,1", "c.mat,1_2,1"), right=_keeps_the_texts),
    row("a default that is unknown", table("a.mat,S1,1"), "unknown key 'torqe'", call=partial(read_table, torqe="t")),
]
