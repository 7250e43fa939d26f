"""Tables of text."""

from functools import partial

import numpy as np

from ankleloop import read_trial
from bad_inputs.bad_input import BadInput, rows_of
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

row = rows_of(read_trial)

read_at_1_khz = partial(read_trial, sampling_rate=1000.0)


def _headed(header: str) -> str:
    """Text of the table under another header."""
    return csv_text().replace("time,position,torque", header, 1)


def _replaced_line(line: int, text: str) -> str:
    lines = csv_text().splitlines()
    lines[line - 1] = text
    return "\n".join(lines) + "\n"


def _rows_of_files() -> list[BadInput]:
    whole = "check that the file is whole"
    return [
        row("unknown suffix", text_file("a.txt", "1"), "a.txt: unknown kind of file", "convert it", ".mat"),
        row("the file is empty", text_file("a.csv", ""), "a.csv", whole),
        row("the compressed file is cut off", cut_off(csv_file("a.csv.gz")), "a.csv.gz", whole),
        row(
            "the last line is cut off",
            cut_off(csv_file(), 0.5),
            "a.csv: the last line (152)",
            "the file is cut off",
            "copy it again",
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
            "no such column",
            csv_file(),
            "a.csv: there is no variable 'angle'",
            "time, position, torque",
            "Name one of these",
            call=partial(read_trial, position="angle"),
        ),
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
        row(
            "a rate that the times contradict",
            csv_file(),
            "a.csv: the sampling rate is stated as 1000 Hz, but time runs at 500 Hz",
            "correct the one that is wrong",
            call=read_at_1_khz,
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
    ]


ROWS = [*_rows_of_files(), *_rows_of_columns(), *_rows_of_times(), *_rows_of_signals()]
