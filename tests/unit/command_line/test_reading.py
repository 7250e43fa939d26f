"""How the verbs read a file: variables by their names, units, and what decides where names leave a choice."""

import h5py
import numpy as np
import pytest

from ankleloop import read_trial
from ankleloop.command_line.reading import map_file
from ankleloop.config.recording_settings import read_recordings
from ankleloop.recordings.files import load_recording
from ankleloop.trials.reading_options import NO_REFERENCE, ReadingOptions
from ankleloop.trials.reading_process import read_channels
from ankleloop.trials.recording_files import FILE_FORMATS, write_recording

WAVE = np.sin(np.arange(300) / 20)


def write_columns(path, *names):
    np.savetxt(
        path,
        np.column_stack([WAVE + k for k, _ in enumerate(names)]),
        "%.5f",
        ",",
        header=",".join(names),
    )
    path.write_text(path.read_text().removeprefix("# "))
    return path


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (("position", "torque"), ("position", "torque", NO_REFERENCE, "rad")),
        (("t", "Angle", "Moment", "Command"), ("Angle", "Moment", "Command", "rad")),
        (
            ("ankle_angle_deg", "ankleTorque_Nm", "ref"),
            ("ankle_angle_deg", "ankleTorque_Nm", "ref", "deg"),
        ),
        (
            ("angle [deg]", "angle_velocity", "tq", "angleCmd"),
            ("angle [deg]", "tq", "angleCmd", "deg"),
        ),
        (("theta", "trq", "torque_reflex", "torque_noise"), ("theta", "trq", NO_REFERENCE, "rad")),
        (
            ("pos", "torque", "torque_reference", "set_point", "setpoint"),
            ("pos", "torque", "setpoint", "rad"),
        ),
    ],
)
def test_names_that_leave_no_choice(tmp_path, names, expected):
    recording = map_file(write_columns(tmp_path / "a.csv", *names))
    assert (
        recording.position,
        recording.torque,
        recording.reference,
        recording.position_unit,
    ) == expected


@pytest.mark.parametrize(
    ("names", "words", "option"),
    [
        (
            ("position", "angle", "torque"),
            "2 variables may be the position: position, angle.",
            "--position NAME",
        ),
        (
            ("angle", "torque", "ref", "cmd"),
            "2 variables may be the reference: ref, cmd.",
            "--reference NAME, or --no-reference",
        ),
        (
            ("angle", "force"),
            "no variable is called torque or moment or tq or trq",
            "--torque NAME",
        ),
    ],
)
def test_names_that_leave_a_choice_are_not_guessed(run, tmp_path, names, words, option):
    path = write_columns(tmp_path / "a.csv", *names)
    for verb in (["check"], ["identify"], ["study", tmp_path / "new.yaml"]):
        result = run(*verb, path)
        assert result.status == 2
        message = " ".join(result.err.split())
        assert f"a.csv: {words}" in message
        assert f"Option that decides: {option}." in message
    assert [file.name for file in tmp_path.iterdir()] == ["a.csv"]


def test_stated_units(tmp_path, capsys):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, unit in {"run/angle": "Degrees", "run/moment": "N·m"}.items():
            file[name] = WAVE
            file[name].attrs["units"] = unit
    recording = map_file(tmp_path / "a.h5")
    assert (recording.position, recording.position_unit) == ("run/angle", "deg")
    assert "run/angle, in deg (stated by the file)" in capsys.readouterr().out
    named = map_file(tmp_path / "a.h5", position="/run/angle", position_unit="rad")
    assert named.position_unit == "rad"  # which reading then refuses


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--torque-sign", "2"], "'--torque-sign'"),
        (["--position-unit", "grad"], "'grad' is not one of 'rad', 'deg'."),
        (["--start", "5", "--stop", "3"], "stop (3 s) must be after start (5 s)"),
        (["--sampling-rate", "0"], "sampling_rate must be between 0.001 and 1e9 Hz, got 0.0."),
        (
            ["--reference", "ref", "--no-reference"],
            "--reference and --no-reference exclude each other.",
        ),
        (["--torque", "angle"], "position and torque are the same variable, 'angle'"),
    ],
)
def test_wrong_options(run, tmp_path, arguments, words):
    path = write_columns(tmp_path / "a.csv", "angle", "torque")
    arguments = [*arguments, "--position", "angle"] if "--torque" in arguments else arguments
    result = run("check", path, *arguments)
    assert result.status == 2
    assert words in " ".join(result.err.split())


def test_all_who_read_take_the_same_variables(tmp_path):
    path = write_columns(tmp_path / "S1.csv", "ankle_angle_deg", "moment", "command_deg", "knee")
    table = tmp_path / "recordings.csv"
    table.write_text("file,name,reference\nS1.csv,a,\nS1.csv,b,none\n")
    trial = read_trial(path, sampling_rate=500.0)
    assert trial.attrs["reference_variable"] == "command_deg"
    np.testing.assert_allclose(trial["position"], np.radians(np.round(WAVE, 5)))
    recordings = read_recordings(table, {"sampling_rate": 500.0})
    mapped = [map_file(path, sampling_rate=500.0), *recordings["a"]]
    for recording in mapped:
        assert load_recording(path, recording.model_dump()).identical(trial)
    unmoved = [map_file(path, sampling_rate=500.0, no_reference=True), *recordings["b"]]
    for recording in unmoved:
        recorded = load_recording(path, recording.model_dump())
        assert recorded.drop_attrs().identical(trial.drop_vars("reference").drop_attrs())


@pytest.mark.parametrize("kind", FILE_FORMATS)
def test_variables_of_every_format(tmp_path, trial, kind):
    path = tmp_path / f"a{FILE_FORMATS[kind]}"
    write_recording(trial, path, kind)
    recording = map_file(path)
    found = read_channels(path, None, "find", variables=ReadingOptions().names)
    assert {channel: variable.name for channel, variable in found.items()} == recording.channels
    assert all(variable.read().size == 0 for variable in found.values())
    recorded = read_trial(path, **recording.model_dump(include=set(ReadingOptions.model_fields)))
    for name in ("position", "torque", "reference"):
        np.testing.assert_allclose(recorded[name], trial[name], rtol=1e-9, atol=1e-12)
