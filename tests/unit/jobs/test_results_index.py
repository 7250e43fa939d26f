"""The page that lists all results holds what its run has made, and nothing else; every text is escaped."""

import json
import os
from html import escape

import pandas as pd
import pytest

from ankleloop.jobs.results import collect_results, read_run_times, tabulate_recordings
from ankleloop.pages.index import render_index

HOSTILE = "<b>&co"
PROVENANCE = {
    "version": "1.2.3",
    "commit": "0123abcd" * 5,
    "changed": True,
    "python": "3.11.2",
    "system": "Linux",
}
PROVENANCE["packages"] = {"numpy": "2.1", "scipy": "1.15"}
TABLE1 = {
    "study": "table1",
    "title": f"Table 1 {HOSTILE}",
    "kind": "simulation",
    "points": {"a": {}, "b": {}},
    "labels": {"riv": "RIV"},
    "trials_per_point": 20,
    "seed": 7,
}
RECORDED = ("laboratory", "clinic")
JOBS = ["article", "identify/table1/0", "identify/table1/1", "identify/table1/2", "report/table1"]


@pytest.fixture
def folder(tmp_path):
    """Results of a run: a study with a figure, recordings of two studies, a ledger of two claims; and stale files."""
    results = tmp_path / "results"
    for name in (
        "reports/laboratory",
        "reports/clinic",
        "figures",
        "rendered/table1",
        "tables",
        "scores/laboratory",
        "scores/clinic",
    ):
        (results / name).mkdir(parents=True)
    pages = [
        "reports/table1.html",
        "reports/laboratory/A1.html",
        "reports/clinic/A1.html",
        "reports/gone.html",
    ]
    for name in ("article.html", "ledger.html", *pages, "figures/table1-order.png"):
        (results / name).write_text("x", encoding="utf-8")
    captions = {"table1-order": f"Order {HOSTILE}", "table1-gone": "not there"}
    (results / "rendered/table1/captions.json").write_text(json.dumps(captions), encoding="utf-8")
    (results / "configuration.json").write_text('{"run": ["table1"]}', encoding="utf-8")
    columns = ("recording", "subject", "verdict", "label", "recommended")
    rows = [
        ("A1", "S1", "usable", HOSTILE, True),
        ("A1", "S1", "usable", "b", False),
        ("A2", "S2", "refused", None, None),
    ]
    for name in RECORDED:
        table = pd.DataFrame(rows, columns=columns).assign(condition="rest", trial=None)
        table = table if name == "laboratory" else table[2:].drop(columns=["label", "recommended"])
        table.to_parquet(results / f"scores/{name}/0.parquet")
    return results


LEDGER = pd.DataFrame({"id": ["a", "b"], "verdict": ["reproduced", "cannot be judged"]})


def collect(folder, ledger=LEDGER, jobs=()):
    described = {"title": "Recordings", "kind": "recordings", "points": {"A1": {}}, "labels": {}}
    studies = [TABLE1, *(described | {"study": name} for name in RECORDED)]
    recordings = tabulate_recordings(folder / f"scores/{name}/0.parquet" for name in RECORDED)
    times = read_run_times(folder.parent / "logs", jobs)
    return collect_results(folder, studies, recordings, times, PROVENANCE, ledger)


def test_what_is_there_is_listed(folder):
    results = collect(folder)
    assert list(results["links"].values()) == ["article.html", "ledger.html", "configuration.json"]
    assert [figure["name"] for figure in results["figures"][TABLE1["title"]]] == ["table1-order"]
    recordings = results["recordings"].set_index(["study", "recording"])
    assert recordings.loc[("laboratory", "A1"), "recommended method"] == HOSTILE
    assert recordings["verdict"].tolist() == ["usable", "refused", "refused"]
    numbers = results["studies"].set_index("study").loc["table1", ["points", "methods", "seed"]]
    assert numbers.tolist() == ["2", "1", "7"]
    assert HOSTILE not in render_index(results, None, {})
    assert escape(HOSTILE) in render_index(results, None, {})


def test_the_article_of_an_earlier_run_is_left_out(folder):
    results = collect(folder, ledger=None)
    assert list(results["links"].values()) == ["configuration.json"]
    page = render_index(results, None, {})
    assert "Ledger" not in page


def test_times_of_the_jobs_of_the_run(folder):
    """From benchmark files of Snakemake; time without a job, and a chunk of an earlier run, do not count."""
    for name, row, end in (
        ("identify/table1/0", (10.0, 300.0, 9.0), 1000.0),
        ("identify/table1/1", (20.0, 400.0, 18.0), 1005.0),
        ("identify/table1/7", (500.0, 400.0, 18.0), 5.0),
        ("report/table1", (5.0, 200.0, 4.0), 2000.0),
        ("article", (3.0, "-", "-"), 2003.0),  # too short for Snakemake to measure its memory
    ):
        path = folder.parent / "logs" / f"{name}.tsv"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(
            "s\tmax_rss\tcpu_time\n" + "\t".join(map(str, row)) + "\n", encoding="utf-8"
        )
        os.utime(path, (end, end))
    times = read_run_times(folder.parent / "logs", JOBS)
    assert times["study"].tolist() == ["", "table1", "table1", "table1"]
    results = collect(folder, jobs=JOBS)
    assert (
        results["studies"].set_index("study").loc["table1", "time of its jobs [min]"] == "0.58333"
    )
    assert dict(results["provenance"])["Jobs"] == "4, from 1970-01-01 00:16 to 1970-01-01 00:33 UTC"
