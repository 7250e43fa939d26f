"""The workflow as Snakemake's manual describes, as a module and in a folder of any name."""

import pytest
from workflow_runs import MODULE, count_jobs

pytestmark = pytest.mark.workflow

PLANNED = {
    "simulate": 2,
    "identify": 2,
    "table": 1,
    "notebook": 1,
    "report": 1,
    "figure": 2,
    "index": 1,
}


def test_a_module_under_another_name(clean, snakemake, tiny, tmp_path):
    module = MODULE.format(repository=clean, alias=" as paper_*", all="paper_all")
    (tmp_path / "Snakefile").write_text(module, encoding="utf-8")
    jobs = count_jobs(snakemake(clean, "--dry-run", *tiny, folder=tmp_path))
    jobs.pop("everything_of_the_module")
    assert jobs == {f"paper_{rule}": number for rule, number in PLANNED.items()}


def test_braces_in_the_path_of_the_project(clean, snakemake, tmp_path):
    (tmp_path / "a{b}").symlink_to(clean)
    snakefile = tmp_path / "a{b}" / "Snakefile"
    text = snakemake(clean, "--dry-run", "--snakefile", str(snakefile), check=False)
    assert "a{b}: Snakemake takes braces in this path for wildcards: rename the folder" in text
