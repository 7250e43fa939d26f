"""Tables of text."""

import re
from functools import partial

import numpy as np

from ankleloop import read_trial
from bad_inputs.bad_input import rows_of
from bad_inputs.inputs import (
    POSITION,
    SIGNALS,
    TIME,
    TORQUE,
    changed,
    csv_file,
    csv_text,
    cut_off,
    text_file,
)

COMMAS = {
    name: [f"{value:.4f}".replace(".", ",") for value in signal] for name, signal in SIGNALS.items()
}
NO_TIMES = {"position": POSITION, "torque": TORQUE}
GAP = "cut the trial there"


def table(text: str):
    """A table of this text."""
    return text_file("a.csv", text)


def headed(header: str):
    """The table under another header."""
    return table(csv_text().replace("time,position,torque", header, 1))


def with_line(text: str):
    """The table with another line 12."""
    lines = csv_text().splitlines(keepends=True)
    return table("".join([*lines[:11], text + "\n", *lines[12:]]))


row = rows_of(read_trial)
torque_at = partial(read_trial, torque="time")
angle = partial(read_trial, position="angle")
read_at_1_khz = partial(read_trial, sampling_rate=1000.0)

ROWS = [
    row(
        "unknown suffix",
        text_file("a.xlsx", "1"),
        "a.xlsx: unknown kind of file",
        "convert it",
        ".mat",
    ),
    row("the file is empty", table(""), "a.csv", "check that the file is whole"),
    row(
        "the compressed file is cut off",
        cut_off(csv_file("a.csv.gz")),
        "a.csv.gz",
        "check that the file is whole",
    ),
    row(
        "the last line is cut off",
        cut_off(csv_file()),
        "the last line has fewer cells or digits than those before: the file is cut off",
        "copy it again",
    ),
    row(
        "decimal commas",
        table(csv_text(COMMAS)),
        "a.csv: there are more cells than names in line 2",
        "decimal points",
    ),
    row(
        "a column twice",
        headed("time,position,position"),
        "2 variables are called 'position'",
        call=torque_at,
    ),
    row(
        "no such column",
        csv_file(),
        "no variable 'angle'",
        "time, position, torque",
        "Name one of these",
        call=angle,
    ),
    row(
        "text in a cell",
        with_line("0.02,n/v,1"),
        "a.csv: position",
        "line 12",
        "'n/v'",
        "correct the file",
    ),
    row(
        "an empty cell",
        with_line("0.02,,1"),
        "a.csv: position is not finite at sample 10 (0.02 s)",
        "cut the trial",
    ),
    row(
        "no rate and no times",
        table(csv_text(NO_TIMES)),
        "there is no sampling rate",
        "pass sampling_rate in Hz",
        remedy={"sampling_rate": None},
    ),
    row(
        "a gap in time",
        csv_file(time=TIME + 0.1 * (TIME[99] < TIME)),
        "irregular at sample 100 (0.3 s)",
        GAP,
    ),
    row(
        "a sample twice",
        csv_file(time=TIME - 0.002 * (TIME > 0.099)),
        "a.csv: time is irregular at sample 50",
        GAP,
    ),
    row(
        "a wrong rate",
        csv_file(),
        "stated as 1000 Hz, but time runs at 500 Hz",
        call=read_at_1_khz,
        remedy={"sampling_rate": None},
    ),
    row(
        "degrees",
        csv_file(position=570 * POSITION),
        "a.csv: position moves at",
        "pass position_unit='deg'",
        remedy={"position_unit": "deg"},
    ),
    row(
        "a spike in the position",
        csv_file(position=changed(POSITION, 60, 3.0)),
        "a.csv: position moves",
        "a spike",
        remedy={"position_unit": "deg"},
    ),
    row(
        "a constant torque",
        csv_file(torque=np.ones(300)),
        "torque is constant (1 at all 300",
        "check the channel",
    ),
    row(
        "no names",
        table(csv_text().partition("\n")[2]),
        "no names above numbers with commas between them",
        "time_s, angle_rad, torque_nm",
    ),
    row(
        "no names below a title, semicolons",
        table("Devices\n" + csv_text().partition("\n")[2].replace(",", ";")),
        "in line 2; the names are taken to be in line 1, with semicolons between the cells",
    ),
    row(
        "a row of units in place of names",
        table("s,rad,Nm\n" + csv_text().partition("\n")[2]),
        "s, rad, Nm",
        remedy={"position": None},
    ),
    row(
        "fewer names than cells, below rows of a spreadsheet",
        table("Subject,7,\nRate,500,\n" + csv_text().replace(",torque", "", 1)),
        "in line 4; the names are taken to be in line 3, with commas between the cells",
    ),
    row("1_0 in a cell", with_line("0.02,1_0,1"), "position is not a number in line 12 but '1_0'"),
    row(
        "decimal commas in quotes",
        table(
            re.sub(r"[^,\n]*\.[^,\n]*", lambda cell: f'"{cell[0].replace(".", ",")}"', csv_text())
        ),
        "position is not a number in line 2 but '0,0'",
    ),
]
