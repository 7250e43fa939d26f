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
from ankleloop_lab.files.demo_files import FILE_FORMATS, write_recording

ROOT = Path(__file__).parents[2]
NOTEBOOKS = [path for path in (ROOT / "notebooks").iterdir() if path.is_file()]
# What the workflow and its pages need beside the library and the desk.
WORKFLOW = ("snakemake", "papermill", "nbconvert", "IPython", "pyarrow", "pytest")
LAB = ("click", "bokeh", "jinja2", "yaml", "matio")
IMPORT_ALL = """
import importlib, pkgutil, sys
for name in sys.argv[1:]:
    package = importlib.import_module(name)
    for module in pkgutil.walk_packages(package.__path__, f"{name}."):
        if not module.name.endswith(("c3d_files", "tdms_files")):  # of the extra `formats`
            importlib.import_module(module.name)
print(package.__file__)
"""
FIND = "import importlib.util, sys; print([name for name in sys.argv[1:] if importlib.util.find_spec(name)])"


def build(kind, folder, source=ROOT):
    """Build a "wheel" or an "sdist" from a source tree; its path."""
    command = [sys.executable, "-m", "hatchling", "build", "--target", kind, "--directory", folder]
    subprocess.run(command, cwd=source, capture_output=True, check=True)
    return next(folder.glob("*.whl" if kind == "wheel" else "*.tar.gz"))


def list_requirements(name, extra):
    """Distributions that one requires with an extra, and those that these require; itself is not among them."""
    names, pending = set(), [(name, extra)]
    while pending:
        owner, extra = pending.pop()
        texts = distribution(owner).requires or ()
        required = [
            item
            for item in map(Requirement, texts)
            if not item.marker or item.marker.evaluate({"extra": extra})
        ]
        pending += [(item.name, "") for item in required if item.name not in names]
        names |= {item.name for item in required}
    return names


def make_environment(folder, wheel, extra=""):
    """An environment with a wheel and the distributions that it requires, those of this environment, and no others."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True)
    python = folder / "bin" / "python"
    packages = Path(
        run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))").strip()
    )
    for name in list_requirements("ankleloop", extra):
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
    """Templates and data as well as modules, and the notebooks that `ankleloop study` knows."""
    source = ROOT / "src"
    files = [
        path for path in source.rglob("*") if path.is_file() and "__pycache__" not in path.parts
    ]
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
    notebooks = {f"ankleloop_workflow/notebooks/{path.name}" for path in NOTEBOOKS}
    assert names == {path.relative_to(source).as_posix() for path in files} | notebooks


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
    """An environment with the extra `lab`, as a laboratory installs it."""
    return make_environment(tmp_path_factory.mktemp("package") / "environment", wheel, "lab")


@pytest.fixture(scope="module")
def base(tmp_path_factory, wheel):
    """An environment without extras."""
    return make_environment(tmp_path_factory.mktemp("base") / "environment", wheel)


def test_library_and_desk_import_without_the_workflow(programs, tmp_path):
    python = programs / "python"
    packages = ("ankleloop", "ankleloop_lab")
    file = run(python, "-c", IMPORT_ALL, *packages, folder=tmp_path)
    assert Path(file.strip()).is_relative_to(programs.parent)
    assert run(python, "-c", FIND, *WORKFLOW, folder=tmp_path).strip() == "[]"
    version = run(programs / "ankleloop", "--version", folder=tmp_path).strip()
    assert version == f"ankleloop {ankleloop.__version__}"


# What a program has of the algorithms with nothing but what the library imports.
BASE = """
import ankleloop
assert ankleloop.__version__
trial = ankleloop.simulate(seed=1, duration=20.0)
for method, entry in ankleloop.METHODS.items():
    if not entry.takes_records:
        continue
    options = {"cycle_onsets": list(range(0, 20, 2))} if method == "riv-tv" else {}
    assert method in str(ankleloop.identify(trial, method, **options))
estimate = ankleloop.identify(trial)
estimate.plot(trial).savefig("estimate.png")
ankleloop.check_trial(trial)
for suffix in ("nc", "mat"):
    ankleloop.save_estimate(estimate, f"estimate.{suffix}")
    assert ankleloop.load_estimate(f"estimate.{suffix}") == estimate
ankleloop.save_trial(trial, "trial.nc")
assert ankleloop.load_trial("trial.nc").identical(trial)
for name in ("S1.csv", "S1.h5", "trial.nc"):
    read = ankleloop.read_trial(name)
    assert abs(ankleloop.identify(read).stiffness["K"] - estimate.stiffness["K"]) < 1e-3
try:
    ankleloop.read_trial("S1.mat")
except ankleloop.DataError as error:
    print(error)
"""


def test_the_library_alone(base, tmp_path):
    """Every method, print, figure, files; what needs a package that is missing says what to install."""
    trial = simulate(seed=1, duration=20.0)
    for kind, suffix in FILE_FORMATS.items():
        write_recording(trial, tmp_path / f"S1{suffix}", kind)
    assert run(base / "python", "-c", FIND, *WORKFLOW, *LAB, folder=tmp_path).strip() == "[]"
    text = run(base / "python", "-c", BASE, folder=tmp_path)
    assert "S1.mat: No module named 'matio': install" in text
    assert 'pip install "ankleloop[lab,formats]"' in text
    for words in ([base / "ankleloop"], [base / "python", "-m", "ankleloop"]):
        process = subprocess.run([*words, "demo"], cwd=tmp_path, capture_output=True, text=True)
        assert process.returncode == 4
        assert process.stderr.count("\n") == 1
        assert 'pip install "ankleloop[lab]"' in process.stderr


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
