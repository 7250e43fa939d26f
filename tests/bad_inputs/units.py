"""Units, scales and times of files, as names, attributes and neighbours state them."""

from functools import partial
from pathlib import Path

import h5py
import numpy as np
import scipy.io

from ankleloop import read_trial
from bad_inputs.bad_input import rows_of
from bad_inputs.inputs import (
    POSITION,
    RATE,
    SIGNALS,
    TIME,
    TORQUE,
    changed,
    csv_text,
    mat_file,
    text_file,
)

CUT = "cut the trial there"
CLOCK = [f"10:00:{second:09.6f}" for second in TIME]
RNG = np.random.default_rng(1)
STAMPS = TIME + 0.2 / RATE * RNG.standard_normal(len(TIME))
UNEVEN = np.cumsum(RNG.uniform(0.5, 1.5, len(TIME))) / RATE
LATE = TIME + 0.5 * (TIME > 0.3)


def named(**names: str):
    """A table of the signals under other names."""
    return text_file(
        "a.csv", csv_text({names.get(name, name): signal for name, signal in SIGNALS.items()})
    )


def timed(name: str, times):
    """A table of the signals with other times."""
    columns = {name: times, "position": POSITION, "torque": TORQUE}
    return text_file("a.csv", csv_text(columns))


def hdf5_torque(**attributes):
    """An HDF5 file whose torque has these attributes."""

    def make(folder: Path) -> Path:
        with h5py.File(folder / "a.h5", "w") as file:
            file.update({"position": POSITION, "torque": TORQUE, "fs": RATE})
            file["torque"].attrs.update(attributes)
        return folder / "a.h5"

    return make


def hdf5_ftlb(folder: Path) -> Path:
    """An HDF5 file whose torque has a unit in its name, and none in the attribute that nldat writes."""
    path = hdf5_torque(units="Default Units")(folder)
    with h5py.File(path, "a") as file:
        file.move("torque", "torque_ftlb")
    return path


def struct(**fields):
    """A MATLAB file whose position is a struct with these fields."""
    return lambda folder: _save(folder, {"values": POSITION, **fields})


def _save(folder: Path, position) -> Path:
    scipy.io.savemat(folder / "a.mat", {"Angle": position, "torque": TORQUE, "fs": RATE})
    return folder / "a.mat"


def torque(name: str, *says: str, unit: str | None = None):
    """A row of a torque under a name that says another unit."""
    return row(f"torque: {name}", named(torque=name), *says, remedy={"torque_unit": unit})


def position(name: str, *says: str, unit: str | None = None):
    """A row of a position under a name that says another unit."""
    return row(f"position: {name}", named(position=name), *says, remedy={"position_unit": unit})


def reference(name: str, *says: str):
    """A row of a command under a name that says a unit of no angle."""
    columns = {"angle_deg": POSITION, "torque": TORQUE, name: POSITION, "time_s": TIME}
    made = text_file("a.csv", csv_text(columns))
    return row(f"reference: {name}", made, *says, remedy={"reference_unit": None})


def scale(wrong: str, make, *says: str, option: str = "torque_unit"):
    """A row of a scale of which nobody says what it is for."""
    return row(wrong, make, *says, f"of 1 in the file as {option}", remedy={option: None})


row = rows_of(read_trial)
at_1_khz = partial(read_trial, sampling_rate=1000.0)
in_newton_metres = partial(read_trial, torque_unit="Nm")

ROWS = [
    torque("torque (V)", "is in 'V'", "pass the N·m per volt as torque_unit"),
    torque("torque [N]", "is in 'N'", "pass the lever arm in m as torque_unit"),
    torque("moment_Nm_kg", "pass the mass of the body in kg as torque_unit"),
    torque("moment (Nm/kg)", "is in 'Nm/kg'", "pass the mass of the body"),
    torque("torque (left)", "is in 'left'", "pass the N·m of 1 in the file as torque_unit"),
    torque("torque_V", "is in 'V'", "pass the N·m per volt as torque_unit"),
    torque("torque (N·m/rad)", "is in 'N·m/rad'", "pass the N·m per newton·metre/radian"),
    position(
        "gyro angle (deg/s)", "is in 'deg/s'", "pass the rad per degree/second as position_unit"
    ),
    position("angle [%MVC]", "pass the rad per percent as position_unit"),
    position("angle_mm", "pass the rad per millimetre as position_unit"),
    reference("command_V", "is in 'V'", "pass the rad per volt as reference_unit"),
    reference("command [counts]", "pass the rad per count as reference_unit"),
    row(
        "a number in place of a unit that the file states",
        named(position="angle_deg"),
        "angle_deg is in 'deg' according to the file, but position_unit is 0.1: pass position_unit='deg'",
        call=partial(read_trial, position_unit=0.1),
        remedy={"position_unit": "deg"},
    ),
    row(
        "a torque in V whose unit is given as V",
        named(torque="torque_V"),
        "torque_unit takes a number, how many N·m 1 is in the file",
        "pass the N·m per volt; got 'V'",
        call=partial(read_trial, torque_unit="V"),
    ),
    position("pos_counts", "pass the rad per count as position_unit"),
    row(
        "torque: another unit than the one that is given",
        named(torque="torque_ftlb"),
        "but torque_unit is 'N·m': pass torque_unit='ft·lbf' (1 ft·lbf = 1.35582 N·m)",
        call=in_newton_metres,
        remedy={"torque_unit": "ft·lbf"},
    ),
    # names
    row(
        "names: velocities alone",
        named(position="theta_dot"),
        "no variable is called position or pos or angle or theta",
        "the file has: time, theta_dot, torque.",
        remedy={"position": None},
    ),
    row(
        "names: an acceleration alone",
        named(position="acc_angle"),
        "no variable is called position or pos",
        remedy={"position": None},
    ),
    row(
        "names: a counter alone",
        timed("Sample Number (10000 samples per second)", range(len(TIME))),
        "there is no sampling rate",
        remedy={"sampling_rate": None},
    ),
    row(
        "names: frames alone",
        timed("frame (1 per second)", range(len(TIME))),
        "there is no sampling rate",
        remedy={"sampling_rate": None},
    ),
    row(
        "names: a counter that is called time",
        timed("time", range(len(TIME))),
        "time runs at 1 Hz, too slow for a joint",
        remedy={"sampling_rate": None},
    ),
    row(
        "names: with blanks, between blanks",
        text_file("a.txt", "Time (s) my angle torque\n" + "0 1 2\n" * 5),
        "a.txt: there are blanks between the numbers, and more or fewer names in line 1",
    ),
    row(
        "names: LabChart without its titles",
        text_file("a.txt", "Interval=\t0.001 s\nRange=\t10 V\t10 V\n" + "0\t1\n1\t2\n" * 5),
        "no variable is called position",
        remedy={"position": None},
    ),
    row(
        "an unknown unit",
        named(),
        "a.csv: torque_unit must be a unit such as N·m, or a number",
        "got 'xyz'",
        call=partial(read_trial, torque_unit="xyz"),
    ),
    # scales
    scale(
        "hdf5: a gain",
        hdf5_torque(gain=20.0),
        "a.h5: torque is in 'gain = 20.0' according to the file",
    ),
    scale("hdf5: a conversion without a unit", hdf5_torque(conversion=2), "is in 'conversion = 2'"),
    row(
        "hdf5: an offset",
        hdf5_torque(Offset=0.5, units="Nm"),
        "torque has Offset = 0.5",
        "apply it to the samples, and make the trial with new_trial",
        call=in_newton_metres,
    ),
    scale(
        "mat: a scale in the struct",
        struct(scale=0.1),
        "Angle.values is in 'scale = 0.1'",
        option="position_unit",
    ),
    scale("mat: a gain beside the torque", mat_file(torque_gain=3.0), "torque is in 'gain = 3.0'"),
    row(
        "mat: a unit in the struct",
        struct(units="mm"),
        "Angle.values is in 'mm'",
        remedy={"position_unit": None},
    ),
    row(
        "hdf5: an unstated unit, and another one in the name",
        hdf5_ftlb,
        "torque_ftlb is in 'ftlb'",
        call=in_newton_metres,
        remedy={"torque_unit": "ft·lbf"},
    ),
    # times
    row("Time (s): a gap", timed("Time (s)", LATE), "irregular at sample 151", CUT),
    row("TIME: a gap", timed("TIME", LATE), "TIME is irregular at sample 151", CUT),
    row("Zeit [ms]: a gap", timed("Zeit [ms]", 1e3 * LATE), "(0.802 s)", CUT),
    row(
        "times that go back",
        timed("time", TIME - 0.5 * (TIME > 0.4)),
        "time is irregular at sample 201",
        "another sequence begins there: cut the file into two",
    ),
    row(
        "times that jitter, and a gap",
        timed("time", STAMPS + 0.05 * (TIME > 0.3)),
        "time is irregular at sample 151",
        CUT,
    ),
    row(
        "times that jitter by more than half a sample",
        timed("time", TIME + 4.0 * (STAMPS - TIME)),
        "time jitters around an even clock of",
        "pass jitter=True if the samples were taken evenly",
    ),
    row(
        "times that jitter, and another rate",
        timed("time", STAMPS),
        "the sampling rate is stated as 1000 Hz, but time runs at",
        call=at_1_khz,
        remedy={"sampling_rate": None},
    ),
    row(
        "a gap, and resample",
        timed("time", LATE),
        "time is irregular at sample 151",
        call=partial(read_trial, resample=1000.0),
    ),
    row(
        "uneven times, and a rate below theirs",
        timed("time", UNEVEN),
        "resample must be between the mean rate of time",
        call=partial(read_trial, resample=100.0),
    ),
    row(
        "uneven times",
        timed("time", UNEVEN),
        "time jitters around an even clock",
        "or resample in Hz if not",
    ),
    row(
        "resample without times",
        mat_file(),
        "resample needs times",
        call=partial(read_trial, resample=1000.0),
    ),
    row("Time (rad)", timed("Time (rad)", TIME), "in 'rad'", "write it in seconds, ms or µs"),
    row(
        "a clock: a gap",
        timed("time", [*CLOCK[:100], *CLOCK[150:], *CLOCK[:50]]),
        "time is irregular at sample 100",
    ),
    row(
        "a clock: an empty cell",
        timed("time", [*CLOCK[:7], ":", *CLOCK[8:]]),
        "time is not finite at sample 7",
    ),
    row(
        "timestamps: another rate is stated",
        timed("timestamps", TIME),
        "stated as 1000 Hz, but timestamps runs at 500 Hz",
        call=at_1_khz,
        remedy={"sampling_rate": None},
    ),
    row(
        "no times on purpose, and no rate",
        named(),
        "there is no sampling rate",
        call=partial(read_trial, time=None),
        remedy={"sampling_rate": None},
    ),
    row(
        "a column fs that contradicts the times",
        text_file("a.csv", csv_text({**SIGNALS, "fs": np.full(300, 1000)})),
        "stated as 1000 Hz, but time runs at 500 Hz",
        remedy={"sampling_rate": None},
    ),
    row(
        "a column Fs with one number that contradicts the times",
        text_file("a.csv", csv_text({**SIGNALS, "Fs": ["250", *[""] * 299]})),
        "stated as 250 Hz, but time runs at 500 Hz",
        remedy={"sampling_rate": None},
    ),
    row(
        "a column fs of text",
        text_file("a.csv", csv_text({**SIGNALS, "fs": ["500 Hz"] * 300})),
        "Pass sampling_rate in Hz",
        remedy={"sampling_rate": None},
    ),
    row(
        "times with a wrong sample",
        timed("Time_s", changed(TIME, 50, 0.0)),
        "Time_s jitters around an even clock of",
        "the most at sample 50 (",
    ),
]
