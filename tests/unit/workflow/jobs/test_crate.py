"""The crate of a run, read again by the library of Research Object Crates, and its archive."""

import hashlib
import os
from pathlib import Path
from zipfile import ZipFile

import pytest
from packaging.version import Version
from rocrate.rocrate import ROCrate

import ankleloop
from ankleloop_lab.provenance import read_provenance
from ankleloop_workflow.jobs.crate import PROFILES, pack_crate, write_crate

ROOT = Path(__file__).parents[4]
RESULTS = ("article.html", "tables/table1.csv", "reports/recordings/S1.html")


@pytest.fixture
def results(tmp_path):
    folder = tmp_path / "results"
    for name in (*RESULTS, "configuration.json", "trials/table1/0.nc", "../S1.mat"):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"content of {name}")
    os.utime(folder / "article.html", (1.7e9, 1.7e9))
    write_crate(
        folder,
        ROOT,
        read_provenance(ROOT) | {"agent": "Ada"},
        recordings=[tmp_path / "S1.mat", tmp_path / "S1.mat", tmp_path / "gone.mat"],  # two parts
        results=[folder / "article.html", folder / "tables", folder / "reports" / "recordings"],
    )
    return folder


def test_results_have_their_hashes(results):
    files = {entity.id: entity for entity in ROCrate(results).data_entities}
    for name in (*RESULTS, "source/environment.lock", "source/workflow/Snakefile"):
        entity = files[name]
        assert entity["sha256"] == hashlib.sha256((results / name).read_bytes()).hexdigest()
        assert int(entity["contentSize"]) == (results / name).stat().st_size
    assert files["tables/table1.csv"]["encodingFormat"] == "text/csv"
    assert not any(name.startswith("trials") for name in files)


def test_the_action_leads_from_what_was_read_to_the_results(results):
    crate = ROCrate(results)
    (action,) = crate.get_by_type("CreateAction")
    assert crate.root_dataset["mentions"] == action
    assert action["startTime"] == "2023-11-14T22:13:20+00:00"
    assert action["endTime"] > action["startTime"]
    assert action["agent"]["name"] == "Ada"
    read = [entity["name"] for entity in action["object"]]
    assert read.count("S1.mat") == 1
    assert set(read) >= {"configuration.json", "S1.mat", "source/data/published/table1.csv"}
    assert {entity.id for entity in action["result"]} == set(RESULTS)
    workflow = action["instrument"]
    assert crate.mainEntity == workflow
    assert workflow["programmingLanguage"]["name"] == "Snakemake"
    program = workflow["softwareRequirements"]
    assert Version(program["softwareVersion"]).base_version == ankleloop.__version__
    packages = {text.split()[0] for text in program["softwareRequirements"]}
    assert {"numpy", "snakemake", "Python"} <= packages
    assert crate.metadata["conformsTo"][0] == "https://w3id.org/ro/crate/1.1"
    assert [profile.id for profile in crate.root_dataset["conformsTo"]] == list(PROFILES)


def test_the_archive_is_a_crate_without_trials(results, tmp_path):
    pack_crate(results, tmp_path / "results.zip")
    with ZipFile(tmp_path / "results.zip") as archive:
        names = set(archive.namelist())
        archive.extractall(tmp_path / "opened")
    assert {*RESULTS, "ro-crate-metadata.json", "source/Snakefile"} <= names
    assert "trials/table1/0.nc" not in names
    assert ROCrate(tmp_path / "opened").mainEntity.id == "source/Snakefile"
