"""Licences of what ankleloop is built on, and what `make audit` says where it learns nothing."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "audit"))

from licences import dependencies, is_permitted, licence_of  # noqa: E402

from audit import FAILED, NOT_RUN, PASSED, exit_status, judge_advisories  # noqa: E402


def test_every_distribution_has_what_it_requires():
    process = subprocess.run([sys.executable, "-m", "pip", "check"], capture_output=True, text=True)
    assert process.returncode == 0, process.stdout


def test_licences_of_runtime_dependencies_are_permitted():
    names = dependencies("ankleloop", ["workflow"])
    assert {"numpy", "scipy", "snakemake", "nbconvert", "certifi"} <= set(names)  # direct ones, and those of others
    assert "pytest" not in names
    assert {name: licence_of(name) for name in names if not is_permitted(licence_of(name))} == {}


@pytest.mark.parametrize(
    ("licence", "permitted"),
    [
        ("MIT", True),
        ("BSD-3-Clause AND 0BSD AND MIT", True),
        ("Apache-2.0 OR GPL-3.0-only", True),
        ("(MIT OR GPL-3.0-only) AND BSD-2-Clause", True),
        ("GPL-3.0-only", False),
        ("MIT AND GPL-3.0-only", False),
        ("GNU Affero General Public License v3", False),
        ("", False),
        ("Other/Proprietary License", False),
    ],
)
def test_licences_that_are_permitted(licence, permitted):
    assert is_permitted(licence) is permitted


def test_an_advisory_is_a_failure():
    entries = [{"name": "a", "version": "1", "vulns": [{"id": "PYSEC-1"}]}, {"name": "b", "version": "2", "vulns": []}]
    result, text = judge_advisories(entries)
    assert result == FAILED
    assert "2 of 2 distributions" in text
    assert "a 1: PYSEC-1" in text


def test_a_database_that_does_not_answer_is_no_success():
    entries = [{"name": "a", "skip_reason": "not there: a"}, {"name": "b", "version": "2", "vulns": []}]
    assert judge_advisories(entries)[0] == NOT_RUN
    assert "1 of 2 distributions" in judge_advisories(entries)[1]
    assert judge_advisories(entries[1:])[0] == PASSED


@pytest.mark.parametrize(
    ("results", "status"),
    [
        ([PASSED, PASSED], 0),
        ([PASSED, NOT_RUN], 2),
        ([FAILED, NOT_RUN], 1),
        ([FAILED, PASSED], 1),
    ],
)
def test_an_audit_that_could_not_run_is_no_success(results, status):
    assert exit_status(results) == status


def test_tools_of_the_audit_are_pinned_by_hashes():
    text = (ROOT / "audit" / "requirements.txt").read_text(encoding="utf-8")
    pins = [line for line in text.splitlines() if "==" in line and not line.startswith((" ", "#"))]
    assert {"pip-audit", "pip-licenses", "cyclonedx-bom"} <= {pin.split("==")[0] for pin in pins}
    assert all(pin.rstrip().endswith("\\") for pin in pins)  # hashes follow
    assert "http" not in text
