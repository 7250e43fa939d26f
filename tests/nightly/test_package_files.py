"""The wheel and the source distribution: what is in them. test_package.py works with the wheel alone."""

import re
import subprocess
import zipfile
from pathlib import Path

import pytest
from package_builds import build, unpack

import ankleloop

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    return build("wheel", tmp_path_factory.mktemp("wheel"))


def test_the_version_stands_in_one_place(wheel):
    assert wheel.name == f"ankleloop-{ankleloop.__version__}-py3-none-any.whl"
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert 'dynamic = ["version"]' in project
    assert not re.search(r"^version *=", project, re.MULTILINE)


def test_the_wheel_has_every_file_of_the_library(wheel):
    """Those that git knows: templates and data as well as modules."""
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard", "src"], cwd=ROOT, capture_output=True)
    present = [name for name in listed.stdout.decode().split("\n") if name and (ROOT / name).exists()]
    files = {name.removeprefix("src/") for name in present}
    if listed.returncode or not files:
        pytest.skip("this is no working copy of git")
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
        assert {"ankleloop/pages/templates/base.html.j2", "ankleloop/studies/resources.json"} <= names
        assert names == files
        scripts = archive.read(f"ankleloop-{ankleloop.__version__}.dist-info/entry_points.txt").decode()
    assert "ankleloop=ankleloop.command_line.main:main" in scripts.replace(" ", "")


def test_the_source_distribution_gives_the_same_wheel(wheel, tmp_path):
    source = unpack(build("sdist", tmp_path), tmp_path)
    again = build("wheel", tmp_path, source)
    with zipfile.ZipFile(wheel) as first, zipfile.ZipFile(again) as second:
        assert {i.filename: i.CRC for i in first.infolist()} == {i.filename: i.CRC for i in second.infolist()}
