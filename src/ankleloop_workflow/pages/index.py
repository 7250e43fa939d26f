"""The page that lists all results, and that of the ledger, to which it links."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pandas as pd
from markupsafe import Markup, escape

from ankleloop_lab.pages.rendering import render_page, render_table, render_template
from ankleloop_workflow.pages import TEMPLATES
from ankleloop_workflow.paper.ledger import (
    FINDING,
    HOLDS,
    PAPER,
    VERDICTS,
    Conclusions,
    count_held,
    summarise,
    tabulate_ledger,
    tabulate_table1,
)

# Backgrounds that are told apart in print and by readers who do not see red or green; the words stand in them.
COLOURS = ("#b7dfc2", "#dff0c8", "#eef0c0", "#f3b8a6", "#e3e3e3", "#f6dd9b", "#cfe0f5")
VERDICT_COLOURS = dict(zip(VERDICTS, COLOURS, strict=True))
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


def render_table1(ledger: pd.DataFrame) -> Markup:
    """Table 1 as HTML, each cell in the colour of its verdict."""
    cells, verdicts = tabulate_table1(ledger)
    colours = {text: VERDICT_COLOURS[verdict] for text, verdict in verdicts.items()}
    return render_table(cells, colours=colours)


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
