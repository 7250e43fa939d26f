"""Conclusions stand where the ledger has their verdict, and give way to the verdict of the run elsewhere."""

import pandas as pd
import pytest
from synthetic_results import PUBLISHED, build_ledger

from ankleloop_workflow.paper.judgement import CONDITIONAL, NOT_REPRODUCED
from ankleloop_workflow.paper.ledger import conclude, read_conclusions, summarise, tabulate_table1

CONCLUSIONS = read_conclusions(PUBLISHED.parent / "conclusions.yaml")


@pytest.fixture(scope="module")
def ledger():
    return build_ledger(spread=0.01).reset_index()


def test_a_paragraph_stands_for_its_verdict_alone(ledger):
    texts = {"pr-unbiased": {"verdict": CONDITIONAL, "paragraph": "K is off by {ours:.1f} %."}}
    row = ledger.loc[ledger["id"] == "pr-unbiased"].iloc[0]
    ledger = ledger.assign(
        verdict=ledger["verdict"].mask(ledger["id"] == "pr-unbiased", CONDITIONAL)
    )
    assert conclude(ledger, texts, "pr-unbiased") == f"K is off by {row['ours']:.1f} %."
    other = ledger.assign(verdict=NOT_REPRODUCED)
    text = conclude(other, texts, "pr-unbiased")
    assert text == f"**{row['statement']}: not reproduced in this run.** {row['reason']}"
    assert conclude(ledger[ledger["id"] != "pr-unbiased"], texts, "pr-unbiased") == ""


def test_the_opening_has_a_sentence_for_each_claim_of_the_run(ledger):
    judged = set(ledger.loc[ledger["ours"].notna(), "id"])  # not of settings that are drawn
    sentences = [
        claim
        for claim, conclusion in CONCLUSIONS.items()
        if "sentence" in conclusion and claim in judged
    ]
    assert 3 <= len(sentences) <= 5
    assert len(summarise(ledger, CONCLUSIONS)) == len(sentences)
    assert (
        summarise(ledger[ledger["id"] != sentences[0]], CONCLUSIONS)
        == summarise(ledger, CONCLUSIONS)[1:]
    )


def test_table_1_stands_as_the_paper_prints_it(ledger):
    cells, verdicts = tabulate_table1(ledger)
    assert list(cells) == ["method", "net [% VAF]", "intrinsic [% VAF]", "reflex [% VAF]"]
    assert cells.shape == (3, 4)
    assert cells["net [% VAF]"].iloc[0].startswith("92 → 92.00 ± 0.")
    assert set(verdicts) == set(cells.iloc[:, 1:].to_numpy().ravel())
    nothing = pd.DataFrame(ledger).assign(ours=float("nan"))
    assert tabulate_table1(nothing)[0]["net [% VAF]"].iloc[0] == "92 → –"
