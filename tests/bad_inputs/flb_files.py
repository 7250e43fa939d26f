"""FLB files."""

from functools import partial

import numpy as np

from ankleloop import read_trial
from bad_inputs.bad_input import rows_of
from bad_inputs.inputs import text_file

RATE = 1000.0
TIME = np.arange(400) / RATE
POSITION, TORQUE = 0.02 * np.sin(20 * TIME), 3.0 * np.cos(20 * TIME)
LOW, HIGH = np.array([-0.1, -8.0]), np.array([0.1, 8.0])
TYPES = {4: "<f4", 2: "<i2", -2: "<u2"}


def integers(*values):
    return np.array(values, "<i4").tobytes()


def text(value):
    return integers(len(value)) + value.encode("latin-1")


def flb_case(version=4, kind=4, names=("POS", "TQ"), comment="", scale=1.0, realizations=1):
    """Bytes of a case, written from the description of the format."""
    samples = np.stack([POSITION, TORQUE] * realizations) * scale
    if kind == -2:
        low, high = (np.tile(ends, realizations)[:, None] for ends in (LOW, HIGH))
        samples = np.round((samples - low) / (high - low) * 65535)
    elif kind == 2:
        samples = np.round(1000 * samples)
    content = integers(version) + (b"" if version == 2 else integers(2, realizations))
    content += (
        integers(2, TIME.size, kind)
        + text("Time")
        + np.array([1 / RATE, 0.0], "<f4").tobytes()
        + text(comment)
    )
    content += b"".join(map(text, names)) + LOW.tobytes() + HIGH.tobytes()
    return content + samples.astype(TYPES[kind]).tobytes()


WHOLE = flb_case()
CASES = "a.flb: there are 2 cases: choose one by the option case: case 1, ''; case 2, ''."

row = rows_of(read_trial)
read_case_3 = partial(read_trial, case=3)

ROWS = [
    row(
        "several cases, and none is named",
        text_file("a.flb", 2 * WHOLE),
        CASES,
        remedy={"case": None},
    ),
    row(
        "no such case",
        text_file("a.flb", 2 * WHOLE),
        CASES,
        call=read_case_3,
        remedy={"case": None},
    ),
    row(
        "the samples are cut off",
        text_file("a.flb", WHOLE[:-1]),
        "a.flb",
        "(a case is cut off)",
        "file is whole",
    ),
    row(
        "another kind of file",
        text_file("a.flb", flb_case(version=1)),
        "a.flb",
        "version 1",
        "its suffix right",
    ),
]
