"""Files as laboratories have them give the numbers that the same signals give in N·m, rad and s."""

import h5py
import numpy as np
import pandas as pd
import pytest
import scipy.io

from ankleloop import check_trial, read_trial

RATE = 500.0
T = np.arange(300) / RATE
P = 0.02 * np.sin(2 * np.pi * 3 * T)
TQ = 3.0 * np.cos(2 * np.pi * 3 * T)
COLUMNS = {"time_s": T, "angle_rad": P, "torque_nm": TQ}
UNITS = ",rad,N.m\n"


def table(columns=COLUMNS, **options):
    return pd.DataFrame(columns).to_csv(index=False, float_format="%.12g", **options)


def write(folder, text, name="a.csv", encoding="utf-8"):
    (folder / name).write_bytes(text.encode(encoding))
    return folder / name


def assert_signals(trial, rate=RATE, **tolerances):
    np.testing.assert_allclose(trial.position, P, **{"atol": 1e-9, **tolerances})
    np.testing.assert_allclose(trial.torque, TQ, **{"atol": 1e-9, **tolerances})
    assert trial.attrs["sampling_rate"] == pytest.approx(rate, rel=1e-6)


# --- tables of text

NUMBERS = table(header=False)
WITHOUT_TIME = {name: COLUMNS[name] for name in ("angle_rad", "torque_nm")}
LABCHART = (
    "Interval=\t0.002 s\nExcelDateTime=\t4.2e+04\nChannelTitle=\tAngle\tTorque\nRange=\t10.000 V\t10.000 V\n"
    "UnitName=\trad\tNm\n"
)
OPENSIM = "run\nversion=1\nnRows=300\ninDegrees=yes\nendheader\ntime\tankle_angle_r\tankle_angle_r_moment\n"
LAYOUTS = {
    "semicolons.csv": table(sep=";"),
    "semicolons and commas.csv": table(sep=";", decimal=","),
    "tabs.tsv": table(sep="\t"),
    "tabs and commas.txt": table(sep="\t", decimal=","),
    "quotes.csv": table(quoting=1),
    "blanks.csv": table().replace(",", ", "),
    "comments.csv": "# device: X\n% rate, 1000 Hz\n\n" + table(),
    "a header of numpy.txt": "# " + table(),
    "title.csv": "Subject 7; left\n" + table(sep=";", decimal=","),
    "spreadsheet.csv": "Subject,7,\nRate,500,\nDate,,\n" + table(),
    "two rows of names.csv": "Clock,Dyno,Dyno\n" + table(),
    "a row of units.csv": "time,angle,torque\ns,rad,Nm\n" + NUMBERS,
    "blanks only.txt": table().replace(",", "  "),
    "numpy savetxt.txt": "# time_s angle_rad torque_nm\n" + table(header=False, sep=" "),
    "a column v.csv": "rig 3\n" + table({**COLUMNS, "v": np.zeros(300)}),
    "two rows of names and units.csv": "a,b,c\ntime,angle,torque\ns,rad,Nm\n" + NUMBERS,
    "labchart.txt": LABCHART + table(header=False, sep="\t").replace("\n", "\t#* start\n", 1),
    "labchart without times.txt": LABCHART + table(WITHOUT_TIME, header=False, sep="\t"),
    "opensim.sto": OPENSIM + table({**COLUMNS, "angle_rad": np.degrees(P)}, header=False, sep="\t"),
    "device.csv": "Devices\n500\n,Dyno - Angle,Dyno - Torque\nTime,Angle,Torque\n"
    + UNITS
    + NUMBERS,
    "text beside.csv": table(
        {**COLUMNS, "note": ["rest, 1.5"] * 299 + ["end"], "n": np.arange(300)}
    ),
    "an empty cell.csv": table({"emg": [np.nan, *T[1:]], **COLUMNS}),
}


@pytest.mark.parametrize("name", LAYOUTS)
def test_layouts(tmp_path, name):
    assert_signals(read_trial(write(tmp_path, LAYOUTS[name], name)))


@pytest.mark.parametrize("encoding", ["utf-16", "utf-8-sig"])
@pytest.mark.parametrize("separator", ["\t", ";"])
def test_encodings(tmp_path, encoding, separator):
    path = write(tmp_path, table(sep=separator, decimal=","), encoding=encoding)
    assert_signals(read_trial(path))


@pytest.mark.parametrize("encoding", ["utf-8", "cp1252"])
def test_units_below_the_names_count(tmp_path, encoding):
    degrees = {"t": 1000 * T, "angle": np.degrees(P), "torque": TQ / 10}
    text = table(degrees).replace("\n", "\nms,°,kgf·m\n", 1)
    trial = read_trial(write(tmp_path, text, encoding=encoding), torque_unit="kgf.m")
    np.testing.assert_allclose(trial.torque, 0.980665 * TQ, atol=1e-6)
    np.testing.assert_allclose(trial.position, P, atol=1e-9)
    assert trial.attrs["position_unit_of_file"] == "deg"


# --- units


@pytest.mark.parametrize(
    "name", ["Torque (N.m)", "Torque N.m", "tq_Nm", "MomentNm", "torque [Newton-metres]"]
)
def test_names_of_a_torque_in_newton_metres(tmp_path, name):
    columns = {"time_s": T, "position": P, name: TQ}
    assert_signals(read_trial(write(tmp_path, table(columns))))


TORQUE_UNITS = [  # spellings, the names that are recorded, and N·m
    ("ft·lb", "ft·lbf", 0.3048 * 4.4482216152605),
    ("lbf-ft", "lbf·ft", 0.3048 * 4.4482216152605),
    ("in.lb", "in·lbf", 0.0254 * 4.4482216152605),
    ("ozfin", "ozf·in", 0.0254 * 4.4482216152605 / 16),
    ("mNm", "mN·m", 1e-3),
    ("NCM", "N·cm", 1e-2),
    ("N.mm", "N·mm", 1e-3),
    ("kgf*m", "kgf·m", 9.80665),
    ("kgfcm", "kgf·cm", 9.80665e-2),
    ("kg-cm", "kgcm", 9.80665e-2),
    ("newton metres", "N·m", 1.0),
]


@pytest.mark.parametrize(("spelling", "unit", "factor"), [*TORQUE_UNITS, (20, "20 N·m", 20.0)])
def test_torques_in_other_units(tmp_path, spelling, unit, factor):
    path = write(tmp_path, table({"time_s": T, "position": P, "torque": TQ / factor}))
    trial = read_trial(path, torque_unit=spelling, torque_sign=-1)
    np.testing.assert_allclose(trial.torque, -TQ, atol=1e-7)
    assert trial.attrs["torque_unit_of_file"] == unit


@pytest.mark.parametrize(("spelling", "unit", "factor"), TORQUE_UNITS)
@pytest.mark.parametrize("name", ["torque_{}", "Torque ({})"])
def test_a_unit_that_the_file_states_is_converted(tmp_path, spelling, unit, factor, name):
    columns = {"time_s": T, "position": P, name.format(spelling): TQ / factor}
    trial = read_trial(write(tmp_path, table(columns)))
    np.testing.assert_allclose(trial.torque, TQ, atol=1e-7)
    assert trial.attrs["torque_unit_of_file"] == unit


@pytest.mark.parametrize(
    ("name", "unit", "size"),
    [
        ("position_turns", None, 2 * np.pi),
        ("angle [mrad]", "mrad", 1e-3),
        ("angle_deg.1", None, np.pi / 180),
        ("Angle..deg.", None, np.pi / 180),
        ("pos_counts", 0.001, 0.001),
        ("angle (knee)", "rad", 1.0),
        ("angle_A", None, 1.0),  # a leg
        ("pos_in", None, 1.0),  # no inches
    ],
)
def test_positions_in_other_units(tmp_path, name, unit, size):
    columns = {"time_s": T, name: P / size, "torque": TQ, "command": 2 * P / size}
    path = write(tmp_path, table(columns))
    trial = read_trial(path, position=name, position_unit=unit)
    np.testing.assert_allclose(trial.position, P, atol=1e-8)
    np.testing.assert_allclose(trial.reference, 2 * P, atol=1e-8)


@pytest.mark.parametrize(
    ("name", "unit", "size"),
    [
        ("command_rad", None, 1.0),
        ("command_V", 0.1, 0.1),
        ("command", "mrad", 1e-3),
        ("command_nm", None, 1.0),
        ("command (ft.lb)", "ft.lb", 0.3048 * 4.4482216152605),
    ],
)
def test_a_reference_has_a_unit_of_its_own(tmp_path, name, unit, size):
    columns = {"time_s": T, "angle_deg": np.degrees(P), "torque": TQ, name: 2 * P / size}
    trial = read_trial(write(tmp_path, table(columns)), reference_unit=unit)
    assert_signals(trial)
    np.testing.assert_allclose(trial.reference, 2 * P, rtol=1e-6, atol=1e-7)
    assert trial.attrs["position_unit_of_file"] == "deg"


# --- scales


@pytest.mark.parametrize(
    ("attributes", "stored"),
    [
        ({"conversion": 20.0, "unit": "N·m"}, TQ / 20),
        ({"conversion": 2.0, "offset": 1.0, "unit": "newton meters"}, (TQ - 1) / 2),
        ({"scale_factor": 0.5, "add_offset": -1.0}, 2 * (TQ + 1)),
        ({"gain": 1.0, "offset": 0.0, "units": "Nm"}, TQ),
    ],
)
def test_scales_that_a_convention_fixes(tmp_path, attributes, stored):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.update({"position": P, "torque": stored, "fs": RATE})
        file["torque"].attrs.update(attributes)
    assert_signals(read_trial(tmp_path / "a.h5"))


def test_scales_that_the_caller_states(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.update({"position": P, "torque": TQ / 20, "fs": RATE})
        file["torque"].attrs["gain"] = 20.0
    assert_signals(read_trial(tmp_path / "a.h5", torque_unit=20.0))


def test_a_channel_in_a_struct_of_its_own(tmp_path):
    channels = {
        "Angle": {"values": np.degrees(P), "units": "deg", "offset": 0.0},
        "Torque": {"values": TQ, "units": "Nm"},
        "Command": {"values": np.degrees(P), "units": "deg"},
    }
    scipy.io.savemat(tmp_path / "a.mat", {**channels, "fs": RATE})
    trial = read_trial(tmp_path / "a.mat")
    assert_signals(trial)
    np.testing.assert_allclose(trial.reference, P)


def test_a_channel_in_a_group_of_its_own(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, values in {"ankle_angle": P, "torque": TQ}.items():
            file.update({f"{name}/data": values, f"{name}/timestamps": 8.0 + T})
    assert_signals(read_trial(tmp_path / "a.h5"))


# --- times


def clock(start, form):
    return pd.date_range(start, periods=300, freq="2ms").strftime(form)


@pytest.mark.parametrize(
    ("name", "times"),
    [
        ("Time (s)", T),
        ("time [ms]", 1e3 * T),
        ("TIME", T),
        ("timestamps", T + 1e6),
        ("Zeit", T),
        ("Elapsed_ms", 1e3 * T),
        ("lsl_timestamp", T + 1e6),
        ("time [min]", T / 60),
        ("X [s]", T),
        ("seconds", T),
        ("time", clock("2026-01-01 10:00", "%H:%M:%S.%f")),
        ("Time", clock("2026-01-01 10:05:59.9", "%M:%S.%f")),
        ("date and time", clock("2026-01-01 10:00", "%H:%M:%S.%f")),
        ("time_ms", clock("2026-01-31 23:59:59.9", "%Y-%m-%d %H:%M:%S.%f")),
        ("timestamp", clock("2026-01-01 10:00", "%d/%m/%Y %I:%M:%S.%f %p")),
    ],
)
def test_times(tmp_path, name, times):
    path = write(tmp_path, table({name: times, "angle": P, "torque": TQ}))
    options = {"time": name} if name == "date and time" else {}
    assert_signals(read_trial(path, **options))


@pytest.mark.parametrize(
    "columns",
    [
        {"Sample Number (500 samples per second)": np.arange(300), "Time (ms)": 1e3 * T},
        {"frame (1 per second)": np.arange(300), "time": T},
        {"time": np.arange(300), "elapsed (s)": T},
        {"Time": np.full(300, 7.0), "t": T},
        {"onset (ms)": np.tile([3.0, 1.0], 150), "Time (ms)": 1e3 * T},
    ],
)
def test_of_several_times_those_that_rise_and_have_a_unit_count(tmp_path, columns):
    assert_signals(read_trial(write(tmp_path, table({**columns, "angle": P, "torque": TQ}))))


RNG = np.random.default_rng(1)
NOISE = RNG.standard_normal(300) / RATE  # of one sample


@pytest.mark.parametrize(
    ("times", "options", "jitter"),
    [
        (T + 0.2 * NOISE, {}, 0.2),
        (T + 2.0 * NOISE, {"jitter": True}, 2.0),
        (np.round(T, 2), {"jitter": True}, 0.0028 * RATE),
    ],
)
def test_times_that_jitter_around_an_even_clock(tmp_path, times, options, jitter):
    columns = {"time": times, "angle": P, "torque": TQ}
    trial = read_trial(write(tmp_path, table(columns)), **options)
    np.testing.assert_allclose(trial.position, P, atol=1e-9)
    assert trial.attrs["sampling_rate"] == pytest.approx(RATE, rel=0.005)
    assert trial.attrs["jitter"] == pytest.approx(jitter, rel=0.15)


def test_samples_that_were_taken_unevenly(tmp_path):
    times = np.cumsum(RNG.uniform(0.5, 1.5, 300)) / RATE
    columns = {
        "time": times,
        "position": 0.02 * np.sin(2 * np.pi * 3 * times),
        "torque": 3.0 * np.cos(2 * np.pi * 3 * times),
    }
    trial = read_trial(write(tmp_path, table(columns)), resample=1000.0)
    even = times[0] + trial.time.values
    np.testing.assert_allclose(trial.position, 0.02 * np.sin(2 * np.pi * 3 * even), atol=1e-6)
    np.testing.assert_allclose(trial.torque, 3.0 * np.cos(2 * np.pi * 3 * even), atol=1e-4)
    assert (trial.attrs["sampling_rate"], trial.attrs["resample"]) == (1000.0, 1000.0)


def test_a_clock_with_decimal_commas(tmp_path):
    times = clock("2026-01-01 10:00", "%H:%M:%S,%f")
    text = table({"Uhr": times, "angle": P, "torque": TQ}, sep=";", decimal=",")
    assert_signals(read_trial(write(tmp_path, text), time="Uhr"))


@pytest.mark.parametrize("left_out", [None, "none"])
def test_times_that_are_left_out_say_nothing_about_gaps(tmp_path, left_out):
    late = T + 0.5 * (T > 0.3)
    path = write(tmp_path, table({"Time (s)": late, "position": P, "torque": TQ}))
    trial = read_trial(path, time=left_out, sampling_rate=RATE)
    assert_signals(trial)
    assert trial.attrs["gaps"] == "unknown"
    assert "without gaps" not in str(check_trial(trial))


@pytest.mark.parametrize("cells", [[500] * 300, ["500"] + [""] * 299])
def test_a_rate_in_a_column(tmp_path, cells):
    assert_signals(read_trial(write(tmp_path, table({"fs": cells, "position": P, "torque": TQ}))))
