"""The page that lists all results holds what its run has made, and nothing else; every text is escaped."""

import json
from html import escape

import pandas as pd
import pytest

from ankleloop_workflow.jobs.results import collect_results, tabulate_recordings
from ankleloop_workflow.pages.index import render_index

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


def collect(folder, ledger=LEDGER):
    described = {"title": "Recordings", "kind": "recordings", "points": {"A1": {}}, "labels": {}}
    studies = [TABLE1, *(described | {"study": name} for name in RECORDED)]
    recordings = tabulate_recordings(folder / f"scores/{name}/0.parquet" for name in RECORDED)
    return collect_results(folder, studies, recordings, PROVENANCE, ledger)


def test_what_is_there_is_listed(folder):
    results = collect(folder)
    links = ["article.html", "ledger.html", "configuration.json", "ro-crate-metadata.json"]
    assert list(results["links"].values()) == links
    assert [figure["name"] for figure in results["figures"][TABLE1["title"]]] == ["table1-order"]
    recordings = results["recordings"].set_index(["study", "recording"])
    assert recordings.loc[("laboratory", "A1"), "recommended method"] == HOSTILE
    assert recordings["verdict"].tolist() == ["usable", "refused", "refused"]
    numbers = results["studies"].set_index("study").loc["table1", ["points", "methods", "seed"]]
    assert numbers.tolist() == ["2", "1", "7"]
    assert HOSTILE not in render_index(results, None, {})
    assert escape(HOSTILE) in render_index(results, None, {})


def test_what_an_earlier_run_has_left_is_listed_as_such(folder):
    results = collect(folder, ledger=None)
    assert list(results["links"].values()) == ["configuration.json", "ro-crate-metadata.json"]
    earlier = ["article.html", "ledger.html", "reports/gone.html"]
    assert list(results["earlier"].values()) == earlier
    head, _, tail = render_index(results, None, {}).partition("Of earlier runs")
    for path in earlier:
        assert f'href="{path}"' in tail
        assert path not in head
