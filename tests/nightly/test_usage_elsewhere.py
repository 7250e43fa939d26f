"""The workflow as a module of a repository elsewhere, and its results in other folders."""

import os
import shutil
import subprocess

import pandas as pd
import pytest
import yaml
from workflow_runs import MODULE, SETTINGS, TINY, count_jobs

TRIALS = "results/tables/tiny-trials.csv"
ELSEWHERE = """
configfile: "tiny.yaml"

module ankleloop:
    snakefile: github("lab/ankleloop", path="workflow/Snakefile", tag="v1")
    config: config

use rule * from ankleloop

rule everything:
    default_target: True
    input: rules.all.input
"""


@pytest.fixture(scope="module")
def elsewhere(clean, snakemake, tmp_path_factory):
    """Run a workflow whose module is a tag of a repository on GitHub, which is a folder here."""
    base = tmp_path_factory.mktemp("elsewhere")
    settings = base / "gitconfig"
    settings.write_text(
        f'[url "file://{base}/hosted/"]\ninsteadOf = https://github.com/\n'
        "[user]\nname = A\nemail = a@b.c\n",
        encoding="utf-8",
    )
    variables = {"GIT_CONFIG_GLOBAL": str(settings), "XDG_CACHE_HOME": str(base / "cache")}
    hosted = base / "hosted" / "lab" / "ankleloop"
    shutil.copytree(clean, hosted)
    commands = (["init"], ["add", "."], ["commit", "--message", "All"], ["tag", "v1"])
    for command in commands:
        subprocess.run(["git", *command], cwd=hosted, env=os.environ | variables, check=True)
    folder = base / "work"
    folder.mkdir()
    (folder / "Snakefile").write_text(ELSEWHERE, encoding="utf-8")

    def run(config, *arguments, **options):
        (folder / "tiny.yaml").write_text(yaml.safe_dump(config), encoding="utf-8")
        return snakemake(clean, *arguments, folder=folder, **variables, **options)

    return run, folder


@pytest.fixture(scope="module")
def complete(elsewhere):
    """Folder in which that workflow has made its table."""
    run, folder = elsewhere
    run(TINY, TRIALS)
    return folder


def test_a_module_of_a_repository_elsewhere(elsewhere, complete):
    """It runs, has nothing left to do after that, and its sources are those of the tag."""
    run, _ = elsewhere
    (sources,) = (complete / ".snakemake/sources").iterdir()
    tag = complete.parent / "hosted/lab/ankleloop/.git/refs/tags/v1"
    assert tag.read_text().strip() == sources.name
    assert "Nothing to be done" in run(TINY, TRIALS, "--dry-run")
    text = run(TINY | {"runs": ["tiny"]}, "--dry-run", check=False)
    assert "Configuration: tiny.yaml, line 3: config: unknown key 'runs'" in text


def test_other_folders_have_results_of_their_own(clean, snakemake, complete, tiny, tmp_path):
    """With a module of a folder, and with either Snakefile; chunks divided otherwise change none."""
    (tmp_path / "Snakefile").write_text(
        MODULE.format(repository=clean, alias="", all="all"), encoding="utf-8"
    )
    folder = tmp_path / "results of its own"

    def run(*arguments, seed=1, **options):
        study = SETTINGS | {"trials_per_chunk": 200, "seed": seed}
        config = TINY | {"studies": {"tiny": study}}
        (tmp_path / "tiny.yaml").write_text(yaml.safe_dump(config), encoding="utf-8")
        return snakemake(clean, TRIALS, *tiny, *arguments, **options)

    run("--directory", str(folder), folder=tmp_path)
    assert set(pd.read_csv(folder / TRIALS)["method"]) == {"pr-moesp", "riv"}
    assert (folder / TRIALS).read_bytes() == (complete / TRIALS).read_bytes()
    assert "Nothing to be done" in run("--directory", str(folder), "--dry-run")
    # Without its records Snakemake would keep the results of other settings; a dry run changes nothing.
    shutil.rmtree(folder / ".snakemake")
    entry = ("--snakefile", str(clean / "workflow/Snakefile"), "--dry-run")
    jobs = count_jobs(run(*entry, seed=2, folder=folder))
    assert jobs == {"identify": 1, "simulate": 1, "table": 1}
    assert "Nothing to be done" in run(*entry, folder=folder)
    assert not (clean / "results").exists()


def test_a_module_without_the_library_says_how_to_install_it(elsewhere, tmp_path):
    (tmp_path / "ankleloop.py").write_text(
        "raise ModuleNotFoundError(\"No module named 'ankleloop'\")", encoding="utf-8"
    )
    text = elsewhere[0](TINY, "--dry-run", check=False, PYTHONPATH=str(tmp_path))
    assert "No module named 'ankleloop'. Install the library: python -m pip install '" in text
    assert "Traceback" not in text
