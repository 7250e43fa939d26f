"""The tutorials that use the workflow, step by step, in a copy of the repository."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

DOCS = Path(__file__).parents[2] / "docs" / "tutorials"


def block(page, start, language="yaml"):
    """The first block of a page in a language that begins with a text."""
    text = (DOCS / page).read_text(encoding="utf-8")
    blocks = re.findall(
        rf"^ *```{re.escape(language)}\n(.*?)^ *```$", text, re.MULTILINE | re.DOTALL
    )
    return next(code for code in blocks if code.lstrip().startswith(start))


@pytest.fixture
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
    stiffness = table.groupby(["method", "voluntary"])["K"].mean().unstack(0)
    assert (
        stiffness["riv"] - 150
    ).abs().max() < 40  # the page says that it stays near the truth, and the other falls
    assert stiffness["pr-moesp"].iloc[-1] < stiffness["pr-moesp"].iloc[0] - 40


def test_add_a_method(repository, snakemake):
    methods = repository / "src" / "ankleloop" / "methods"
    code = block("add-a-method.md", "import numpy", language="{code-cell} python")
    (methods / "stiffness.py").write_text(code, encoding="utf-8")
    registry = (methods / "registry.py").read_text(encoding="utf-8")
    lines = block(
        "add-a-method.md", "from ankleloop.methods", language="{code-block} python"
    ).split("\n")
    for line in filter(
        None, map(str.strip, lines)
    ):  # each takes the place of the line that begins alike
        registry = re.sub(rf"^{re.escape(line[:10])}.*moesp.*$", line, registry, flags=re.MULTILINE)
    assert registry.count("real_time, stiffness") == registry.count("riv_tv, stiffness") == 1
    (methods / "registry.py").write_text(registry, encoding="utf-8")
    subprocess.run(
        [sys.executable, "-m", "ankleloop.studies.config"],
        cwd=repository,
        env={**os.environ, "PYTHONPATH": str(repository / "src")},
        check=True,
    )
    (repository / "config" / "mine.yaml").write_text(
        block("add-a-method.md", "run: [simple]"), encoding="utf-8"
    )
    snakemake(repository, "--configfile", "config/mine.yaml")
    table = pd.read_csv(repository / "results" / "tables" / "simple-trials.csv")
    stiffness = table[table["method"] == "stiffness"].groupby("reflex_gain")["K"].mean()
    assert table["failure"].isna().all()
    assert stiffness.iloc[-1] > stiffness.iloc[0]  # it takes the torque of the reflex for stiffness
