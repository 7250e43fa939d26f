"""How the verbs read a file: variables by their names, units, and what decides where names leave a choice."""

import h5py
import numpy as np
import pytest
import scipy.io

from ankleloop import read_trial
from ankleloop_lab.checking import ConfigError
from ankleloop_lab.command_line.reading import map_file, map_trials
from ankleloop_lab.recordings.files import load_recording
from ankleloop_lab.recordings.settings import read_recordings

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
    ("names", "words", "option"),
    [
        (
            ("position", "angle", "torque"),
            "2 variables may be the position: position, angle;",
            "--position NAME",
        ),
        (
            ("angle", "torque", "ref", "cmd"),
            "2 variables may be the reference: ref, cmd;",
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
    shown = capsys.readouterr().out
    assert "run/angle, in deg (stated by the file; 1 deg = 0.0174533 rad)" in shown
    map_file(tmp_path / "a.h5", torque="run/moment", torque_unit=1.0)
    assert "run/moment, in N·m (stated by the file), sign +1" in capsys.readouterr().out
    named = map_file(tmp_path / "a.h5", position="/run/angle", position_unit="rad")
    assert named.position_unit == "rad"  # which reading then refuses


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--torque-sign", "2"], "'--torque-sign'"),
        (
            ["--position-unit", "grad"],
            "position_unit must be a unit such as rad, or a number, how many rad 1 is in the file; got 'grad'.",
        ),
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
    table.write_text(
        "file,name,reference,torque_unit,time\nS1.csv,a,,,\nS1.csv,b,none,Nm,\nS1.csv,c,,20,none\n"
    )
    trial = read_trial(path, sampling_rate=500.0)
    assert trial.attrs["reference_variable"] == "command_deg"
    np.testing.assert_allclose(trial["position"], np.radians(np.round(WAVE, 5)))
    recordings = read_recordings(table, {"sampling_rate": 500.0})
    mapped = [map_file(path, sampling_rate=500.0), *recordings["a"]]
    for recording in mapped:
        assert load_recording(path, recording.model_dump()).identical(trial)
    scaled = load_recording(path, recordings["c"][0].model_dump())
    np.testing.assert_allclose(scaled["torque"], 20 * trial["torque"])
    unmoved = [map_file(path, sampling_rate=500.0, no_reference=True), *recordings["b"]]
    for recording in unmoved:
        recorded = load_recording(path, recording.model_dump())
        assert recorded.drop_attrs().identical(trial.drop_vars("reference").drop_attrs())


@pytest.fixture
def rows(tmp_path):
    """A file whose matrices have two trials, in their rows."""
    values = {
        "position": np.stack([0.1 * WAVE, 0.2 * WAVE]),
        "torque": np.stack([WAVE + 1.0, WAVE]),
    }
    scipy.io.savemat(tmp_path / "S1.mat", {**values, "fs": 500.0})
    return tmp_path / "S1.mat"


NAMES = ["position[0, :]", "position[1, :]"]
STARS = {"position": "position[*, :]", "torque": "torque[*, :]"}


def test_trials_of_a_file_are_recordings(rows, capsys):
    trials = map_trials(rows, **STARS)
    assert [trial.position for trial in trials] == NAMES
    assert (
        "position[*, :] (2 trials, the first one begins with 0), in rad" in capsys.readouterr().out
    )
    second = load_recording(rows, trials[1].model_dump())
    np.testing.assert_allclose(second["position"], 0.2 * WAVE)
    assert [
        trial.position for trial in map_trials(rows, position=NAMES[1], torque="torque[1]")
    ] == [NAMES[1]]
    assert "torque[1] (begins with 0), in N·m" in capsys.readouterr().out


def test_trials_of_a_file_in_a_table(rows, tmp_path):
    table = tmp_path / "recordings.csv"
    table.write_text(
        "file,name,batch,position,torque\n"
        'S1.mat,a,,"position[*, :]","torque[*, :]"\n'
        'S1.mat,,b,"position[*, :]","torque[*, :]"\n'
        'S1.mat,c,,"position[1, :]","torque[1, :]"\n'
    )
    recordings = read_recordings(table, {}, tmp_path)
    names = {name: [part.position for part in parts] for name, parts in recordings.items()}
    assert names == {"a-0": NAMES[:1], "a-1": NAMES[1:], "b": NAMES, "c": NAMES[1:]}
    table.write_text(table.read_text().replace(",c,", ",a-1,"))
    with pytest.raises(ConfigError, match=r"the name 'a-1' is taken"):
        read_recordings(table, {}, tmp_path)


def test_verbs_and_trials_of_a_file(run, rows, tmp_path):
    stars = [word for name, star in STARS.items() for word in (f"--{name}", star)]
    checked = run("check", rows, *stars)
    assert checked.status == 1
    assert checked.out.count("length: 0.6 s at 500 Hz") == 2
    identified = run("identify", rows, *stars, "--output", tmp_path / "results")
    assert "S1-0  refused" in identified.out
    assert (tmp_path / "results" / "S1-1.html").exists()
