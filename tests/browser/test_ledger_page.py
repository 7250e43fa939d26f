"""The ledger on a screen of 1,280 pixels: all columns at once, and a field that filters."""

import pandas as pd
import pytest

from ankleloop.pages.index import render_ledger
from ankleloop.replication.ledger import VERDICTS

SIZES = """() => {
  const table = document.querySelector("table.compact");
  const frame = document.querySelector(".scroll");
  return { wanted: table.scrollWidth, frame: frame.clientWidth, page: document.documentElement.scrollWidth };
}"""


@pytest.fixture
def ledger(tmp_path):
    """The page of a claim with each verdict, with texts as long as those of the paper."""
    row = {
        "section": "IV, Table 1",
        "statement": "PR-MOESP finds the intrinsic torque accurately in closed loop, with a basis that can form it",
        "unit": "% of K",
        "paper": 97.0,
        "ours": 97.86123,
        "uncertainty": 0.0912,
        "tolerance": 2.0,
        "difference": -82.456,
        "difference_low": -82.567,
        "difference_high": -69.612,
        "reason": "error of K against voluntary torque: +2.1 ± 2.6 % at 0 %, -3.5 ± 5.2 % at 25 %, by PR-MOESP. " * 3,
        "conditions": "reflex gain, load, actuator and voluntary torque assumed",
    }
    rows = [
        {"id": f"table{n}/parallel-cascade-one-pass/intrinsic", "verdict": v, **row} for n, v in enumerate(VERDICTS)
    ]
    path = tmp_path / "ledger.html"
    path.write_text(render_ledger(pd.DataFrame(rows)), encoding="utf-8")
    return path


def test_a_desktop_shows_all_columns(visit, ledger):
    sizes = visit(ledger).page.evaluate(SIZES)
    assert sizes["wanted"] <= sizes["frame"] <= sizes["page"] <= 1280


def test_a_phone_scrolls_the_table_and_not_the_page(new_visit, ledger):
    with new_visit("phone") as visited:
        sizes = visited.open(ledger).page.evaluate(SIZES)
    assert sizes["wanted"] > sizes["frame"]
    assert sizes["page"] <= 390


def test_a_word_leaves_its_rows(visit, ledger):
    page = visit(ledger).page
    page.fill("input.filter", "contradiction")
    assert page.locator("table.compact tbody tr:visible").count() == 1
