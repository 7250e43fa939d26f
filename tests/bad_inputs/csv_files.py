"""Tables of text."""

import os
from functools import partial
from pathlib import Path

import numpy as np

from ankleloop import DataError, read_trial
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import (
    POSITION,
    RATE,
    SIGNALS,
    TIME,
    TORQUE,
    changed,
    csv_file,
    csv_text,
    cut_off,
    folder_named,
    missing,
    text_file,
)

row = rows_of(read_trial)
TITLE = "Tables of text: CSV and CSV.gz"

read_as_command = partial(read_trial, reference="command")
read_at_1_khz = partial(read_trial, sampling_rate=1000.0)


def _loop_of_links(folder: Path) -> Path:
    (folder / "a.csv").symlink_to(folder / "b.csv")
    (folder / "b.csv").symlink_to(folder / "a.csv")
    return folder / "a.csv"


def _pipe(folder: Path) -> Path:
    os.mkfifo(folder / "a.csv")
    return folder / "a.csv"


def _headed(header: str) -> str:
    """Text of the table under another header."""
    return csv_text().replace("time,position,torque", header, 1)


def _replaced_line(line: int, text: str) -> str:
    lines = csv_text().splitlines()
    lines[line - 1] = text
    return "\n".join(lines) + "\n"


def _same_signals(trial) -> None:
    np.testing.assert_array_equal(trial["position"], POSITION)
    np.testing.assert_array_equal(trial["torque"], TORQUE)
    assert trial.attrs["sampling_rate"] == RATE


def _rows_of_files() -> list[BadInput]:
    whole = "check that the file is whole"
    return [
        row("there is no file", missing("a.csv"), "a.csv", "there is no such file", "check the path"),
        row("the path is a folder", folder_named("a.csv"), "a.csv", "folder", "check the path"),
        row(
            "links that point at each other",
            _loop_of_links,
            "a.csv: the file cannot be opened",
            "check the path and the permission",
        ),
        row("a pipe that nobody writes to", _pipe, "a.csv: this is a device, no file", "check the path"),
        row("unknown suffix", text_file("a.txt", "1"), "a.txt: unknown kind of file", "convert it", ".mat"),
        row("no suffix", text_file("a", "1"), "a: unknown kind of file", "convert it"),
        row("the file is empty", text_file("a.csv", ""), "a.csv", whole),
        row(
            "a header and no rows",
            text_file("a.csv", "time,position,torque\n"),
            "a.csv: position is empty",
            "record it",
        ),
        row(
            "a single row",
            text_file("a.csv", "position,torque\n0,0\n"),
            "a.csv",
            "1 sample",
            "at least 2",
            call=read_at_1_khz,
        ),
        row(
            "UTF-16",
            text_file("a.csv", csv_text().encode("utf-16")),
            "a.csv: the text is UTF-16",
            "save it as CSV in UTF-8",
        ),
        row(
            "NUL bytes after the rows",
            text_file("a.csv", csv_text() + "\0" * 4096),
            "a.csv: byte 0 in a table of text",
            "save it as UTF-8",
        ),
        row(
            "a MATLAB file named .csv",
            text_file("a.csv", b"MATLAB 5.0 MAT-file" + bytes(500)),
            "a.csv: byte 0 in a table of text",
            "it is no text",
        ),
        row("the compressed file is cut off", cut_off(csv_file("a.csv.gz")), "a.csv.gz", whole),
        row(
            "a .gz that is not compressed",
            lambda folder: csv_file("b.csv")(folder).rename(folder / "a.csv.gz"),
            "a.csv.gz",
            whole,
        ),
        row(
            "the last line is cut off",
            cut_off(csv_file(), 0.5),
            "a.csv: the last line (152)",
            "the file is cut off",
            "copy it again",
        ),
        row(
            "a byte order mark and CRLF",
            text_file("a.csv", b"\xef\xbb\xbf" + csv_text().replace("\n", "\r\n").encode()),
            right=_same_signals,
        ),
    ]


def _rows_of_columns() -> list[BadInput]:
    comma = csv_text({name: [f"{value:.4f}".replace(".", ",") for value in signal] for name, signal in SIGNALS.items()})
    semicolons = csv_text().replace(",", ";")
    return [
        row(
            "decimal commas",
            text_file("a.csv", comma),
            "a.csv: line 2 has 6 cells and the header 3",
            "write decimal points, not commas",
        ),
        row(
            "semicolons between the cells",
            text_file("a.csv", semicolons),
            "a.csv: there is no variable 'position'",
            "Name one of these",
        ),
        row(
            "two columns of one name",
            text_file("a.csv", _headed("time,position,position")),
            "a.csv: 2 columns are called 'position'",
            "columns 2, 3",
            call=partial(read_trial, torque="time"),
        ),
        row(
            "names equal but for spaces",
            text_file("a.csv", _headed("position, position ,torque")),
            "a.csv: 2 columns are called 'position'",
            "give each a name of its own",
            call=read_at_1_khz,
        ),
        row(
            "no such column",
            csv_file(),
            "a.csv: there is no variable 'angle'",
            "time, position, torque",
            "Name one of these",
            call=partial(read_trial, position="angle"),
        ),
        row("no header", text_file("a.csv", csv_text().partition("\n")[2]), "a.csv: there is no variable 'position'"),
        row(
            "text in a cell",
            text_file("a.csv", _replaced_line(12, "0.02,n/v,1")),
            "a.csv: position",
            "line 12",
            "'n/v'",
            "correct the file",
        ),
        row(
            "an empty cell",
            text_file("a.csv", _replaced_line(12, "0.02,,1")),
            "a.csv: position is not finite at sample 10 (0.02 s)",
            "cut the trial there or repair",
        ),
        row(
            "inf in a cell",
            csv_file(torque=changed(TORQUE, 7, np.inf)),
            "a.csv: torque is not finite at sample 7",
            "cut the trial",
        ),
        row(
            "hexadecimal numbers",
            csv_file(torque=[hex(k) for k in range(300)]),
            "a.csv: torque is not a number in line 2",
            "'0x0'",
        ),
        row(
            "numbers with units",
            csv_file(torque=[f"{k} Nm" for k in range(300)]),
            "a.csv: torque is not a number in line 2",
            "'0 Nm'",
        ),
        row(
            "true and false as a channel",
            csv_file(torque=["true", "false"] * 150),
            "a.csv: torque is of type bool",
            "convert it",
        ),
        row("complex numbers", csv_file(torque=["1+2j"] * 300), "a.csv: torque is not a number in line 2"),
        row(
            "more cells than names",
            text_file("a.csv", _replaced_line(12, "0.02,0,1,5")),
            "a.csv: line 12 has 4 cells and the header 3",
            "correct the line",
        ),
        row(
            "a quote that is not closed",
            text_file("a.csv", _replaced_line(12, '0.02,"0,1')),
            "a.csv: line 12 has 2 cells",
            "torque is missing there",
            "correct the line",
        ),
    ]


def _rows_of_times() -> list[BadInput]:
    gap = np.where(np.arange(300) >= 100, TIME + 0.1, TIME)
    remedy = "cut the trial there or resample it"
    return [
        row(
            "no rate and no times",
            text_file("a.csv", csv_text({"position": POSITION, "torque": TORQUE})),
            "a.csv: there is no sampling rate",
            "pass sampling_rate in Hz",
        ),
        row("a gap in time", csv_file(time=gap), "a.csv: time is irregular at sample 100 (0.3 s)", remedy),
        row(
            "a sample twice",
            csv_file(time=changed(TIME, 50, TIME[49])),
            "a.csv: time is irregular at sample 50",
            remedy,
        ),
        row("times that run backwards", csv_file(time=TIME[::-1]), "a.csv: time is irregular at sample 1", remedy),
        row(
            "a time that is missing",
            csv_file(time=changed(TIME, 50, np.nan)),
            "a.csv: time is not finite at sample 50",
            "repair it",
        ),
        row(
            "times as text", csv_file(time=[f"12:00:{t:06.3f}" for t in TIME]), "a.csv: time is not a number in line 2"
        ),
        row(
            "times rounded to whole steps of 10 ms",
            csv_file(time=np.round(TIME, 2)),
            "a.csv: time is irregular",
            "write them with more digits",
        ),
        row(
            "a rate that the times contradict",
            csv_file(),
            "a.csv: the sampling rate is stated as 1000 Hz, but time runs at 500 Hz",
            "correct the one that is wrong",
            call=read_at_1_khz,
        ),
        row(
            "the torque by the name of the time",
            csv_file(),
            "a.csv: there is no sampling rate",
            "no time column",
            "pass sampling_rate in Hz",
            call=partial(read_trial, torque="time"),
        ),
        row(
            "one column as position and torque",
            csv_file(),
            "a.csv: position and torque are the same variable, 'position'",
            "name another one",
            call=partial(read_trial, torque="position"),
        ),
    ]


def _rows_of_signals() -> list[BadInput]:
    spike = changed(POSITION, 60, 3.0)
    return [
        row(
            "position in degrees",
            csv_file(position=np.rad2deg(0.2 * np.sin(40 * TIME))),
            "a.csv: position moves at",
            "pass position_unit='deg'",
        ),
        row(
            "a spike in the position",
            csv_file(position=spike),
            "a.csv: position moves at",
            "at sample",
            "look for a spike there",
        ),
        row(
            "a constant torque",
            csv_file(torque=np.ones(300)),
            "a.csv: torque is constant (1 at all 300 samples)",
            "check the channel",
        ),
        row(
            "a constant command",
            csv_file(command=np.zeros(300)),
            "a.csv: reference is constant",
            "leave it out",
            call=read_as_command,
        ),
        row(
            "1e160 N·m", csv_file(torque=1e160 * TORQUE), "a.csv: torque reaches 3e+160", "check its unit and its scale"
        ),
        row(
            "a torque of 1e-160 N·m",
            csv_file(torque=1e-160 * TORQUE),
            "a.csv: torque varies by 6e-160",
            "check its unit and its scale",
        ),
    ]


def _rows_of_options() -> list[BadInput]:
    def wrong(text, *says, error=DataError, **options):
        return row(text, csv_file(), *says, call=partial(read_trial, **options), error=error)

    return [
        wrong("a sign of 0", "a.csv: position_sign must be one of 1 or -1; got 0", position_sign=0),
        wrong("a sign that is true", "a.csv: torque_sign must be one of 1 or -1; got True", torque_sign=True),
        wrong("a sign as text", "a.csv: torque_sign must be one of 1 or -1; got '-'", torque_sign="-"),
        wrong(
            "a unit of the position in gon",
            "a.csv: position_unit must be one of 'rad' or 'deg'; got 'gon'",
            position_unit="gon",
        ),
        wrong("no name of the position", "a.csv: position must be text, got None", position=None),
        wrong("a name that is a number", "a.csv: position must be text, got 3", position=3),
        wrong(
            "the torque as reference", "a.csv: torque and reference are the same variable, 'torque'", reference="torque"
        ),
        wrong("a rate as text", "a.csv: sampling_rate is 'fast'", "pass a single number in Hz", sampling_rate="fast"),
        wrong("an unknown option", "torqe", torqe="torque", error=TypeError),
        row("a path that is a number", lambda folder: 3, "path must be text or a pathlib.Path, got 3", error=TypeError),
        row("no path", lambda folder: None, "path must be text or a pathlib.Path, got None", error=TypeError),
        row(
            "an address of the web",
            lambda folder: "https://example.org/a.csv",
            "a.csv: there is no such file",
            "check the path",
        ),
    ]


ROWS = [*_rows_of_files(), *_rows_of_columns(), *_rows_of_times(), *_rows_of_signals(), *_rows_of_options()]
