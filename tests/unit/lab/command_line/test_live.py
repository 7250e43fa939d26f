"""`live` with a table from standard input, and what is wrong usage."""

import re
import sys

import pandas as pd
import pytest

from ankleloop import identify, simulate
from ankleloop_lab.files.demo_files import write_recording


@pytest.fixture
def trial(tmp_path, monkeypatch):
    """A trial, which is on standard input, too."""
    trial = simulate(seed=3, duration=12.0)
    write_recording(trial, tmp_path / "input.csv", "csv")
    monkeypatch.chdir(tmp_path)
    with open("input.csv") as file:
        monkeypatch.setattr(sys, "stdin", file)
        yield trial


def test_a_table_from_standard_input(run, trial, tmp_path):
    (tmp_path / "history.csv").write_text("mine")
    result = run("live", "-", "--no-page", "--memory", "10", "--width", "K=20%")
    assert result.status == 0
    assert (
        "position in deg: position angle_deg, torque torque_nm, reference command_deg" in result.out
    )
    assert re.search(r"   12\.0 s  K \d.*K within ± 20 %: yes, since 1\d", result.out)
    assert (tmp_path / "history.csv").read_text() == "mine"  # what was there stays
    last = pd.read_csv("history-2.csv").iloc[-1]
    window = identify(trial.isel(time=slice(2000, None)))
    assert last["K"] == pytest.approx(window.stiffness["K"], rel=1e-4)


@pytest.mark.parametrize(
    ("arguments", "status", "words"),
    [
        (["-", "--lsl", "a"], 2, "name a table, or a stream by --lsl"),
        (["-", "--memory", "3"], 2, "memory"),
        (["-", "--width", "stiffness=5%"], 1, "there is no parameter 'stiffness'"),
        (["-", "--torque", "force"], 1, "there is no variable 'force'"),
    ],
)
def test_wrong_options(run, trial, arguments, status, words):
    result = run("live", "--no-page", *arguments)
    assert result.status == status
    assert words in result.err
