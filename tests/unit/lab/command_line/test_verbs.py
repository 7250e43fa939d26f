"""`check`, `identify`, `plan`, `study` and `demo` with real files."""

import json
import logging
import os
import re
import shlex
import signal
import subprocess
import sys
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pandas as pd
import pytest
import yaml
from scipy.io import savemat
from study_jobs import run_recordings_job

from ankleloop import identify, load_estimate, plan_duration, save_trial, simulate
from ankleloop.methods.registry import METHODS
from ankleloop.trials.files import write_csv
from ankleloop_lab.command_line import analysis
from ankleloop_lab.command_line.analysis import identify_recordings, plan_analysis
from ankleloop_lab.command_line.main import DATA, MISTAKE, SOME, main
from ankleloop_lab.command_line.reading import map_file
from ankleloop_lab.command_line.terminal import show_progress
from ankleloop_lab.files.demo_files import write_recording
from ankleloop_lab.recordings.validity import usual_methods
from ankleloop_workflow.config.files import check_config_file
from ankleloop_workflow.config.run import read_run

sys.path.append(str(Path(__file__).parents[4] / "benchmarks"))
from windows import Ensemble, simulate_record

pytestmark = pytest.mark.usefixtures("coarse_pictures")


def turned(trial, path, *names):
    """The trial with some channels turned round, by default its torque, as a file."""
    names = names or ("torque",)
    write_recording(trial.assign({name: -trial[name] for name in names}), path, "hdf5")
    return path


def contents(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


# --- check


def test_check(run, recording):
    result = run("check", recording)
    assert result.status == 0
    lines = result.out.splitlines()
    assert lines[0] == "S1 (pre).csv"
    assert (
        "  position  angle_deg, in deg (stated by the file; 1 deg = 0.0174533 rad), sign +1"
        in lines
    )
    assert re.search(r"^      ok  loop: closed", result.out, re.MULTILINE)
    assert f'next: ankleloop identify "{recording}"' in result.err


@pytest.mark.parametrize(
    ("channels", "signs", "corrected"),
    [
        (["torque"], [], ["--torque-sign", "-1"]),
        (["position", "reference"], [], ["--torque-sign", "-1"]),
        ([], ["--torque-sign", "-1"], ["--torque-sign", "1"]),
        ([], ["--position-sign", "-1"], ["--position-sign", "-1", "--torque-sign", "-1"]),
    ],
)
def test_check_corrects_the_sign_of_the_torque(run, trial, tmp_path, channels, signs, corrected):
    path = turned(trial, tmp_path / "a.h5", *channels) if channels else tmp_path / "a.h5"
    if not channels:
        write_recording(trial, path, "hdf5")
    result = run("check", path, *signs)
    assert result.status == 1
    command = ["ankleloop", "check", str(path), *corrected]
    assert f"next: {shlex.join(command)}\n" in result.err
    assert run(*command[1:]).status == 0


def test_bundle_for_a_report(run, recording, tmp_path):
    bundle = tmp_path / "report.zip"
    result = run("check", recording, "--bundle", bundle)
    assert result.status == 0
    assert "--bundle" not in result.err  # not in the next command either
    with ZipFile(bundle) as archive:
        (name,) = archive.namelist()
        report = json.loads(archive.read(name))
    assert report["command"] == ["check", str(recording), "--bundle", str(bundle)]
    described = report[recording.name]
    assert described["options"]["position_unit"] == "deg"
    assert described["read"]["torque"]["count"] == 20_000
    assert {finding["verdict"] for finding in described["findings"]} >= {"ok"}
    assert report["versions"]["packages"]["numpy"] == np.__version__


def test_bundle_of_a_file_that_cannot_be_read(run, tmp_path):
    file = tmp_path / "S3.mat"
    file.write_bytes(b"MATLAB 5.0" + bytes(300))
    result = run("check", file, "--bundle", tmp_path / "report.zip", "--bundle-samples")
    assert result.status == 1
    with ZipFile(tmp_path / "report.zip") as archive:
        assert archive.read(file.name) == file.read_bytes()
        report = json.loads(archive.read("report.json"))
    assert "DataError: S3.mat: not a readable .mat file" in report["error"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--bundle", __file__], "is no new file whose name ends in .zip."),
        (["--bundle", "report.txt"], "report.txt is no new file whose name ends in .zip."),
        (["--bundle-samples"], "--bundle-samples needs --bundle NEW.zip."),
    ],
)
def test_wrong_bundles(run, recording, arguments, message):
    result = run("check", recording, *arguments)
    assert result.status == 2
    assert message in " ".join(result.err.split())


# --- plan


def test_plan(run, recording, trial):
    result = run("plan", recording, "--width", "K=5%", "--width", "G=0.5")
    assert result.status == 0
    expected = plan_duration(identify(trial, "riv"), {"K": 0.05, "G": 0.5})
    assert f"Record {expected.seconds:.0f} s (" in result.out
    assert result.out.endswith("K decides.\n")
    assert f"\nK within ±5 %: {expected.needed['K']:.0f} s\n" in result.out
    assert result.err.endswith("next: ankleloop check RECORDING\n")


def test_plan_ends_with_the_check_of_the_recording(run, recording):
    """With the options that apply to it, too, but not those for the part of the pilot's file."""
    options = ["--position-unit", "deg", "--sampling-rate", "1000", "--start", "1", "--drift", "0"]
    result = run("plan", recording, "--width", "K=200%", *options)
    assert result.status == 0
    assert result.out.endswith(
        "Record 10 s (10 … 10 s): a check of the recording refuses a shorter one.\n"
    )
    command = "ankleloop check RECORDING --position-unit deg --sampling-rate 1000.0 --drift 0"
    assert result.err.endswith(f"next: {command}\n")
    result = run("plan", recording, "--width", "K=200%", "--no-reference")
    assert result.err.endswith("next: ankleloop check RECORDING --no-reference\n")


def test_plan_refuses_what_it_cannot_plan(run, recording, trial, tmp_path):
    result = run("plan", recording, "--width", "K=0.01%")
    assert result.status == 1
    assert "K within 0.01 % would take" in result.err
    assert "such as K=5%" in run("plan", recording, "--width", "K").err
    assert run("plan", recording, "--width", "K=5000%").status == 2
    result = run("plan", turned(trial, tmp_path / "turned.h5"), "--width", "K=5%")
    assert result.status == 1
    assert "--torque-sign" in result.err


# --- identify


def words_of(page):
    """Words that a page shows, without its links to other pages."""
    text = re.sub(r"(?s)<(script|style|nav)\b.*?</\1>", " ", page.decode())
    return re.sub(r"<[^>]+>", " ", text).split()


def test_identify_makes_what_the_workflow_makes(run, recording, tmp_path):
    result = run("identify", recording, "--method", "pr-moesp", "--subject", "007")
    assert result.status == 0, result.err
    reading = {"file": recording.name, "subject": "007", "reference": "command_deg"}
    methods = {"pr-moesp": usual_methods(reference=True)["pr-moesp"]}
    workflow = tmp_path / "workflow"
    run_recordings_job(workflow, folder=str(tmp_path), files={"S1-pre": reading}, methods=methods)
    write_csv(pd.read_parquet(workflow / "table.parquet"), workflow / "S1-pre-parameters.csv")
    (workflow / "table.parquet").unlink()
    folder = tmp_path / "S1 (pre).csv-results"
    outputs, expected = contents(folder), contents(workflow)
    names = {f"S1-pre/pr-moesp{suffix}" for suffix in (".nc", ".mat", ".csv")}
    names |= {f"S1-pre/figure-{kind}.csv" for kind in ("spectra", "torques", "models", "residuals")}
    assert set(outputs) == set(expected) == names | {"S1-pre.html", "S1-pre-parameters.csv"}
    for name in ("S1-pre/pr-moesp.nc", "S1-pre/pr-moesp.csv", "S1-pre-parameters.csv"):
        assert outputs[name] == expected[name], name
    # The header of a MATLAB file has the time at which it was made.
    assert outputs["S1-pre/pr-moesp.mat"][128:] == expected["S1-pre/pr-moesp.mat"][128:]
    assert words_of(outputs["S1-pre.html"]) == words_of(expected["S1-pre.html"])
    assert len(words_of(outputs["S1-pre.html"])) > 300
    estimate = load_estimate(folder / "S1-pre" / "pr-moesp.nc")
    assert f"{estimate.stiffness['K']:.4g}" in result.out
    assert "take PR-MOESP" in result.out

    # Results are replaced only where it is asked for, and nothing that somebody else put there is touched.
    (folder / "S1-pre" / "notes.txt").write_text("of the user")
    before = contents(tmp_path)
    result = run("identify", recording, "--method", "parallel-cascade")
    assert result.status == 2
    assert "exists already" in result.err
    assert result.err.endswith("--method parallel-cascade --overwrite\n")
    assert contents(tmp_path) == before
    result = run("identify", recording, "--method", "parallel-cascade", "--overwrite")
    assert result.status == 1  # the parallel cascade does not hold in closed loop
    assert "no method is valid for it" in result.out
    assert set(contents(folder)) == {"S1-pre.html", "S1-pre-parameters.csv", "S1-pre/notes.txt"}


def test_identify_refuses(run, trial, tmp_path):
    result = run("identify", turned(trial, tmp_path / "a.h5"))
    assert result.status == 1
    assert "refused: Nothing can be concluded from this recording: it was refused." in result.out
    assert set(contents(tmp_path / "a.h5-results")) == {"a.html", "a-parameters.csv"}
    assert "the torque has the other sign" in (tmp_path / "a.h5-results" / "a.html").read_text(
        encoding="utf-8"
    )
    command = re.search(r"^next: ankleloop (identify .*)$", result.err, re.MULTILINE)[1]
    assert command == f"identify {tmp_path / 'a.h5'} --torque-sign -1"
    result = run(
        *command.split(), "--method", "pr-moesp"
    )  # the page of the refusal is no result that is kept
    assert result.status == 0, result.err
    assert "take PR-MOESP" in result.out


@pytest.mark.usefixtures("no_pages")
def test_of_two_commands_with_the_same_results_one_is_refused(
    run, recording, tmp_path, monkeypatch
):
    """The second begins while the first is at work: nothing of the first is lost, and nothing is left of a claim."""
    options = ("--method", "pr-moesp", "--output", tmp_path / "results")
    second = []

    def identify_twice(studies, folder, jobs):
        second.append(run("identify", recording, *options, "--overwrite"))
        return identify_recordings(studies, folder, jobs)

    monkeypatch.setattr(analysis, "identify_recordings", identify_twice)
    assert run("identify", recording, *options).status == 0
    assert second[0].status == 2
    assert "another command is writing its results" in second[0].err
    assert "S1-pre.html" in contents(tmp_path / "results")
    assert not (tmp_path / "results" / ".ankleloop").exists()


def test_identify_keeps_options_that_a_file_refuses(run, recording, tmp_path):
    result = run("identify", recording, "--case", "1")
    assert result.status == 1
    assert "case chooses a trial of an .flb file: leave it out" in result.out
    assert set(contents(recording.with_name(f"{recording.name}-results"))) == {
        "S1-pre.html",
        "S1-pre-parameters.csv",
    }


@pytest.mark.usefixtures("no_pages")
def test_identify_several_files(run, trial, tmp_path):
    """One table and one figure; a file that is refused stops no other, and its own correction is ready to copy."""
    write_recording(trial, tmp_path / "S1.mat", "matlab-5")
    turned(trial, tmp_path / "S2.h5")
    (tmp_path / "S3.mat").write_bytes(b"MATLAB 5.0" + bytes(300))
    files = sorted(tmp_path.iterdir())
    options = ("--method", "pr-moesp", "--option", "order=3", "--output", tmp_path / "results")
    result = run("identify", *files, *options)
    assert result.status == SOME
    table = pd.read_csv(tmp_path / "results" / "recordings.csv").set_index("recording")
    assert list(table["verdict"] == "refused") == [False, True, True]
    assert (tmp_path / "results" / "recordings-figure.png").stat().st_size > 1_000
    page = (tmp_path / "results" / "index.html").read_text(encoding="utf-8")
    assert "1 of 3 recordings have a recommended method." in page
    assert '<a href="S1.html">S1</a>' in page
    assert '<a href="S3.html">S3</a>:</b> S3.mat: not a readable .mat file' in page
    assert f"recording 2 of 3: S2 ({tmp_path / 'S2.h5'})\n" in result.err
    (summary,) = [line for line in result.out.splitlines() if "PR-MOESP" in line]
    assert summary.split()[:3] == ["S1", "closed", "PR-MOESP"]
    assert "no recommendation: S2, S3" in result.out
    estimate = load_estimate(tmp_path / "results" / "S1" / "pr-moesp.nc")
    assert estimate.diagnostics["order"] == 3
    assert table.loc["S1", "K"] == pytest.approx(estimate.stiffness["K"])
    assert "S3.mat: not a readable .mat file" in table.loc["S3", "reasons"]
    command = f"next: ankleloop identify {tmp_path / 'S2.h5'} --method pr-moesp --option order=3 --output "
    assert f"{command}{tmp_path / 'results'} --torque-sign -1\n" in result.err
    # Nothing is replaced unasked, and nothing is identified before all results that exist are found.
    write_recording(trial, tmp_path / "S0.mat", "matlab-5")
    before = contents(tmp_path)
    result = run("identify", tmp_path / "S0.mat", *files, *options)
    assert result.status == 2
    assert contents(tmp_path) == before


@pytest.mark.usefixtures("no_pages")
def test_identify_answers_how_conditions_differ(run, tmp_path):
    """Labels come from the names of the files, and the last line of the output is the answer."""
    for seed, (subject, condition) in enumerate(product("AB", ("10MVC", "rest"))):
        trial = simulate(
            seed=seed, duration=20.0, stiffness=150.0 if condition == "10MVC" else 110.0
        )
        write_recording(trial, tmp_path / f"{subject}_{condition}.mat", "matlab-5")
    files = sorted(tmp_path.glob("*.mat"))
    options = ["--method", "riv", "--output", tmp_path / "results", "--jobs", "2"]
    names = "{subject}_{condition}"
    suggested = run("identify", *files[::3], *options)
    assert f"--names '{names}', which the names of the files suggest" in suggested.err
    assert not (tmp_path / "results" / "comparison.csv").exists()
    result = run("identify", *files, *options, "--names", names, "--overwrite")
    assert result.status == 0, result.err
    table = pd.read_csv(tmp_path / "results" / "recordings.csv")
    assert table[["subject", "condition"]].values.tolist() == [
        [subject, condition] for subject in "AB" for condition in ("10MVC", "rest")
    ]
    differences = pd.read_csv(tmp_path / "results" / "comparison.csv").query("kind == 'difference'")
    value = differences.set_index("parameter").loc["K", "value"]
    assert 30.0 < value < 50.0
    answer = result.out.splitlines()[-1]
    assert f"{value:.4g} (" in answer
    assert "from rest to 10MVC" in answer
    assert answer.endswith("(2 subjects, paired 95 % intervals).")
    page = (tmp_path / "results" / "index.html").read_text(encoding="utf-8")
    assert page.index(f">{answer}<") < page.index("<img")
    assert result.out.count("  position  ") == 1  # files that are read alike are shown once
    assert {"mean_torque", "mean_position"} <= set(table)
    assert (tmp_path / "results" / "comparison-figure.png").stat().st_size > 1_000


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ("{subject}_{condition}", "--names: "),
        (
            "{load}",
            "--names: 'load' is no label of a recording; these are subject, condition, trial, session.",
        ),
    ],
)
def test_wrong_names(run, recording, tmp_path, names, message):
    result = run("identify", recording, "--names", names)
    assert result.status == 2
    assert message in result.err
    assert run("study", tmp_path / "new.yaml", recording, "--names", names).status == 2


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--option", "order"], "--option order: write it as NAME=VALUE or METHOD.NAME=VALUE."),
        (
            ["--option", "riv.rder=3"],
            "--option riv.rder: none of the methods riv, ",
        ),
        (
            ["--method", "rvi"],
            "--method: unknown method 'rvi' (did you mean 'riv'?); known: riv, ",
        ),
        (
            ["--method", "real-time"],
            "'real-time' is not offered here; methods are riv, ",
        ),
        (
            ["--option", "riv.basis=spline", "--option", "riv.degree=3"],
            "riv → options: degree: a spline basis needs a degree of at least 4, got 3.",
        ),
    ],
)
def test_options_of_methods_that_are_wrong(run, recording, arguments, words):
    result = run("identify", recording, *arguments)
    assert result.status == 2
    assert words in " ".join(result.err.split())


def test_riv_is_that_of_the_library_and_may_have_splines(recording):
    """One file has one result of riv, by the command and by the library."""
    reading = map_file(recording)
    study = plan_analysis("S1", recording, reading, ("riv",), {})
    method = study.methods["riv"]
    own = METHODS["riv"].options().model_dump(exclude={"identification_rate"})
    assert method["options"] == own
    assert method["select"] == {}
    splines = plan_analysis("S1", recording, reading, ("riv",), {"riv.basis": "spline"})
    assert splines.methods["riv"]["options"] == {**method["options"], "basis": "spline"}
    everywhere = plan_analysis("S1", recording, reading, (), {"basis": "spline"}).methods
    bases = {name: method["options"]["basis"] for name, method in everywhere.items()}
    assert bases.pop("parallel-cascade") is None  # it has the rectifier alone
    assert set(bases.values()) == {"spline"}


def test_the_delay_is_given_or_estimated(recording):
    reading = map_file(recording)
    options = {
        delay: plan_analysis(
            "S1", recording, reading, ("riv", "pr-moesp"), {"delay": delay}
        ).methods
        for delay in (0.05, None)
    }
    given = {name: method["options"]["delay"] for name, method in options[0.05].items()}
    assert given == {"riv": 0.05, "pr-moesp": 0.05}
    estimated = {name: method["options"]["delay"] for name, method in options[None].items()}
    assert estimated == {"riv": None, "pr-moesp": 0.04}


@pytest.mark.posix
def test_progress_of_another_process(capfd):
    """The analysis runs in a fork: its log shows which method is being fitted."""
    log = logging.getLogger("ankleloop_lab.recordings.analysis")
    with show_progress():
        process = get_context("fork").Process(
            target=log.info, args=("method %d of %d: %s", 1, 2, "riv")
        )
        process.start()
        process.join()
        logging.getLogger("ankleloop.joint").info("nothing for the user")
    assert re.fullmatch(r"method 1 of 2: riv\n", capfd.readouterr().err)
    assert not log.handlers


def test_what_packages_log_is_not_shown(capfd):
    """It is for the files of the workflow; a logger without a handler would write to the terminal."""
    assert main(["--version"]) == 0
    for package in ("ankleloop", "ankleloop_lab", "ankleloop_workflow"):
        logging.getLogger(f"{package}.module").warning("for the log of a job")
    assert "for the log" not in capfd.readouterr().err


def test_a_joint_that_changes(run, tmp_path):
    """The phase of the cycle is a further variable of the file; riv-tv is fitted, and written into a study."""
    save_trial(
        simulate(seed=1, duration=40.0, variation="cycle", stiffness_variation=0.4),
        tmp_path / "a.nc",
    )
    cycles = ("--variables", "gait=phase", "--cycle-onsets", "gait")
    result = run("identify", tmp_path / "a.nc", *cycles, "--method", "riv", "--method", "riv-tv")
    assert result.status == 0, result.err
    assert "its test says that K, B or G change" in " ".join(result.out.split())
    assert (tmp_path / "a.nc-results" / "a" / "figure-trajectories.csv").exists()
    assert run("study", tmp_path / "mine.yaml", tmp_path / "a.nc", *cycles).status == 0
    study = yaml.safe_load((tmp_path / "mine.yaml").read_text(encoding="utf-8"))["studies"]["mine"]
    assert study["files"]["a"]["cycle_onsets"] == "gait"
    assert study["methods"]["riv-tv"]["method"] == "riv-tv"


# --- study


def test_study_of_recordings(run, trial, recording, tmp_path):
    turned(trial, tmp_path / "S2.h5")
    new = tmp_path / "new.yaml"
    result = run("study", new, recording, tmp_path / "S2.h5", "--subject", "012")
    assert result.status == 0, result.err
    assert f"snakemake --cores 2 --configfile {new}" in result.err
    check_config_file(new)
    text = new.read_text(encoding="utf-8")
    study = read_run(yaml.safe_load(text), [new])[1]["new"]
    first, second = study.points["S1-pre"], study.points["S2"]
    assert (first["file"], first["position"], first["position_unit"]) == (
        "S1 (pre).csv",
        "angle_deg",
        "deg",
    )
    assert (first["torque_sign"], second["torque_sign"]) == (1, -1)
    assert first["subject"] == second["subject"] == "012"
    assert (
        "# S2: torque_sign is -1: as the file has it, the torque does not oppose stretch." in text
    )
    assert "# S1-pre: warning, length: " in text
    assert study.points["S2"]["paths"] == [str(tmp_path / "S2.h5")]
    before = new.read_bytes()
    assert run("study", new, recording).status == 2
    assert new.read_bytes() == before
    assert run("study", new, recording, "--overwrite").status == 0
    assert new.read_bytes() != before


def test_study_leaves_out_what_it_cannot_read(run, trial, tmp_path):
    """What all files have alike is written once."""
    files = []
    for name in ("S1", "S2", "S3"):
        files.append(tmp_path / f"{name}.mat")
        write_recording(trial, files[-1], "matlab-5")
    files[2].write_bytes(files[2].read_bytes()[:3000])
    new = tmp_path / "new.yaml"
    result = run("study", new, *files)
    assert result.status == SOME
    text = new.read_text(encoding="utf-8")
    assert "# S3 is left out: S3.mat: not a readable .mat file" in text
    study = yaml.safe_load(text)["studies"]["new"]
    assert study["files"] == {"S1": {"file": "S1.mat"}, "S2": {"file": "S2.mat"}}
    assert study["defaults"]["position_unit"] in ("rad", "deg")
    assert run("study", tmp_path / "none.yaml", files[2]).status == DATA
    assert not (tmp_path / "none.yaml").exists()


def test_study_takes_labels_from_names(run, trial, tmp_path):
    """Without `--names` comments have what the names suggest."""
    files = [tmp_path / f"S1_{condition}.h5" for condition in ("rest", "10MVC")]
    files.append(tmp_path / "S2_rest.h5")
    for file in files:
        write_recording(trial, file, "hdf5")
    new = tmp_path / "new.yaml"
    assert run("study", new, *files).status == 0
    text = new.read_text(encoding="utf-8")
    assert "which --names '{subject}_{condition}' would write:\n" in text
    assert "# S1_10MVC.h5: {'subject': 'S1', 'condition': '10MVC'}\n" in text
    named = ["--names", "{subject}_{condition}", "--overwrite"]
    assert run("study", new, *files, *named).status == 0
    text = new.read_text(encoding="utf-8")
    assert "suggest" not in text
    described = yaml.safe_load(text)["studies"]["new"]["files"]
    labels = [(part["subject"], part["condition"]) for part in described.values()]
    assert labels == [("S1", "rest"), ("S1", "10MVC"), ("S2", "rest")]


def test_study_of_recordings_with_and_without_a_reference(run, trial, tmp_path):
    (tmp_path / "$x").mkdir()
    write_recording(trial, tmp_path / "$x" / "a.h5", "hdf5")
    write_recording(trial.drop_vars("reference"), tmp_path / "a.mat", "matlab-5")
    new = tmp_path / "new.yaml"
    assert run("study", new, tmp_path / "$x" / "a.h5", tmp_path / "a.mat").status == 0
    study = read_run(yaml.safe_load(new.read_text(encoding="utf-8")), [new])[1]["new"]
    assert study.points["a"]["paths"] == [str(tmp_path / "$x" / "a.h5")]
    assert study.points["a-mat"]["paths"] == [str(tmp_path / "a.mat")]
    names = ["riv", "pr-moesp", "pi-moesp", "parallel-cascade"]
    assert set(study.methods) == {*names, *(f"{key}-no-reference" for key in names[:3])}


def test_a_full_disk_leaves_the_results_of_an_earlier_run(run, recording, tmp_path, monkeypatch):
    """A lack of space in the folder of temporary files is no verdict on the recording."""
    folder = tmp_path / "results"
    (folder / "S1-pre").mkdir(parents=True)
    for name in ("S1-pre.html", "S1-pre/riv.csv"):
        (folder / name).write_text("earlier")

    def fail(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("ankleloop_lab.recordings.files.export_estimate", fail)
    result = run("identify", recording, "--output", folder, "--overwrite", "--method", "riv")
    assert result.status == MISTAKE
    assert "No space left on device" in result.err
    assert "mistake in ankleloop" not in result.err
    assert [(folder / name).read_text() for name in ("S1-pre.html", "S1-pre/riv.csv")] == [
        "earlier"
    ] * 2


@pytest.mark.posix
def test_a_program_that_is_ended_leaves_no_temporary_folder(recording, tmp_path):
    program = """
import sys, time
import ankleloop_lab.results as job
from ankleloop_lab.command_line.main import main
def wait(*_):
    print("ready", file=sys.stderr, flush=True)
    time.sleep(300)
job.analyse = wait
main(["identify", sys.argv[1], "--output", sys.argv[2]])
"""
    command = [sys.executable, "-c", program, str(recording), str(tmp_path / "results")]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        assert any(line == "ready\n" for line in process.stderr)
        assert os.listdir(tmp_path / "results")
        process.terminate()
        assert process.wait(20) == 128 + signal.SIGTERM
    assert os.listdir(tmp_path / "results") == []


# --- demo


def test_demo(run, tmp_path, monkeypatch):
    """All but the methods, each of which tests/nightly/test_package.py fits in an environment of its own."""
    opened = []

    def analyse(analyses, folder, jobs):
        (analysis,) = analyses
        assert analysis.mapping["paths"] == [str(tmp_path / "demo" / "demo-csv.csv")]
        assert analysis.mapping["position_unit"] == "deg"
        row = {"recording": "demo-csv", "verdict": "ok", "recommendation": "take riv."}
        row |= {"label": "riv", "valid": True, "trusted": True, "recommended": True}
        row |= {"remarks": "", "K": 151.0, "K_low": 148.0, "K_high": 154.0}
        table = pd.DataFrame([row])
        table.attrs["remedy"] = {}
        write_csv(table, folder.parent / "demo-csv-parameters.csv", overwrite=True)
        return [table]

    monkeypatch.setattr("webbrowser.open", lambda address: opened.append(address) or True)
    monkeypatch.setattr("ankleloop_lab.command_line.analysis.identify_recordings", analyse)
    folder = tmp_path / "demo"
    result = run("demo", "--output", folder, "--duration", "20")
    assert result.status == 0, result.err
    assert opened == [(folder / "results" / "demo-csv.html").as_uri()]
    names = {"demo-csv.csv", "demo-matlab-5.mat", "demo-hdf5.h5", "results"}
    assert {path.name for path in folder.iterdir()} == names
    assert "K [N·m/rad]: 151 (148 … 154), simulated 150\n" in result.out
    before = contents(folder)
    assert run("demo", "--output", folder, "--duration", "20").status == 2
    assert contents(folder) == before
    assert (
        run("demo", "--output", folder, "--duration", "20", "--overwrite", "--no-open").status == 0
    )
    assert len(opened) == 1


@pytest.mark.usefixtures("no_pages")
def test_what_is_remarked_is_said(run, tmp_path):
    """Of one file and of several."""
    trial = simulate(seed=1, recording_rate=2000.0, snr_db=20.0)
    late = np.roll(trial["torque"].to_numpy(), 1)
    write_recording(trial.assign(torque=("time", late)), tmp_path / "a.mat", "matlab-5")
    write_recording(trial, tmp_path / "b.mat", "matlab-5")
    effect = "the record shows one of: a torque recorded 0.56 ms after the position; a low-pass of"
    single = run("identify", tmp_path / "a.mat", "--method", "riv", "--output", tmp_path / "a")
    assert f"Remarked: {effect}" in single.out
    files = [tmp_path / "a.mat", tmp_path / "b.mat"]
    several = run("identify", *files, "--method", "riv", "--output", tmp_path / "both")
    assert f"a: {effect}" in several.out
    assert "b: the record shows" not in several.out


# --- ankleloop identify --method ensemble


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    """A record with ramps in half of the windows: onsets and conditions as times and numbers, and as channels."""
    trial, onsets, conditions = simulate_record(Ensemble(), 3, duration=150.0)
    kinds = np.array([float(name == "up") for name in conditions])
    channels = np.zeros((2, trial.sizes["time"]))
    for onset, kind in zip(onsets, kinds, strict=True):
        inside = slice(round(1000 * onset), round(1000 * onset) + 100)
        channels[:, inside] = [[5.0], [kind]]
    trial = trial.assign(
        {name: ("time", row) for name, row in zip(("trigger", "kind"), channels, strict=True)}
    )
    folder = tmp_path_factory.mktemp("walk")
    arrays = {name: variable.values for name, variable in trial.data_vars.items()}
    marks = {"onsets": onsets, "kinds": kinds, "short": kinds[:-1]}
    savemat(folder / "walk.mat", {**arrays, **marks, "fs": 1000.0})
    return folder / "walk.mat", identify(trial, "ensemble", onsets=onsets, condition=kinds)


@pytest.mark.parametrize(("onsets", "condition"), [("onsets", "kinds"), ("trigger", "kind")])
def test_identify_windows_of_a_recording(run, walk, tmp_path, onsets, condition):
    path, expected = walk
    words = ("--method", "ensemble", "--onsets", onsets, "--condition", condition)
    result = run("identify", path, *words, "--output", tmp_path)
    assert result.status == 0, result.err
    assert "conditions: 0 (" in result.out
    saved = load_estimate(tmp_path / "walk" / "ensemble.nc")
    assert saved == expected
    table = pd.read_csv(tmp_path / "recordings.csv")
    assert table["K"][0] == pytest.approx(expected["K"])
    assert (tmp_path / "walk" / "figure-conditions.png").stat().st_size > 0
    torques = pd.read_csv(tmp_path / "walk" / "ensemble.csv")
    np.testing.assert_allclose(torques["torque_net_nm"], expected.torque["net"])
    again = run("identify", path, *words, "--output", tmp_path)
    assert (again.status, "--overwrite" in again.err) == (2, True)


def test_windows_of_some_recordings(run, walk, trial, tmp_path):
    write_recording(trial, tmp_path / "whole.h5", "hdf5")  # which has no onsets
    words = ("--method", "ensemble", "--onsets", "onsets", "--condition", "kinds")
    files = (walk[0], tmp_path / "whole.h5")
    result = run("identify", *files, *words, "--output", tmp_path / "results")
    assert result.status == 3, result.err
    table = pd.read_csv(tmp_path / "results" / "recordings.csv").set_index("recording")
    assert table["K"].notna().to_dict() == {"walk": True, "whole": False}
    assert "onsets" in table.loc["whole", "refused"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--method ensemble", "needs --onsets and --condition"),
        ("--onsets onsets --condition kinds", "it alone takes windows"),
        ("--method ensemble --method riv --onsets onsets", "and these no other method"),
        ("--method ensemble --onsets onsets", "--onsets needs --condition"),
        ("--method ensemble --onsets onsets --condition short", "one condition for each onset"),
        ("--method ensemble --onsets press --condition kinds", "no variable 'press'"),
        ("--method ensemble --onsets onsets --condition kinds --option slop=1", "no option 'slop'"),
    ],
)
def test_windows_that_cannot_be_identified(run, walk, tmp_path, words, message):
    result = run("identify", walk[0], *words.split(), "--output", tmp_path / "results")
    assert result.status != 0
    assert message in result.out + result.err


# --- an apparatus


def test_an_apparatus_goes_through_all_verbs(run, trial, tmp_path, monkeypatch):
    """The empty device is identified by its method, and its file is an option of all verbs."""
    plate = {"stiffness": 0.0, "viscosity": 0.1, "inertia": 0.005, "reflex_gain": 0.0}
    write_recording(
        simulate(seed=3, duration=20.0, voluntary=0.0, **plate), tmp_path / "empty.h5", "hdf5"
    )
    write_recording(trial, tmp_path / "S1.h5", "hdf5")
    monkeypatch.chdir(tmp_path)
    result = run("identify", "empty.h5", "--method", "apparatus")
    assert result.status == 0
    saved = "empty.h5-results/empty/apparatus.nc"
    estimate = load_estimate(saved)
    assert estimate["I"] == pytest.approx(0.005, rel=0.05)
    given = ("--apparatus", saved)

    result = run("check", "S1.h5", *given)
    assert "riv, riv-tv; not pr-moesp" in result.out
    assert f"--apparatus {saved}" in result.err
    result = run("identify", "S1.h5", *given)
    assert result.status == 0
    limb = load_estimate("S1.h5-results/S1/riv.nc")
    assert limb["I"] == pytest.approx(identify(trial)["I"] - estimate["I"], rel=0.02)
    words = "less the apparatus of empty.h5: I 0.00"
    assert words in limb.apparatus
    assert words in (tmp_path / "S1.h5-results/S1.html").read_text()
    table = pd.read_csv("S1.h5-results/S1-parameters.csv").set_index("method")
    assert table.loc["riv", "apparatus"] == limb.diagnostics["apparatus"]["fingerprint"]
    assert not table.loc["pr-moesp", "valid"]
    result = run("plan", "S1.h5", "--width", "K=20%", *given)
    assert words in result.out
    result = run("study", "mine.yaml", "S1.h5", *given)
    assert result.status == 0
    config = yaml.safe_load((tmp_path / "mine.yaml").read_text(encoding="utf-8"))
    study = read_run(config, [])[1]["mine"]
    assert study.existing_paths(0) == [str(tmp_path / "S1.h5"), str(tmp_path / saved)]
    result = run("check", "S1.h5", "--apparatus", "nowhere.nc")
    assert "nowhere.nc: there is no such file" in result.out
