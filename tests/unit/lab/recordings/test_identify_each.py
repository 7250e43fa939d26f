"""Many trials to one table: labels, refusals, merged trials, and processes that need no preparation."""

import os
import re
import signal
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

from ankleloop import DataError, identify, identify_each, new_trial, simulate
from ankleloop.errors import ResourceError
from ankleloop_lab.files.demo_files import write_recording
from ankleloop_lab.recordings import processes

SCRIPT = """
import sys
from ankleloop import identify_each, simulate
from ankleloop_lab.recordings import processes
processes.IS_FORKED = sys.argv[1] == "fork"
print("started")
table = identify_each([simulate(seed=seed, duration=20.0) for seed in (1, 2)], "riv", jobs=2)
print(*table["K"])
"""


@pytest.fixture(scope="module")
def trials():
    made = [simulate(seed=seed, duration=20.0) for seed in (1, 2, 3)]
    return [trial.assign_attrs(subject=f"S{number}") for number, trial in enumerate(made)]


def test_rows_have_labels_parameters_and_reasons(trials):
    broken = trials[1].drop_vars("reference").assign_attrs(subject="S9", MVC=10)
    table = identify_each([trials[0], broken, trials[1:]])
    assert list(table["recording"]) == [1, 2, 3]
    assert list(table["trials"]) == [1, 1, 2]
    assert list(table["subject"][:2]) == ["S0", "S9"]
    assert pd.isna(table["subject"][2])  # those that are merged differ in it
    assert table["MVC"][1] == 10
    assert "seed" not in table  # what was simulated is no label
    single, merged = identify(trials[0]), identify(trials[1:])
    assert table["K"][0] == single.stiffness["K"]
    assert (table["K_low"][2], table["K_high"][2]) == merged.intervals["K"]
    assert table["refused"][1].startswith("the trial has no reference")
    assert list(table["trusted"]) == [True, False, True]
    assert pd.isna(table["K"][1])


def test_files_and_their_names(trials, tmp_path, capsys):
    paths = [tmp_path / "A_rest.mat", tmp_path / "A_10MVC.mat"]
    write_recording(trials[0], paths[0], "matlab-5")
    paths[1].write_bytes(b"no recording")
    table = identify_each(paths, "riv", names="{subject}_{condition}", progress=True)
    assert table[["source", "subject", "condition"]].values.tolist() == [
        [str(paths[0]), "A", "rest"],
        [str(paths[1]), "A", "10MVC"],
    ]
    assert "A_10MVC.mat: not a readable .mat file" in table["refused"][1]
    assert capsys.readouterr().err == "trial 1 of 2\ntrial 2 of 2\n"


def test_mistakes_are_errors_before_anything_is_identified(trials):
    with pytest.raises(ValueError, match="unknown method 'rvi'"):
        identify_each(trials, "rvi")
    with pytest.raises(TypeError, match="oder"):
        identify_each(trials, "riv", oder=3)
    with pytest.raises(DataError, match="there are no trials"):
        identify_each([])


@pytest.mark.parametrize("kind", ["fork", "interpreters"])
def test_a_script_without_a_guard_is_run_once(kind, trials, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    command = [sys.executable, str(script), kind]
    output = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120)
    started, numbers = output.stdout.splitlines()
    assert started == "started"
    stiffness = [identify(trial, "riv").stiffness["K"] for trial in trials[:2]]
    assert list(map(float, numbers.split())) == pytest.approx(stiffness, rel=1e-9)


@pytest.mark.parametrize("is_forked", [True, False])
def test_results_are_in_order_and_errors_those_of_the_item(monkeypatch, is_forked):
    monkeypatch.setattr(processes, "IS_FORKED", is_forked and sys.platform == "linux")
    assert list(processes.run_each(len, ["a", "bb", "ccc"], 2)) == [1, 2, 3]
    results = processes.run_each(re.compile, ["a", "(", "b"], 2)
    assert next(results) == re.compile("a")
    with pytest.raises(re.error):
        next(results)
    killed = processes.run_each(os._exit, [signal.SIGKILL, signal.SIGKILL], 2)
    with pytest.raises(ResourceError, match="was killed: most often memory was short"):
        next(killed)


def test_no_label_is_lost(trials):
    """Names of settings are labels of a trial that was not simulated; those of results have another name."""
    trial = trials[0]
    recorded = new_trial(trial.position, trial.torque, 1000.0, trial.reference)
    labels = {
        "movement": "reach",
        "voluntary": "20 %",
        "order": "first",
        "recording": "a",
        "trials": 7,
    }
    table = identify_each([recorded.assign_attrs(labels)], "riv")
    row = table.iloc[0]
    assert (row["movement"], row["voluntary"]) == ("reach", "20 %")
    assert (row["order_label"], row["recording_label"], row["trials_label"]) == ("first", "a", 7)
    assert (row["order"], row["recording"], row["trials"]) == (2, 1, 1)


def test_a_label_may_end_as_an_attribute_of_reading(trials):
    """And one that is called as a parameter stays a label where no trial has the parameter."""
    trial = trials[0]
    recorded = new_trial(trial.position, trial.torque, 1000.0, trial.reference, position_sign=-1)
    labels = {"clinical_sign": "Babinski", "motor_unit": 3, "G": "stroke"}
    table = identify_each([recorded.drop_vars("reference").assign_attrs(labels)], "riv")
    row = table.iloc[0]
    assert (row["clinical_sign"], row["motor_unit"], row["G_label"]) == ("Babinski", 3, "stroke")
    assert not {"G", "position_sign", "sampling_rate"} & set(table)


def test_files_are_read_by_the_options_of_read_trial(tmp_path, trials):
    """A file that cannot be read is a row."""
    trial = trials[0]
    columns = {"ch1": np.degrees(trial.position), "ch2": trial.torque / 1.3558179483314004}
    table = pd.DataFrame({**columns, "ch3": trial.reference, "t": trial.time})
    for name in ("S1_rest.csv", "S2_rest.csv"):
        table.to_csv(tmp_path / name, index=False)
    (tmp_path / "S2_rest.csv").write_bytes((tmp_path / "S1_rest.csv").read_bytes()[:100_000])
    options = {"position": "ch1", "torque": "ch2", "reference": "ch3", "torque_unit": "ft.lb"}
    units = {"position_unit": "deg", "reference_unit": "rad"}
    files = sorted(tmp_path.iterdir())
    result = identify_each(files, "riv", names="{subject}_{condition}", **options, **units)
    expected = identify_each([trial], "riv")
    assert result["K"][0] == pytest.approx(expected["K"][0], rel=1e-6)
    assert result["mean_torque"][0] == pytest.approx(float(trial.torque.mean()))
    assert result["mean_position"][0] == pytest.approx(float(trial.position.mean()))
    assert result["subject"].tolist() == ["S1", "S2"]
    assert "the file is cut off" in result["refused"][1]
    with pytest.raises(ValueError, match="torque_unit must be a unit such as N·m"):
        identify_each(files, "riv", torque_unit="xyz")
