"""What accompanies a release: the version stands in one place, and no file names a package index."""

import re
import subprocess
from pathlib import Path

import pytest
import yaml

import ankleloop

ROOT = Path(__file__).parents[2]


def test_citation_and_changes_are_of_this_version():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == ankleloop.__version__
    assert ankleloop.__version__ in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_no_file_names_a_package_index():
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True)
    if listed.returncode:
        pytest.skip("this is no working copy of git")
    hosts = re.compile("py" + r"pi\.org|python" + r"hosted\.org|conda\.ana" + "conda")
    names = [name for name in listed.stdout.splitlines() if (ROOT / name).is_file()]
    files = [name for name in names if hosts.search((ROOT / name).read_bytes().decode("utf-8", "ignore"))]
    assert files == []
