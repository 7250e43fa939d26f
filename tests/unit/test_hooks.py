"""The hooks before a commit: they mend what `make lint` would find, without a network."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
CONFIG = ROOT / ".pre-commit-config.yaml"
NOTEBOOK = {
    "cells": [
        {
            "cell_type": "code",
            "execution_count": 3,
            "id": "a",
            "metadata": {},
            "outputs": [{"name": "stdout", "output_type": "stream", "text": ["1\n"]}],
            "source": ["print(1)"],
        }
    ],
    "metadata": {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}},
    "nbformat": 4,
    "nbformat_minor": 5,
}


@pytest.fixture
def copy(tmp_path):
    """A working copy with a file of each kind that is not in order."""
    git("init", "--quiet", folder=tmp_path)
    shutil.copy(CONFIG, tmp_path)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    programs = tmp_path / ".venv" / "bin"
    programs.mkdir(parents=True)
    for name in ("ruff", "snakefmt", "nbstripout"):
        (programs / name).symlink_to(Path(sys.executable).with_name(name))
    (tmp_path / ".gitignore").write_text(".venv\n")
    (tmp_path / "a.py").write_text('"""A module."""\nx = {  "a":1 }\n')
    (tmp_path / "Snakefile").write_text("rule a:\n  output: 'a'\n  shell: 'touch a'\n")
    (tmp_path / "a.ipynb").write_text(json.dumps(NOTEBOOK))
    git("add", "--all", folder=tmp_path)
    return tmp_path


def git(*arguments, folder):
    subprocess.run(["git", *arguments], cwd=folder, check=True, capture_output=True)


def test_hooks_mend_and_are_content(copy):
    command = [sys.executable, "-m", "pre_commit", "run", "--all-files", "--color", "never"]
    first = subprocess.run(command, cwd=copy, capture_output=True, text=True)
    assert first.returncode == 1, first.stdout + first.stderr
    assert first.stdout.count("files were modified by this hook") == 3, first.stdout
    assert (copy / "a.py").read_text() == '"""A module."""\n\nx = {"a": 1}\n'
    assert "outputs" in (copy / "a.ipynb").read_text()
    cell = json.loads((copy / "a.ipynb").read_text())["cells"][0]
    assert (cell["outputs"], cell["execution_count"], cell["id"]) == ([], None, "a")
    assert 'output:\n        "a",' in (copy / "Snakefile").read_text()
    second = subprocess.run(command, cwd=copy, capture_output=True, text=True)
    assert second.returncode == 0, second.stdout


def test_hooks_are_programs_of_the_environment():
    """A hook of another repository would be downloaded, in a version that environment.lock does not pin."""
    repositories = yaml.safe_load(CONFIG.read_text(encoding="utf-8"))["repos"]
    assert [repository["repo"] for repository in repositories] == ["local"]
    for hook in repositories[0]["hooks"]:
        assert hook["language"] == "system"
        program = hook["entry"].split()[0]
        assert program.startswith(".venv/bin/")
        assert Path(sys.executable).with_name(Path(program).name).exists()


@pytest.mark.parametrize("path", sorted((ROOT / "notebooks").glob("*.ipynb")), ids=lambda path: path.name)
def test_notebooks_have_no_output(path):
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    assert not [cell for cell in cells if cell.get("outputs") or cell.get("execution_count")]
