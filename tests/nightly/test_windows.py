"""The library and the command line without what Windows lacks: see tests/without_posix."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.posix  # it is hidden here, and missing there
TESTS = Path(__file__).parents[1]
FOLDERS = f"{TESTS / 'without_posix'}{os.pathsep}{TESTS.parent / 'src'}"
FILES = """
import signal
import ankleloop
from ankleloop_lab.files.demo_files import write_recording
assert not hasattr(signal, "SIGKILL")
simulated = ankleloop.simulate(seed=1, duration=12.0)
write_recording(simulated, "Sa.csv", "csv")
write_recording(simulated, "Sb.mat", "matlab-5")
write_recording(simulated, "Sc.h5", "hdf5")
"""
LIBRARY = """
import numpy as np
for name in ("Sa.csv", "Sb.mat", "Sc.h5"):
    trial = ankleloop.read_trial(name)
    np.testing.assert_allclose(trial["position"], simulated["position"])
    ankleloop.save_trial(trial, "trial.nc", overwrite=True)
    assert ankleloop.load_trial("trial.nc").identical(trial)
    try:
        ankleloop.read_trial(name, torque="moment")
    except ankleloop.DataError as error:
        print(error)
estimate = ankleloop.identify(trial, "pr-moesp")
for _ in range(2):
    ankleloop.save_estimate(estimate, "estimate.nc", overwrite=True)
    assert str(ankleloop.load_estimate("estimate.nc")) == str(estimate)
"""
COMMANDS = """
import ankleloop_lab.recordings.processes
from ankleloop_lab.command_line.main import main
ankleloop_lab.recordings.processes.IS_FORKED = False
assert main(["check", "*.csv", "--position", "angle_deg"]) == 0
options = ["--method", "pr-moesp", "--output", "results"]
assert main(["identify", "S*.mat", "S*.h5", *options]) == 0  # in interpreters of their own
assert main(["identify", "Sc.h5", *options, "--overwrite"]) == 0
"""


def test_library_and_commands(tmp_path):
    process = subprocess.run(
        [sys.executable, "-c", FILES + LIBRARY + COMMANDS],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": FOLDERS, "PYTHONIOENCODING": "cp1252"},
        capture_output=True,
        encoding="cp1252",
    )
    output = process.stdout + process.stderr
    assert process.returncode == 0, output
    assert output.count("there is no variable 'moment'") == 3
    assert "in N·m" in output
    assert "next: ankleloop identify Sa.csv --position angle_deg" in output
    assert "recording 2 of 2: Sc (Sc.h5)" in output
    assert output.count("take PR-MOESP") == 1  # which only the results of a single recording say
    assert {path.name for path in (tmp_path / "results").iterdir()} >= {"Sb.html", "Sc.html"}
