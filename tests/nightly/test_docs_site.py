"""The whole site of the documentation is built strictly, with the pages that compute."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
COMPUTED = (
    "tutorials/first-recording",
    "tutorials/first-sweep",
    "tutorials/add-a-method",
    "explanation/loop",
    "explanation/instruments",
)


def test_the_site_builds_without_a_warning(tmp_path):
    options = ("-W", "-n", "--keep-going", "-q", "-b", "html", "-d", str(tmp_path / "trees"))
    subprocess.run([sys.executable, "-m", "sphinx", *options, ROOT / "docs", tmp_path / "html"], check=True)
    for page in COMPUTED:
        text = (tmp_path / "html" / page).with_suffix(".html").read_text(encoding="utf-8")
        assert "cell_output" in text, page
        assert "Figure size" not in text, page  # a figure that is shown as its type
    assert len(list((tmp_path / "html" / "_images").glob("*.png"))) > 8
