"""The page that lists all results, and that of the ledger, to which it links."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pandas as pd
from markupsafe import escape

from ankleloop_lab.pages.page import render_page
from ankleloop_lab.pages.rendering import render_table, render_template
from ankleloop_workflow.pages import TEMPLATES
from ankleloop_workflow.pages.verdicts import COLOURS, VERDICT_COLOURS, render_table1
from ankleloop_workflow.paper.ledger import (
    FINDING,
    HOLDS,
    PAPER,
    VERDICTS,
    Conclusions,
    count_held,
    summarise,
    tabulate_ledger,
)

# Of the ledger, in their order: a narrow screen shows the first ones.
LEDGER_COLUMNS = [
    "verdict",
    "section",
    "statement",
    "paper",
    "ours",
    "unit",
    "reason",
    "difference",
    "tolerance",
    HOLDS,
    "id",
]


def render_index(
    results: Mapping[str, object],
    ledger: pd.DataFrame | None,
    conclusions: Conclusions,
    failures: Sequence[Mapping[str, str]] = (),
) -> str:
    """Page that lists all results; it opens with what failed, or with what was found, where there is a ledger.

    The results are those of `ankleloop_workflow.jobs.results.collect_results`, the failures those of
    `ankleloop_workflow.jobs.index.list_failures`.
    """
    opening: dict[str, object] = {}
    if ledger is not None:
        # Here: a package of the workflow, which the library does without.
        from nbconvert.filters import markdown2html

        sentences = "".join(f"- {escape(text)}\n" for text in summarise(ledger, conclusions))
        opening = {
            **_describe_verdicts(ledger),
            "sentences": markdown2html(sentences),
            "table1": render_table1(ledger),
        }
    body = render_template(
        "index.html.j2", TEMPLATES, **results, opening=opening, failures=failures
    )
    return render_page("Results", body, local_pictures=True)


def _describe_verdicts(ledger: pd.DataFrame) -> dict[str, object]:
    """What holds, and each verdict with its numbers of claims of the paper and of findings, its meaning and colour."""
    counts = pd.crosstab(ledger["verdict"], ledger["source"])
    counts = counts.reindex(index=list(VERDICTS), columns=[PAPER, FINDING], fill_value=0)
    columns = (VERDICTS, counts[PAPER], counts[FINDING], VERDICTS.values(), COLOURS)
    return {"held": count_held(ledger), "verdicts": list(zip(*columns, strict=True))}


def render_ledger(ledger: pd.DataFrame) -> str:
    """Page of the ledger: each number and claim of the paper with its verdict in its colour."""
    cells = tabulate_ledger(ledger)[LEDGER_COLUMNS]
    table = render_table(cells, colours=VERDICT_COLOURS, name="claims")
    body = render_template("ledger.html.j2", TEMPLATES, **_describe_verdicts(ledger), table=table)
    return render_page("Ledger", body, index="index.html")
