"""The wheel and the source distribution: what is in them, and how the wheel works with nothing but what it requires."""

import os
import shutil
import subprocess
import sys
import zipfile
from importlib.metadata import distribution
from pathlib import Path

import pandas as pd
import pytest
from packaging.requirements import Requirement

import ankleloop
from ankleloop import simulate
from ankleloop.trials.recording_files import FILE_FORMATS, write_recording

ROOT = Path(__file__).parents[2]
BUILD = (
    "import sys; from flit_core import buildapi; print(getattr(buildapi, sys.argv[1])(sys.argv[2]))"
)
WORKFLOW = ("snakemake", "papermill", "nbconvert", "IPython", "pytest")
IMPORT_ALL = f"""
import importlib, importlib.util, pkgutil
import ankleloop
for module in pkgutil.walk_packages(ankleloop.__path__, "ankleloop."):
    if not module.name.startswith(("ankleloop.exploration", "ankleloop.pages.study_page")):  # they need notebooks
        importlib.import_module(module.name)
print(ankleloop.__file__)
print([name for name in {WORKFLOW!r} if importlib.util.find_spec(name)])
"""


def build(kind, folder, source=ROOT):
    """Build a "wheel" or an "sdist" from a source tree; its path."""
    command = [sys.executable, "-c", BUILD, f"build_{kind}", str(folder)]
    process = subprocess.run(command, cwd=source, capture_output=True, text=True, check=True)
    return folder / process.stdout.split()[-1]


def list_requirements(name):
    """Distributions that one requires without its extras, and those that these require; itself is not among them."""
    names, pending = set(), [name]
    while pending:
        texts = distribution(pending.pop()).requires or ()
        required = [
            item
            for item in map(Requirement, texts)
            if not item.marker or item.marker.evaluate({"extra": ""})
        ]
        pending += [item.name for item in required if item.name not in names]
        names |= {item.name for item in required}
    return names


def make_environment(folder, wheel):
    """An environment with a wheel and the distributions that it requires, those of this environment, and no others."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True)
    python = folder / "bin" / "python"
    packages = Path(
        run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))").strip()
    )
    for name in list_requirements("ankleloop"):
        installed = distribution(name)
        for part in {
            file.parts[0]
            for file in installed.files or ()
            if file.parts[0] not in ("..", "__pycache__")
        }:
            target = packages / part
            if not target.exists():
                target.symlink_to(installed.locate_file(part))
    install = [
        "-m",
        "pip",
        "--python",
        str(python),
        "install",
        "--quiet",
        "--no-deps",
        "--no-index",
        str(wheel),
    ]
    subprocess.run([sys.executable, *install], check=True)
    return folder / "bin"


def run(program, *arguments, folder=None, check=True):
    """Run a program of an environment, which sees no other path; its output."""
    hidden = ("PYTHON", "VIRTUAL_ENV", "ANKLELOOP", "NUMBA")
    variables = {name: value for name, value in os.environ.items() if not name.startswith(hidden)}
    process = subprocess.run(
        [str(program), *map(str, arguments)],
        cwd=folder,
        env=variables,
        capture_output=True,
        text=True,
    )
    assert not check or process.returncode == 0, process.stdout + process.stderr
    return process.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    return build("wheel", tmp_path_factory.mktemp("wheel"))


def test_the_wheel_has_every_file_of_the_library(wheel):
    """Templates and data as well as modules."""
    source = ROOT / "src"
    files = [
        path for path in source.rglob("*") if path.is_file() and "__pycache__" not in path.parts
    ]
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
        scripts = archive.read(
            f"ankleloop-{ankleloop.__version__}.dist-info/entry_points.txt"
        ).decode()
    assert names == {path.relative_to(source).as_posix() for path in files}
    assert "ankleloop=ankleloop.command_line.main:main" in scripts.replace(" ", "")


def test_the_source_distribution_gives_the_same_wheel(wheel, tmp_path):
    sdist = build("sdist", tmp_path)
    shutil.unpack_archive(sdist, tmp_path, filter="data")
    again = build("wheel", tmp_path, tmp_path / sdist.name.removesuffix(".tar.gz"))
    with zipfile.ZipFile(wheel) as first, zipfile.ZipFile(again) as second:
        assert {i.filename: i.CRC for i in first.infolist()} == {
            i.filename: i.CRC for i in second.infolist()
        }


@pytest.fixture(scope="module")
def programs(tmp_path_factory, wheel):
    return make_environment(tmp_path_factory.mktemp("package") / "environment", wheel)


def test_the_library_imports_without_the_workflow(programs, tmp_path):
    file, others = run(programs / "python", "-c", IMPORT_ALL, folder=tmp_path).splitlines()
    assert Path(file).is_relative_to(programs.parent)
    assert others == "[]"
    assert (
        run(programs / "ankleloop", "--version", folder=tmp_path).strip()
        == f"ankleloop {ankleloop.__version__}"
    )


def test_the_demonstration(programs, tmp_path):
    text = run(programs / "ankleloop", "demo", "--no-open", "--duration", "20", folder=tmp_path)
    assert "take Refined instrumental variables" in text
    page = (tmp_path / "ankleloop-demo" / "results" / "demo-csv.html").read_text(encoding="utf-8")
    assert "<svg" in page or "data:image" in page


@pytest.mark.parametrize("kind", FILE_FORMATS)
def test_every_file_format(programs, tmp_path, kind):
    path = tmp_path / f"S1{FILE_FORMATS[kind]}"
    write_recording(simulate(seed=2, duration=20.0), path, kind)
    run(programs / "ankleloop", "identify", path.name, "--method", "riv", folder=tmp_path)
    results = tmp_path / f"{path.name}-results"
    assert {"riv.nc", "riv.mat", "riv.csv", "figure-torques.csv"} <= {
        file.name for file in (results / "S1").iterdir()
    }
    code = "import ankleloop, sys; print(ankleloop.load_estimate(sys.argv[1]).stiffness['K'])"
    run(programs / "ankleloop", "study", "new.yaml", path.name, folder=tmp_path)
    assert "torque: torque" in (tmp_path / "new.yaml").read_text(encoding="utf-8")
    stiffness = float(
        run(programs / "python", "-c", code, results / "S1" / "riv.nc", folder=tmp_path)
    )
    assert stiffness == pytest.approx(150.0, rel=0.1)


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
