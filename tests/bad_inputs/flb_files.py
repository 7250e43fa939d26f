"""FLB files."""

from functools import partial

import numpy as np

from ankleloop import LongRecord, read_trial
from bad_inputs.bad_input import BadInput, rows_of
from bad_inputs.inputs import text_file

row = rows_of(read_trial)

RATE = 1000.0
TIME = np.arange(400) / RATE
POSITION, TORQUE = 0.02 * np.sin(20 * TIME), 3.0 * np.cos(20 * TIME)
LOW, HIGH = np.array([-0.1, -8.0]), np.array([0.1, 8.0])
TYPES = {4: "<f4", 2: "<i2", -2: "<u2"}


def integers(*values):
    return np.array(values, "<i4").tobytes()


def text(value):
    return integers(len(value)) + value.encode("latin-1")


def flb_case(version=4, kind=4, names=("POS", "TQ"), comment="", scale=1.0, realizations=1, interval=1 / RATE):
    """Bytes of a case, written from the description of the format."""
    samples = np.stack([POSITION, TORQUE] * realizations) * scale
    if kind == -2:
        low, high = (np.tile(ends, realizations)[:, None] for ends in (LOW, HIGH))
        samples = np.round((samples - low) / (high - low) * 65535)
    elif kind == 2:
        samples = np.round(1000 * samples)
    content = integers(version) + (b"" if version == 2 else integers(2, realizations))
    content += integers(2, TIME.size, kind) + text("Time") + np.array([interval, 0.0], "<f4").tobytes() + text(comment)
    content += b"".join(map(text, names)) + LOW.tobytes() + HIGH.tobytes()
    return content + samples.astype(TYPES.get(kind, "u1")).tobytes()


WHOLE = flb_case()

ROWS: list[BadInput] = [
    row(
        "several cases, and none is named",
        text_file("a.flb", 2 * WHOLE),
        "a.flb: there are 2 cases: choose one by the option case. case 1: POS, TQ, 0.4 s at 1000 Hz",
    ),
    row(
        "no such case",
        text_file("a.flb", 2 * WHOLE),
        "a.flb: there is no case 3",
        "the file has 2, counted from 1",
        call=partial(read_trial, case=3),
    ),
    row("the samples are cut off", text_file("a.flb", WHOLE[:-1]), "a.flb", "(case 1 is cut off)", "file is whole"),
    row(
        "the second case is cut off",
        text_file("a.flb", WHOLE + WHOLE[:40]),
        "a.flb",
        "(case 2 is cut off)",
        call=partial(LongRecord, case=1),
    ),
    row(
        "another kind of file",
        text_file("a.flb", flb_case(version=1)),
        "a.flb",
        "(case 1 is of version 1, and there are 2, 3 and 4)",
        "its suffix right",
    ),
    row(
        "samples of bits",
        text_file("a.flb", flb_case(kind=-1)),
        "a.flb",
        "(case 1 has samples of format -1, and 4, 2 and -2 are read: convert it)",
    ),
    row("no sampling interval", text_file("a.flb", flb_case(interval=0.0)), "a.flb", "no sampling interval"),
    row(
        "a text of negative length",
        text_file("a.flb", WHOLE[:24] + integers(-5) + WHOLE[28:]),
        "a.flb",
        "(case 1 is cut off)",
    ),
]
