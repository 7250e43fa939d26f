"""The wheel in an environment with nothing but what it requires: a recording is identified there, from file to page."""

import os
from pathlib import Path

import pandas as pd
import pytest
from package_builds import build, make_environment, run

import ankleloop
from ankleloop import simulate
from ankleloop.trials.recording_files import FILE_FORMATS, write_recording

WORKFLOW = ("snakemake", "papermill", "nbconvert", "IPython", "pytest")
IMPORT_ALL = f"""
import importlib, importlib.util, pkgutil
import ankleloop
for module in pkgutil.walk_packages(ankleloop.__path__, "ankleloop."):
    importlib.import_module(module.name)
print(ankleloop.__file__)
print([name for name in {WORKFLOW!r} if importlib.util.find_spec(name)])
"""


@pytest.fixture(scope="module")
def programs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("package")
    return make_environment(folder / "environment", build("wheel", folder))


def test_the_library_imports_without_the_workflow(programs, tmp_path):
    file, others = run(programs / "python", "-c", IMPORT_ALL, folder=tmp_path).splitlines()
    assert Path(file).is_relative_to(programs.parent)
    assert others == "[]"
    assert run(programs / "ankleloop", "--version", folder=tmp_path).strip() == f"ankleloop {ankleloop.__version__}"


def test_the_demonstration(programs, tmp_path):
    text = run(programs / "ankleloop", "demo", "--no-open", "--duration", "20", folder=tmp_path)
    assert "take Refined instrumental variables" in text
    page = (tmp_path / "ankleloop-demo" / "results" / "demo-csv.html").read_text(encoding="utf-8")
    assert "<svg" in page or "data:image" in page


@pytest.mark.parametrize("kind", FILE_FORMATS)
def test_every_file_format(programs, tmp_path, kind):
    path = tmp_path / f"S1{FILE_FORMATS[kind][0]}"
    write_recording(simulate(seed=2, duration=20.0), path, kind)
    run(programs / "ankleloop", "identify", path.name, "--method", "riv", folder=tmp_path)
    results = tmp_path / f"{path.name}-results"
    assert {"riv.nc", "riv.mat", "riv.csv", "figure-torques.csv"} <= {file.name for file in (results / "S1").iterdir()}
    code = "import ankleloop, sys; print(ankleloop.load_estimate(sys.argv[1]).stiffness['K'])"
    stiffness = float(run(programs / "python", "-c", code, results / "S1" / "riv.nc", folder=tmp_path))
    assert stiffness == pytest.approx(150.0, rel=0.1)


def test_a_study_of_recordings_can_be_written(programs, tmp_path):
    write_recording(simulate(seed=2, duration=20.0), tmp_path / "S1.mat", "matlab-7.3")
    run(programs / "ankleloop", "study", "new.yaml", "S1.mat", folder=tmp_path)
    assert "position: position" in (tmp_path / "new.yaml").read_text(encoding="utf-8")


@pytest.mark.parametrize("file", ["ankle_pf.mat", "ankle_df.csv.gz", "ankle_df3.h5"])
def test_real_recordings(programs, tmp_path, file):
    folder = os.environ.get("ANKLELOOP_RECORDINGS")
    if not folder:
        pytest.skip("there are no real recordings: ANKLELOOP_RECORDINGS is not set")
    options = ("--torque-sign", "-1", "--output", tmp_path)
    text = run(programs / "ankleloop", "identify", f"{folder}/{file}", *options, folder=tmp_path)
    assert "If the loop was open: take" in text
    table = pd.read_csv(tmp_path / f"{file.partition('.')[0]}-parameters.csv")
    assert (table.loc[table["valid"], "K"] > 0).all()
    assert table["valid"].sum() >= 3
