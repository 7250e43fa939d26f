"""The page that lists all results, and those of the ledger and of the tables, to which it links."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from markupsafe import Markup, escape

from ankleloop.pages.rendering import describe_table, render_page, render_template
from ankleloop.paper.ledger import VERDICTS, Conclusions, count_held, summarise, tabulate_ledger, tabulate_table1

if TYPE_CHECKING:
    import pandas as pd

# Backgrounds that are told apart in print and by readers who do not see red or green; the words stand in them.
COLOURS = ("#b7dfc2", "#dff0c8", "#eef0c0", "#f3b8a6", "#e3e3e3", "#f6dd9b", "#cfe0f5")
VERDICT_COLOURS = dict(zip(VERDICTS, COLOURS, strict=True))
# Of the ledger, in their order: a narrow screen shows the first ones.
LEDGER_COLUMNS = ["verdict", "section", "statement", "paper", "ours", "unit", "reason", "difference", "tolerance", "id"]
MOST_ROWS, MOST_COLUMNS = 1000, 12  # of a table in its page; wider ones are divided
KEYS = 3  # columns that each part of a divided table has


def render_index(
    results: Mapping[str, Any], ledger: pd.DataFrame | None = None, conclusions: Conclusions | None = None
) -> str:
    """Page that lists all results; it opens with what was found, where there is a ledger.

    The results are those of `ankleloop.studies.results.collect_results`.
    """
    opening = None
    if ledger is not None:
        sentences = [_emphasise(text) for text in summarise(ledger, conclusions or {})]
        opening = {"sentences": sentences, "held": count_held(ledger), "table": describe_table1(ledger)}
    tables = {
        "studies": describe_table(results["studies"], results["study_links"]),
        "recordings": describe_table(results["recordings"], results["recording_links"]),
    }
    verdicts = {} if ledger is None else _count_verdicts(ledger)
    body = render_template("index.html.j2", **{**results, **tables}, opening=opening, verdicts=verdicts)
    return render_page("Results", body, pictures_of_files=True)


def describe_table1(ledger: pd.DataFrame) -> dict[str, Any]:
    """Table 1 for the template `table.html.j2`, each cell in the colour of its verdict."""
    cells, verdicts = tabulate_table1(ledger)
    return describe_table(cells, colours={text: VERDICT_COLOURS[verdict] for text, verdict in verdicts.items()})


def _emphasise(text: str) -> Markup:
    """Markdown of a sentence as HTML: bold words and code."""
    marked = re.sub(r"\*\*(.+?)\*\*", r"<b>\1</b>", str(escape(text)))
    return Markup(re.sub(r"`(.+?)`", r"<code>\1</code>", marked))  # noqa: S704 # what is not ours has been escaped


def _count_verdicts(ledger: pd.DataFrame) -> dict[str, tuple[int, str, str]]:
    """Number, meaning and colour of each verdict."""
    counts = ledger["verdict"].value_counts()
    return {name: (int(counts.get(name, 0)), VERDICTS[name], VERDICT_COLOURS[name]) for name in VERDICTS}


def render_ledger(ledger: pd.DataFrame) -> str:
    """Page of the ledger: each number and claim of the paper with its verdict in its colour."""
    body = render_template(
        "ledger.html.j2",
        held=count_held(ledger),
        verdicts=_count_verdicts(ledger),
        table=describe_table(tabulate_ledger(ledger)[LEDGER_COLUMNS], colours=VERDICT_COLOURS, identifier="claims"),
    )
    return render_page("Ledger", body, index="index.html")


def render_tables(tables: Mapping[str, pd.DataFrame]) -> str:
    """Page of tables that readers sort and search."""
    described = {name: (_divide(table.head(MOST_ROWS), name), len(table)) for name, table in tables.items()}
    return render_page("Tables", render_template("tables.html.j2", tables=described), index="index.html")


def _divide(table: pd.DataFrame, name: str) -> list[dict[str, Any]]:
    """Parts of a table that fit into a page, each with the first columns."""
    keys, others, step = list(table.columns[:KEYS]), list(table.columns[KEYS:]), MOST_COLUMNS - KEYS
    parts = [table[keys + others[start : start + step]] for start in range(0, max(len(others), 1), step)]
    return [describe_table(part, identifier=f"table-{name}-{number}") for number, part in enumerate(parts)]
