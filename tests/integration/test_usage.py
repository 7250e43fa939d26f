"""The workflow as Snakemake's manual describes: options of the command line, other folders, use as a module."""

import re
import runpy
from pathlib import Path

import pandas as pd
import pytest
import yaml

pytestmark = pytest.mark.workflow

ROOT = Path(__file__).parents[2]

TINY = {
    "run": ["tiny"],
    "studies": {
        "tiny": {
            "kind": "simulation",
            "notebook": "table1",
            "trials": 3,
            "seed": 1,
            "trials_per_chunk": 2,
            "simulation": {"duration": 12.0},
            "points": {"reflex_gain": [13.0]},
            "methods": {"pr-moesp": {"method": "pr-moesp"}, "riv": {"method": "riv"}},
        }
    },
}
RULES = {
    *("simulate", "identify", "sweep", "sweep_estimates", "trial_table", "small_trial_table"),
    *("recordings", "publish", "report", "figure"),
    *("diagrams", "economy", "verify", "article", "crate", "index", "all", "everything"),
}
PLANNED = {"simulate": 2, "identify": 2, "small_trial_table": 1, "report": 1, "figure": 2, "crate": 1, "index": 1}


@pytest.fixture(scope="module")
def clean(copy_repository):
    """A copy of the repository without results."""
    return copy_repository()


@pytest.fixture
def tiny(tmp_path):
    path = tmp_path / "tiny.yaml"
    path.write_text(yaml.safe_dump(TINY), encoding="utf-8")
    return "--configfile", str(path)


def count_jobs(text):
    """Number of jobs by rule in the statistics of a dry run."""
    table = text.split("Job stats:")[-1].split("total")[0]
    jobs = {rule: int(number) for rule, number in re.findall(r"^(\w+) +(\d+)$", table, re.MULTILINE)}
    return {rule: number for rule, number in jobs.items() if rule not in ("all", "everything", "paper_all")}


def test_a_dozen_named_rules(clean, snakemake):
    assert set(snakemake(clean, "--list-rules").split()) >= RULES
    graph = snakemake(clean, "--rulegraph")
    boxes = re.findall(r'label = "(\w+)"', graph)
    assert len(boxes) == len(set(boxes)) <= 12
    assert set(boxes) <= RULES
    assert {"simulate", "identify", "report", "figure", "verify", "article"} <= set(boxes)


def test_the_picture_of_the_architecture_is_current(clean, snakemake):
    drawing = runpy.run_path(str(ROOT / "docs" / "rulegraph.py"))
    page = drawing["PAGE"].read_text(encoding="utf-8")
    graph = drawing["format_graph"](snakemake(clean, *drawing["COMMAND"][1:]))
    assert drawing["insert_graph"](page, graph) == page  # if not: make rulegraph


def test_until_a_rule(clean, snakemake):
    jobs = count_jobs(snakemake(clean, "--dry-run", "--until", "identify"))
    assert set(jobs) == {"simulate", "identify"}
    assert jobs["simulate"] == jobs["identify"] > 10


def test_resources_of_a_rule(clean, snakemake):
    text = snakemake(clean, "--dry-run", "--set-resources", "identify:mem_mb=3000")
    blocks = re.split(r"^(?:local)?rule (\w+):$", text, flags=re.MULTILINE)
    memory = {}
    for rule, block in zip(blocks[1::2], blocks[2::2], strict=True):
        memory.setdefault(rule, set()).update(re.findall(r"mem_mb=(\d+)", block))
    assert memory["identify"] == {"3000"}
    # Each rule states its own, and none has that of profiles/default.
    assert memory["simulate"] != memory["verify"]
    assert "2000" not in memory["simulate"] | memory["verify"]


def test_simulations_and_long_jobs_come_first(clean, snakemake):
    text = snakemake(clean, "--dry-run")
    blocks = re.split(r"^(?:local)?rule (\w+):$", text, flags=re.MULTILINE)
    priorities = {"simulate": {}, "identify": {}}
    for rule, block in zip(blocks[1::2], blocks[2::2], strict=True):
        if rule in priorities:
            study, chunk = re.search(r"study=([\w-]+), chunk=(\d+)", block).groups()
            priorities[rule][study, chunk] = float(re.search(r"priority: (\S+)", block)[1])
    assert min(priorities["simulate"].values()) > max(priorities["identify"].values())
    for jobs in priorities.values():
        assert jobs["figure4", "0"] == max(jobs.values())


def test_lint_is_clean(clean, snakemake):
    assert "Congratulations, your workflow is in a good condition!" in snakemake(clean, "--lint")


@pytest.mark.parametrize("snakefile", ["Snakefile", "workflow/Snakefile"])
def test_both_snakefiles_in_another_folder(clean, snakemake, tiny, tmp_path, snakefile):
    entry = ("--snakefile", str(clean / snakefile), "--dry-run", *tiny)
    assert count_jobs(snakemake(clean, *entry)) == PLANNED
    assert count_jobs(snakemake(clean, *entry, folder=tmp_path)) == PLANNED
    assert count_jobs(snakemake(clean, *entry, "--directory", str(tmp_path / "elsewhere"))) == PLANNED


MODULE = """
module ankleloop:
    snakefile: "{repository}/workflow/Snakefile"

use rule * from ankleloop{alias}

rule everything_of_the_module:
    default_target: True
    input: rules.{all}.input
"""


@pytest.mark.parametrize(("alias", "target"), [("", "all"), (" as paper_*", "paper_all")])
def test_use_as_a_module(clean, snakemake, tiny, tmp_path, alias, target):
    (tmp_path / "Snakefile").write_text(MODULE.format(repository=clean, alias=alias, all=target), encoding="utf-8")
    jobs = count_jobs(snakemake(clean, "--dry-run", *tiny, folder=tmp_path))
    prefix = "paper_" if alias else ""
    jobs.pop("everything_of_the_module")
    assert jobs == {f"{prefix}{rule}": number for rule, number in PLANNED.items()}


def test_a_module_makes_its_results_in_the_folder_that_uses_it(clean, snakemake, tiny, tmp_path):
    (tmp_path / "Snakefile").write_text(MODULE.format(repository=clean, alias="", all="all"), encoding="utf-8")
    snakemake(clean, *tiny, folder=tmp_path)
    table = pd.read_csv(tmp_path / "results/tables/tiny.csv")
    assert set(table["method"]) == {"pr-moesp", "riv"}
    assert set(table["n"]) == {3}
    for suffix in ("png", "pdf", "csv"):
        assert (tmp_path / f"results/figures/tiny-figure3.{suffix}").stat().st_size > 4_000
    assert not (clean / "results").exists()
    # In the other folder the same study has the same results, with its chunks divided otherwise.
    TINY["studies"]["tiny"]["trials_per_chunk"] = None
    (tmp_path / "tiny.yaml").write_text(yaml.safe_dump(TINY), encoding="utf-8")
    elsewhere = tmp_path / "elsewhere"
    snakemake(clean, *tiny, "--directory", str(elsewhere))
    assert (elsewhere / "results/tables/tiny.csv").read_bytes() == (tmp_path / "results/tables/tiny.csv").read_bytes()
    assert not (clean / "results").exists()
    assert "Nothing to be done" in snakemake(clean, *tiny, "--directory", str(elsewhere), "--dry-run")
