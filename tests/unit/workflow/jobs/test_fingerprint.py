"""Fingerprints follow imports, however they are written, and package data."""

import json

import pytest

from ankleloop_workflow.jobs import fingerprint as module
from ankleloop_workflow.jobs.fingerprint import fingerprint, reached_files

# As the public face is: a name is imported at its first use.
FACE = """
def __getattr__(name):
    from ankleloop.a import x
"""
MODULES = {"markdown": "ankleloop.b.y", "code": "ankleloop.a.x"}


@pytest.fixture
def library(tmp_path, monkeypatch):
    """A library of a few modules, and the function that writes one of them."""
    monkeypatch.setattr(module, "LIBRARY", tmp_path)

    def write(path, text=""):
        file = tmp_path / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
        return file

    for package in ("a", "b", "c"):
        write(f"ankleloop/{package}/__init__.py")
    write("ankleloop/__init__.py", FACE)
    return write


def changed_by(write, script, path, text="# changed"):
    """Whether the fingerprint of a script changes with the content of a file."""
    fingerprints = set()
    for content in ("# as it was", text):
        write(path, content)
        module._parse.cache_clear()
        module.hash_file.cache_clear()
        fingerprints.add(fingerprint(script))
    return len(fingerprints) == 2


@pytest.mark.parametrize(
    "text",
    [
        "import ankleloop.a.x",
        "import ankleloop.a.x as x, os",
        "from ankleloop.a import x",
        "from ankleloop.a.x import name",
        "from ankleloop.a import (\n    y,\n    x,\n)",
        "def function():\n    from ankleloop.a.x import name\n",
        "import ankleloop",
        "from ankleloop import simulate",
        "import ankleloop.b.through",
    ],
)
def test_every_form_of_import(library, text):
    library("ankleloop/b/through.py", "from ankleloop.b import further")
    library("ankleloop/b/further.py", "import ankleloop.a.x")
    library("ankleloop/a/x.py")
    script = library("script.py", text)
    assert changed_by(library, script, "ankleloop/a/x.py")


def test_code_of_notebooks_counts(library):
    library("ankleloop/a/x.py")
    library("ankleloop/b/y.py")
    cells = [{"cell_type": kind, "source": [f"import {name}"]} for kind, name in MODULES.items()]
    notebook = library("study.ipynb", json.dumps({"cells": cells}))
    assert changed_by(library, notebook, "ankleloop/a/x.py")
    assert not changed_by(library, notebook, "ankleloop/b/y.py")


@pytest.mark.parametrize("package", ["ankleloop", "ankleloop_lab", "ankleloop_workflow"])
def test_modules_of_each_package_count(library, package):
    library(f"{package}/further/x.py")
    script = library("script.py", f"from {package}.further.x import name")
    other = library("other.py", "import numpy")
    assert changed_by(library, script, f"{package}/further/x.py")
    assert not changed_by(library, other, f"{package}/further/x.py")


def test_data_counts_where_it_is_named(library):
    library("ankleloop/a/x.py", 'render_template("page.html")')
    library("ankleloop/a/templates/page.html", '{% include "page.css" %}')
    library("ankleloop/a/templates/page.css")
    script = library("script.py", "import ankleloop.a.x")
    other = library("other.py", "import ankleloop.a")
    assert changed_by(library, script, "ankleloop/a/templates/page.css")
    assert not changed_by(library, other, "ankleloop/a/templates/page.css")


def test_the_style_of_pages_executes_no_notebook():
    scripts = module.LIBRARY.parent / "workflow" / "scripts"
    notebooks = module.LIBRARY.parent / "notebooks"
    for notebook in sorted(notebooks.glob("*.ipynb")):
        reached = {path.name for path in reached_files(scripts / "execute.py", notebook)}
        assert "page.css" not in reached
    assert {"page.css", "base.html.j2", "sources.html.j2", "table.html.j2", "tables.js"} <= {
        path.name for path in reached_files(scripts / "page.py")
    }


def test_how_an_estimate_is_drawn_changes_no_number():
    """A change of figures and words plans no identification, though an estimate imports them where it is asked."""
    script = module.LIBRARY.parent / "workflow" / "scripts" / "identify.py"
    reached = {path.relative_to(module.LIBRARY).as_posix() for path in reached_files(script)}
    assert {"ankleloop/joint/estimate.py", "ankleloop/methods/moesp.py"} <= reached
    assert "ankleloop_workflow/tables/outcomes.py" in reached
    assert not any("plotting" in path or path.startswith("ankleloop_lab/files") for path in reached)
    assert "ankleloop/methods/description.py" not in reached


@pytest.mark.parametrize("package", ["numpy", "scipy", "numba", "control"])
def test_another_version_of_what_computes_makes_jobs_run_again(library, monkeypatch, package):
    """Else new results would stand beside old ones, under one provenance."""
    script = library("script.py", "import ankleloop.a")
    before = fingerprint(script)
    versions = module.read_versions() | {package: "0.0.1"}
    monkeypatch.setattr(module, "read_versions", lambda: versions)
    assert fingerprint(script) != before
