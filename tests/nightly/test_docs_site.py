"""The whole site of the documentation is built strictly, with the pages that compute."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_the_site_builds_without_a_warning(tmp_path):
    options = ("-W", "-n", "--keep-going", "-q", "-b", "html", "-d", tmp_path / "trees")
    command = [sys.executable, "-m", "sphinx", *options, ROOT / "docs", tmp_path / "html"]
    process = subprocess.run(command, stderr=subprocess.PIPE, text=True)
    assert (process.returncode, process.stderr) == (0, "")
    text = (tmp_path / "html" / "tutorials" / "first-recording.html").read_text(encoding="utf-8")
    assert "cell_output" in text
    assert len(list((tmp_path / "html" / "_images").glob("*.png"))) > 8
