"""The job of a chunk of recordings: what fails numerically is refused with its reason, the others finish."""

import os
import signal
import sys

import numpy as np
import pandas as pd
import pytest
from study_jobs import run_recordings_job

from ankleloop import load_estimate, save_trial, simulate
from ankleloop_lab import results as job_of_recordings

pytestmark = pytest.mark.usefixtures("coarse_pictures")

NAMES = ("good", "bad")  # of the recordings of a job


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recordings")
    for seed, name in enumerate((*NAMES, "after")):
        save_trial(simulate(seed=seed, duration=20.0), folder / f"{name}.nc")
    return folder


@pytest.fixture
def run_job(folder, tmp_path):
    """Run the job of two recordings, or of others; it gives the table and the folder of the pages."""

    def run(*names):
        named = names or NAMES
        files = {name: {"file": f"{name}.nc", "subject": "007"} for name in named}
        pages = tmp_path / "pages"
        run_recordings_job(
            pages, folder=str(folder), files=files, methods={"riv": {"method": "riv"}}
        )
        return pd.read_parquet(pages / "table.parquet"), pages

    return run


def fail_on_bad(function, error):
    """The function, which at its second call, that for the second recording, raises an error or gets a signal."""
    calls = []

    def change(*args, **options):
        calls.append(None)
        if len(calls) == 2:
            if isinstance(error, Exception):
                raise error
            os.kill(os.getpid(), error)
        return function(*args, **options)

    return change


@pytest.mark.parametrize("name", ["analyse", "draw_figures"])
def test_a_numerical_error_refuses_one_recording(run_job, monkeypatch, capsys, name):
    error = np.linalg.LinAlgError("SVD did not converge")
    monkeypatch.setattr(
        job_of_recordings, name, fail_on_bad(getattr(job_of_recordings, name), error)
    )
    table, folder = run_job()
    by_name = table.groupby("recording")["verdict"].first()
    assert by_name["bad"] == "refused" != by_name["good"]
    reason = f"it failed numerically ({type(error).__name__}: {error})."
    assert table.set_index("recording").loc["bad", "reasons"] == reason
    assert f"bad refused: {reason}" in capsys.readouterr().err
    assert {path.name for path in folder.iterdir()} == {
        "good",
        "good.html",
        "bad.html",
        "table.parquet",
    }
    assert str(error) in (folder / "bad.html").read_text(encoding="utf-8")
    assert pd.notna(table.set_index("recording").loc["good", "K"])
    assert (table["subject"] == "007").all()


@pytest.mark.usefixtures("no_pages")
@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere processes cannot be forked safely")
def test_a_killed_process_stops_the_job(run_job, monkeypatch):
    """As where memory was short: that is no result, and says nothing of the recording."""
    monkeypatch.setattr(
        job_of_recordings, "analyse", fail_on_bad(job_of_recordings.analyse, signal.SIGKILL)
    )
    message = r"recording bad, .*bad\.nc: the process of the analysis was killed"
    with pytest.raises(SystemExit, match=message):
        run_job("good", "bad", "after")


@pytest.mark.usefixtures("no_pages")
def test_mistakes_in_the_program_stop_the_job(run_job, monkeypatch):
    change = fail_on_bad(job_of_recordings.analyse, TypeError("no such option"))
    monkeypatch.setattr(job_of_recordings, "analyse", change)
    message = r"rule recordings, study laboratory, chunk 0; recording bad, .*bad\.nc: TypeError: no such option"
    message += r" \(The log"
    with pytest.raises(SystemExit, match=message):
        run_job()


@pytest.mark.usefixtures("no_pages")
def test_rows_of_a_batch_are_one_recording_each_with_its_onsets(tmp_path):
    onsets = [np.arange(0.1, 14.0, 1.2), np.arange(0.5, 14.0, 1.3)]
    lines = ["batch,file,cycle_onsets"]
    for seed, times in enumerate(onsets):
        save_trial(simulate(seed=seed, duration=14.0), tmp_path / f"{seed}.nc")
        lines.append(f"walk,{seed}.nc,{' '.join(map(str, times))}")
    (tmp_path / "table.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    methods = {name: {"method": name} for name in ("riv", "riv-tv")}
    pages = tmp_path / "pages"
    run_recordings_job(
        pages, folder=str(tmp_path), table=str(tmp_path / "table.csv"), methods=methods
    )
    table = pd.read_parquet(pages / "table.parquet")
    assert table["K"].to_numpy() == pytest.approx(150.0, rel=0.15)
    estimate = load_estimate(pages / "walk" / "riv-tv.nc")
    whole = [np.sum((times > 1.13) & (times < 12.87)) - 1 for times in onsets]
    assert estimate.diagnostics["cycles"] == sum(whole)
    assert np.unique(estimate.torque["trial"]).tolist() == [1, 2]
