"""The tutorials that use the workflow, step by step, in a copy of the repository."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from ankleloop import simulate
from ankleloop_lab.files.demo_files import write_recording

pytestmark = pytest.mark.workflow

DOCS = Path(__file__).parents[2] / "docs" / "tutorials"


def block(page, start, language="yaml"):
    """The first block of a page in a language that begins with a text."""
    text = (DOCS / page).read_text(encoding="utf-8")
    blocks = re.findall(
        rf"^ *```{re.escape(language)}\n(.*?)^ *```$", text, re.MULTILINE | re.DOTALL
    )
    return next(code for code in blocks if code.lstrip().startswith(start))


@pytest.fixture(scope="module")
def repository(copy_repository):
    return copy_repository()


def test_first_sweep(repository, snakemake):
    (repository / "config" / "mine.yaml").write_text(
        block("first-sweep.md", "run: [restless]"), encoding="utf-8"
    )
    snakemake(repository, "--configfile", "config/mine.yaml")
    assert "reflex gain" in (repository / "results" / "reports" / "restless.html").read_text(
        encoding="utf-8"
    )
    table = pd.read_csv(repository / "results" / "tables" / "restless-trials.csv")
    assert len(table) == 5 * 2 * 3 * 2
    stiffness = table.groupby(["method", "point.voluntary"])["K"].mean().unstack(0)
    assert (
        stiffness["riv"] - 150
    ).abs().max() < 40  # the page says that it stays near the truth, and the other falls
    assert stiffness["pr-moesp"].iloc[-1] < stiffness["pr-moesp"].iloc[0] - 40


def test_add_a_method(repository, snakemake, tmp_path):
    """With the end of its file that the tutorial has at last, in a study and by the command."""
    package, installed = tmp_path / "package", tmp_path / "installed"
    package.mkdir()
    code = block("add-a-method.md", "import numpy", language="{code-cell} python")
    written, _, _ = code.rpartition("METHOD =")
    offer = block(
        "add-a-method.md", "from ankleloop.methods.method import Offer", "{code-cell} python"
    )
    (package / "stiffness.py").write_text(f"{written}{offer}", encoding="utf-8")
    project = block("add-a-method.md", "[build-system]", language="toml")
    (package / "pyproject.toml").write_text(project, encoding="utf-8")
    install = ["pip", "install", "--no-deps", "--no-build-isolation", "--target", installed]
    subprocess.run([sys.executable, "-m", *install, package], check=True)
    (repository / "config" / "mine.yaml").write_text(
        block("add-a-method.md", "run: [simple]"), encoding="utf-8"
    )
    paths = os.pathsep.join([str(repository / "src"), str(installed)])
    snakemake(repository, "--configfile", "config/mine.yaml", PYTHONPATH=paths)
    table = pd.read_csv(repository / "results" / "tables" / "simple-trials.csv")
    stiffness = table[table["method"] == "stiffness"].groupby("point.reflex_gain")["K"].mean()
    assert table["failure"].isna().all()
    assert stiffness.iloc[-1] > stiffness.iloc[0]  # it takes the torque of the reflex for stiffness

    trial = simulate(seed=1, duration=30.0, closed_loop=False, reflex_gain=0.0)
    write_recording(trial, tmp_path / "S1.mat", "matlab-5")
    command = [sys.executable, "-m", "ankleloop", "identify", "S1.mat", "--method", "stiffness"]
    subprocess.run(command, cwd=tmp_path, env={**os.environ, "PYTHONPATH": paths}, check=True)
    (row,) = pd.read_csv(tmp_path / "S1.mat-results" / "S1-parameters.csv").to_dict("records")
    assert row["label"] == "Stiffness without a reflex"
    assert 145.0 < row["K"] < 155.0
