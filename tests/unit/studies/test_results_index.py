"""The page that lists all results holds what is there, and nothing else; every text is escaped."""

import json

import pandas as pd
import pytest

from ankleloop.pages.index import render_index
from ankleloop.paper.ledger import VERDICTS
from ankleloop.studies.provenance import Provenance
from ankleloop.studies.results_index import collect_results

HOSTILE = "<b>&co"
PROVENANCE = Provenance("1.2.3", "0123abcd" * 5, True, "3.11.2", "Linux on x86_64", {"numpy": "2.1", "scipy": "1.15"})
STUDIES = {
    "table1": {"title": f"Table 1 {HOSTILE}", "kind": "simulation", "points": 2, "methods": 5, "trials": 20, "seed": 7},
    "laboratory": {
        "title": "Laboratory",
        "kind": "recordings",
        "points": 2,
        "methods": 1,
        "trials": None,
        "seed": None,
    },
}


@pytest.fixture
def folder(tmp_path):
    """Results of a run: a study with a figure, a recording and a refused one, a table, a ledger of two claims."""
    results = tmp_path / "results"
    for name in ("reports/laboratory", "figures", "rendered/table1", "tables", "parameters/laboratory"):
        (results / name).mkdir(parents=True)
    for name in ("article.html", "reports/table1.html", "reports/laboratory/A1.html", "figures/table1-order.png"):
        (results / name).write_text("x", encoding="utf-8")
    captions = {"table1-order": f"Order {HOSTILE}", "table1-gone": "not there"}
    (results / "rendered/table1/captions.json").write_text(json.dumps(captions), encoding="utf-8")
    (results / "configuration.json").write_text('{"run": ["table1"]}', encoding="utf-8")
    rows = [
        {"recording": "A1", "subject": "S1", "verdict": "usable", "label": HOSTILE, "recommended": True},
        {"recording": "A1", "subject": "S1", "verdict": "usable", "label": "other", "recommended": False},
        {"recording": "A2", "subject": "S2", "verdict": "refused", "label": None, "recommended": None},
    ]
    pd.DataFrame(rows).to_csv(results / "parameters/laboratory/0.csv", index=False)
    table = pd.DataFrame({"method": [HOSTILE, "b"], "mean": [92.123456789, None], "empty": [None, None], "n": [3, 4]})
    table.to_csv(results / "tables/table1.csv", index=False)
    table.to_csv(results / "tables/table1-trials.csv", index=False)
    claims = pd.DataFrame({"id": ["a", "b"], "verdict": ["reproduced", "cannot be judged"]})
    claims.to_csv(results / "verification.csv", index=False)
    return results


def collect(folder, *, has_article=True):
    return collect_results(folder, folder.parent / "logs", STUDIES, PROVENANCE, has_article=has_article)


def test_what_is_there_is_listed(folder):
    results = collect(folder)
    assert list(results.links.values()) == [
        "article.html",
        "ledger.html",
        "tables.html",
        "verification.csv",
        "configuration.json",
    ]
    assert results.verdicts == dict.fromkeys(VERDICTS, 0) | {"reproduced": 1, "cannot be judged": 1}
    assert results.study_links == {STUDIES["table1"]["title"]: "reports/table1.html"}
    assert [figure.name for figure in results.figures[STUDIES["table1"]["title"]]] == ["table1-order"]
    assert results.recording_links == {"A1": "reports/laboratory/A1.html"}
    recordings = results.recordings.set_index("recording")
    assert recordings.loc["A1", "recommended method"] == HOSTILE
    assert recordings["verdict"].tolist() == ["usable", "refused"]
    assert results.run_times == {}


def test_the_article_of_an_earlier_run_is_left_out(folder):
    results = collect(folder, has_article=False)
    assert list(results.links.values()) == ["tables.html", "configuration.json"]
    assert results.verdicts == {}
    assert "Ledger" not in render_index(results)


def test_a_folder_without_results_has_a_page_too(tmp_path):
    results = collect(tmp_path)
    assert list(results.links.values()) == ["tables.html"]
    assert results.figures == {}
    page = render_index(results)
    assert "There are no benchmark files" in page
    assert "<h2" in page
    assert "Ledger" not in page


def test_provenance_is_on_the_page(folder):
    page = render_index(collect(folder))
    for text in (
        "ankleloop 1.2.3",
        PROVENANCE.commit,
        "not committed",
        "3.11.2",
        "7: table1",
        "numpy 2.1",
        "&#34;run&#34;",
    ):
        assert text in page, text
