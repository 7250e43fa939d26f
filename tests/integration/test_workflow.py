"""The whole DAG, in a copy of the repository, as a user runs it."""

import json
import re
import shutil
from collections import Counter

import nbformat
import pandas as pd
import pytest
from nbclient import NotebookClient

from ankleloop_workflow.jobs.crate import pack_crate
from ankleloop_workflow.paper.ledger import read_claims

pytestmark = pytest.mark.workflow


@pytest.fixture(scope="module")
def plan(reproduction, reduced):
    """Number of jobs that a dry run with changed settings of studies plans, by rule, study and chunk."""

    def plan(**studies):
        return count_jobs(reduced("--dry-run", overlay={"studies": studies}))

    return plan


def count_jobs(text):
    """Number of jobs in the output of a dry run."""
    blocks = re.split(r"^(?:local)?rule (\w+):$", text.split("Job stats:")[-2], flags=re.MULTILINE)
    jobs = []
    for rule, block in zip(blocks[1::2], blocks[2::2], strict=True):
        keys = re.findall(r"\b(?:study|chunk)=([\w-]+)", re.search(r"wildcards:.*|$", block)[0])
        jobs.append(" ".join([rule, *keys]))
    return dict(Counter(job for job in jobs if job != "everything"))


# Summaries of all studies, which follow any change in one of them.
ARTICLE = {"article_notebook": 1, "article": 1}
SUMMARIES = {"verify": 1, "index": 1} | ARTICLE


def report_jobs(study, figures):
    jobs = {f"{rule} {study}": 1 for rule in ("table", "notebook", "report")}
    return jobs | {f"figure {study}": figures}


def page(path):
    text = path.read_text(encoding="utf-8")
    # Nothing is fetched: pictures are embedded, and scripts are in the page; tests/browser looks at it in a browser.
    body = re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL)
    assert not re.search(r"""(src|href)\s*=\s*["']?(https?:)?//""", body)
    assert "default-src 'none'" in body
    assert "unsafe-eval" not in body
    assert 'class="back" href="' in body
    assert "data:image/png;base64" in text
    assert "Traceback" not in text
    assert not re.search(r"\wWarning: ", text)
    return text


def test_table_and_figure_of_the_paper(reproduction):
    table = pd.read_csv(reproduction / "results/tables/table1.csv")
    assert set(table["n"]) == {4}
    assert set(table["gain"]) == {13.0, 2.0}
    markdown = (reproduction / "results/tables/table1.md").read_text(encoding="utf-8")
    assert "PR-MOESP" in markdown
    assert "N·m/rad" in markdown
    for end in ("png", "pdf", "csv"):
        assert (reproduction / f"results/figures/table1-figure3.{end}").stat().st_size > 10_000
    assert "PR-MOESP" in page(reproduction / "results/reports/table1.html")


def test_nothing_is_half_written(reproduction):
    assert not list((reproduction / "results").rglob("*.part"))
    hidden = [path.name for path in (reproduction / "results").rglob(".*")]
    assert set(hidden) <= {".snakemake_timestamp"}


def test_settings_rerun_exactly_what_depends_on_them(plan):
    """An option and new points of Table 1: the point that stays is identified again; voluntary torque of Table 2."""
    option = {"pr-moesp": {"options": {"block_rows": 20}}}
    points = {"reflex_gain": [13.0, 5.0, 7.0]}
    jobs = plan(
        table1={"methods": option, "points": points}, table2={"simulation": {"voluntary": 0.4}}
    )
    names = (
        "identify table1 0",
        "identify table1 1",
        "identify table1 2",
        "simulate table1 1",
        "simulate table1 2",
    )
    chunks = dict.fromkeys((*names, "simulate table2 0", "identify table2 0"), 1)
    assert jobs == chunks | report_jobs("table1", 2) | report_jobs("table2", 1) | SUMMARIES


def test_a_title_and_a_window_of_a_figure_measure_nothing_again(reproduction, reduced):
    """Nothing is written by the plan, and no reason lists all settings."""
    files = sorted((reproduction / "results").rglob("*"))
    changed = {"title": "Mine", "figure": {"start": 3.0}}
    text = reduced("--dry-run", overlay={"studies": {"table1": changed}})
    jobs = {"notebook table1": 1, "report table1": 1, "figure table1": 2, "index": 1}
    assert count_jobs(text) == jobs | ARTICLE
    assert max(map(len, re.findall("reason: Params.*", text))) < 500
    assert sorted((reproduction / "results").rglob("*")) == files


@pytest.fixture
def touch(reproduction):
    """Change a module of the library until the end of the test."""
    texts = {}

    def change(module):
        path = reproduction / "src" / module
        texts[path] = path.read_text(encoding="utf-8")
        path.write_text(f"{texts[path]}\n# changed\n", encoding="utf-8")

    yield change
    for path, text in texts.items():
        path.write_text(text, encoding="utf-8")


def test_a_changed_method_identifies_again_and_simulates_nothing_that_is_kept(plan, touch):
    """Studies that keep no trials make them again within the job that identifies."""
    touch("ankleloop/methods/moesp.py")
    jobs = {tuple(job.split()[:2]) for job in plan()}
    identified = {("identify", "table1"), ("identify", "table2")}
    swept = {("sweep", "figure4"), ("sweep", "voluntary")}
    assert {
        job for job in jobs if job[0] in ("identify", "sweep", "simulate")
    } == identified | swept


def test_a_changed_reader_of_the_desk_analyses_recordings_again_and_nothing_else(plan, touch):
    touch("ankleloop_lab/files/csv_files.py")
    rules = {job.split()[0] for job in plan()}
    assert "recordings" in rules
    assert not rules & {"simulate", "identify", "table", "verify", "article"}


def test_a_changed_rule_of_verdicts_concerns_the_article_alone(plan, touch):
    touch("ankleloop_workflow/paper/judgement.py")
    assert plan() == SUMMARIES


def test_a_reworded_claim_makes_the_article_alone_also_in_a_copy_in_another_folder(
    reproduction, snakemake, laboratory, tmp_path
):
    """The copy has the records and the times of its original: it would make again what the original would."""
    copy = tmp_path / "copy"
    shutil.copytree(reproduction, copy)
    path = copy / "data/published/claims.yaml"
    path.write_text(path.read_text(encoding="utf-8").replace("good", "very good"), encoding="utf-8")
    arguments = ("--dry-run", "--configfile", "config/reduced.yaml")
    assert (
        count_jobs(snakemake(copy, *arguments, ANKLELOOP_RECORDINGS=str(laboratory))) == SUMMARIES
    )


@pytest.mark.parametrize("name", ["figure4", "article"])
def test_a_notebook_runs_with_its_defaults_where_the_paper_was_reproduced(reproduction, name):
    """As who opens it in Jupyter does; the results stay those of the run."""
    path = reproduction / "notebooks" / f"{name}.ipynb"
    notebook = nbformat.read(path, as_version=4)
    figures = sorted((reproduction / "results/rendered").rglob("*.png"))
    times = [figure.stat().st_mtime_ns for figure in figures]
    NotebookClient(notebook, resources={"metadata": {"path": str(path.parent)}}).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert [figure.stat().st_mtime_ns for figure in figures] == times


def test_changed_pages_are_made_again(plan, touch):
    """No notebook runs but those that read the pages of recordings."""
    touch("ankleloop_lab/pages/templates/page.css")
    jobs = plan()
    recordings = {"recordings", "publish", "notebook", "figure"}
    assert {job.split()[0] for job in jobs} == {"report", "article", "index"} | recordings
    assert not {job for job in jobs if job.startswith("notebook")} & {
        "notebook table1",
        "notebook figure4",
    }


def test_the_whole_paper_is_there(reproduction):
    """Figures 1 to 5 and Tables 1 and 2, the ledger and the article."""
    figures = [
        "figure1",
        "figure2",
        "table1-figure3",
        "figure4-figure4",
        "table2-figure5",
    ]
    for name in [*figures, "voluntary-stiffness", "voluntary-vaf"]:
        ends = ("png", "pdf") if name in ("figure1", "figure2") else ("png", "pdf", "csv")
        for end in ends:
            assert (reproduction / f"results/figures/{name}.{end}").stat().st_size > (
                4_000 if end != "csv" else 500
            )
    ledger = pd.read_csv(reproduction / "results/verification.csv")
    claims = read_claims(reproduction / "data/published/claims.yaml")
    assert set(claims["id"]) <= set(ledger["id"])
    assert len(ledger[ledger["source"] == "paper"]) == len(claims) + 18
    assert {"net-vaf-hides-bias", "riv-unbiased"} <= set(ledger["id"])
    assert ledger["reason"].notna().all()
    ledger_page = (reproduction / "results/ledger.html").read_text(encoding="utf-8")
    assert all(name in ledger_page for name in ledger["id"])
    article = page(reproduction / "results/article.html")
    for text in (
        "Figure 1.",
        "Figure 2.",
        "Table 1.",
        "Figure 3.",
        "Figure 4.",
        "simulated stand-in",
        "Figure 5",
    ):
        assert text in article
    table = pd.read_csv(reproduction / "results/tables/table2.csv")
    assert {"vaf_net", "paper_net"} <= set(table)
    for study in ("table2", "figure4", "voluntary"):
        page(reproduction / f"results/reports/{study}.html")
    assert "stand-in" in page(reproduction / "results/reports/table2.html")


def test_the_report_of_snakemake_describes_every_result(reproduction, reduced):
    reduced("--report", "report.html")
    text = (reproduction / "report.html").read_text(encoding="utf-8")
    entries = text.partition('<script id="results">')[2].partition("var results = ")[2]
    results, _ = json.JSONDecoder().raw_decode(entries)
    assert {"results/article.html", "results/figures/figure1.png"} <= set(results)
    for path in (reproduction / "results/figures").glob("*.png"):
        assert f"results/figures/{path.name}" in results
    for path, result in results.items():
        assert re.sub(r"<[^>]*>|\s", "", result["caption"]), path
        assert result["labels"].get("result"), path


def test_recordings_of_a_laboratory(reproduction):
    """A good one, one with a gap and one that is not there: the last two are refused, the first one finishes."""
    table = pd.read_csv(reproduction / "results/tables/recordings.csv")
    good = table[table["recording"] == "A1"].set_index("method")
    assert list(good.index) == ["riv", "pi-moesp", "pr-moesp-position", "parallel-cascade"]
    assert (good["K"] / 150.0 - 1).abs().max() < 0.2
    assert (good[["B", "I"]] > 0).all(axis=None)
    assert (good["vaf_net"] > 88).all()
    assert (good["vaf_unseen"] > 80).all()
    assert (good["subject"] == "Ann").all()
    assert good.loc["pr-moesp-position", "reference"] == "position"
    refused = table[table["verdict"] == "refused"].set_index("recording")["reasons"]
    assert "777" in refused["A2"]  # the sample
    assert "nowhere.csv: there is no such file" in refused["A3"]
    assert "A2 refused" in (reproduction / "run.log").read_text(encoding="utf-8")
    summary = page(reproduction / "results/reports/recordings.html")
    assert "position as reference" in summary
    assert "nowhere.csv" in summary
    assert "cannot be told without a usable reference" in page(
        reproduction / "results/reports/recordings/A1.html"
    )
    assert "nowhere.csv" in (reproduction / "results/reports/recordings/A3.html").read_text(
        encoding="utf-8"
    )
    assert (reproduction / "results/figures/recordings-group.png").stat().st_size > 10_000
    folder = reproduction / "results/estimates/recordings/A1"
    numbers = sorted(path.stem.removeprefix("figure-") for path in folder.glob("figure-*.csv"))
    assert numbers == ["models", "residuals", "spectra", "torques"]
    exported = sorted(
        path.name for path in folder.glob("[a-z]*") if not path.name.startswith("figure-")
    )
    assert exported[:3] == ["parallel-cascade.csv", "parallel-cascade.mat", "parallel-cascade.nc"]
    assert len(exported) == 12


def test_the_archive_of_a_run_holds_all_that_runs_it_again(
    reproduction, snakemake, laboratory, tmp_path
):
    archive = tmp_path / "results.zip"
    pack_crate(reproduction / "results", archive)
    assert archive.stat().st_size < 50e6
    shutil.unpack_archive(archive, tmp_path / "received")
    source = tmp_path / "received" / "source"
    variables = {"ANKLELOOP_RECORDINGS": str(laboratory)}
    text = snakemake(source, "--dry-run", "--configfile", "config/reduced.yaml", **variables)
    jobs = count_jobs(text)
    assert jobs["report table1"] == 1
    assert jobs["article"] == jobs["index"] == 1
