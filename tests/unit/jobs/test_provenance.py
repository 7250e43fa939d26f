"""Metadata of a run, read again by the library of Research Object Crates."""

import hashlib
import subprocess
from pathlib import Path

import pytest
from rocrate.rocrate import ROCrate

import ankleloop
from ankleloop.jobs.results import PROFILE, read_provenance, write_crate

ROOT = Path(__file__).parents[3]


@pytest.fixture
def results(tmp_path):
    folder = tmp_path / "results"
    for name in (
        "article.html",
        "tables/table1.csv",
        "reports/recordings/S1.html",
        "configuration.json",
    ):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"content of {name}")
    return folder


@pytest.fixture
def crate(results):
    outputs = [
        results / "article.html",
        results / "tables" / "table1.csv",
        results / "reports" / "recordings",
    ]
    provenance = read_provenance(ROOT)
    write_crate(results, outputs, results / "configuration.json", provenance)
    return ROCrate(results)


def test_results_with_their_hashes(results, crate):
    files = {entity.id: entity for entity in crate.data_entities}
    assert set(files) == {
        "article.html",
        "tables/table1.csv",
        "reports/recordings/S1.html",
        "configuration.json",
    }
    for name, entity in files.items():
        assert entity["sha256"] == hashlib.sha256((results / name).read_bytes()).hexdigest()
        assert int(entity["contentSize"]) == (results / name).stat().st_size
    assert files["tables/table1.csv"]["encodingFormat"] == "text/csv"
    assert crate.root_dataset["license"]


def test_the_action_leads_from_the_configuration_to_the_results(crate):
    (action,) = crate.get_by_type("CreateAction")
    assert [entity.id for entity in action["object"]] == ["configuration.json"]
    assert {entity.id for entity in action["result"]} >= {
        "article.html",
        "reports/recordings/S1.html",
    }
    software = action["instrument"]
    assert software["softwareVersion"].startswith(ankleloop.__version__)
    packages = {text.split()[0] for text in software["softwareRequirements"]}
    assert {"numpy", "snakemake", "Python"} <= packages
    profile = crate.root_dataset["conformsTo"]
    assert getattr(profile, "id", profile) == PROFILE


def test_commit_of_a_working_copy(tmp_path):
    assert read_provenance(tmp_path)["commit"] == ""

    def git(*arguments):
        identity = ("-c", "user.name=a", "-c", "user.email=a@b")
        return subprocess.run(
            ["git", *identity, *arguments], cwd=tmp_path, check=True, capture_output=True, text=True
        )

    git("init", "--quiet")
    (tmp_path / "a").write_text("1")
    git("add", "a")
    git("commit", "--quiet", "-m", "a file")
    provenance = read_provenance(tmp_path)
    assert provenance["commit"] == git("rev-parse", "HEAD").stdout.strip()
    assert not provenance["changed"]
    (tmp_path / "a").write_text("2")
    assert read_provenance(tmp_path)["changed"]
