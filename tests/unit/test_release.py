"""What accompanies a release: citation, changes, expected results, hosted checks, targets of the Makefile."""

import json
import re
import runpy
import subprocess
from pathlib import Path

import jsonschema
import pytest
import yaml

import ankleloop

ROOT = Path(__file__).parents[2]


def read_yaml(name):
    return yaml.safe_load((ROOT / name).read_text(encoding="utf-8"))


def test_the_citation_is_valid_and_of_this_version():
    schema = json.loads((ROOT / "tests/schemas/citation-file-format-1.2.0.json").read_text(encoding="utf-8"))
    citation = read_yaml("CITATION.cff")
    checker = jsonschema.validators.validator_for(schema)
    checker(schema, format_checker=checker.FORMAT_CHECKER).validate(citation)
    assert citation["version"] == ankleloop.__version__
    assert set(citation) >= {"abstract", "authors", "date-released", "keywords", "license", "references", "title"}


def test_the_list_of_expected_results_is_current():
    description = runpy.run_path(str(ROOT / "tests/regression/codecheck.py"))
    assert (ROOT / "codecheck.yml").read_text(encoding="utf-8") == description["describe"]()  # if not: make expected
    for entry in read_yaml("codecheck.yml")["manifest"]:
        assert (ROOT / entry["file"]).is_file()
        assert re.fullmatch("[0-9a-f]{64}", entry["sha256"])


def test_changes_are_told():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    headings = re.findall(r"^## \[(.+?)\](?: - (\d{4}-\d{2}-\d{2}))?$", text, re.MULTILINE)
    assert headings[0] == ("Unreleased", "")
    assert all(date for _, date in headings[1:])
    # The version of the code is the one that comes next, or the last one that was published.
    assert ankleloop.__version__ in text
    kinds = {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security", "Known limits"}
    assert set(re.findall(r"^### (.+)$", text, re.MULTILINE)) <= kinds


def test_hosted_checks_run_on_every_system_and_python():
    jobs = read_yaml(".github/workflows/ci.yml")["jobs"]
    matrix = jobs["checks"]["strategy"]["matrix"]
    assert {name.partition("-")[0] for name in matrix["os"]} == {"ubuntu", "macos"}
    assert matrix["python"] == ["3.11", "3.12", "3.13"]
    assert [step["run"] for step in jobs["checks"]["steps"] if "run" in step] == [".ci/run"]
    assert 'requires-python = ">=3.11"' in (ROOT / "pyproject.toml").read_text(encoding="utf-8")


def test_every_target_has_a_line_of_help():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = re.search(r"^\.PHONY: (.+)$", makefile, re.MULTILINE)[1].split()
    process = subprocess.run(["make", "help"], cwd=ROOT, capture_output=True, text=True, check=True)
    lines = dict(re.findall(r"^make (\S+) +(\S.*)$", process.stdout, re.MULTILINE))
    assert sorted(lines) == sorted(targets)
    assert all(text.endswith(".") for text in lines.values())
    assert max(map(len, process.stdout.splitlines())) <= 150


@pytest.mark.parametrize("name", ["Makefile", ".ci/run"])
def test_commands_are_those_of_linux_and_macos(name):
    """Options of GNU programs that those of BSD, which macOS has, do not know."""
    text = (ROOT / name).read_text(encoding="utf-8")
    for words in ("sed -i", "readlink -f", "grep -P", "date -d", "stat -c", "cp --", "xargs -r", "/proc/", "mapfile"):
        assert words not in text


def test_no_file_names_a_package_index():
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True)
    if listed.returncode:
        pytest.skip("this is no working copy of git")
    hosts = re.compile("py" + r"pi\.org|python" + r"hosted\.org|conda\.ana" + "conda")
    names = [name for name in listed.stdout.splitlines() if (ROOT / name).is_file()]
    files = [name for name in names if hosts.search((ROOT / name).read_bytes().decode("utf-8", "ignore"))]
    assert files == []
