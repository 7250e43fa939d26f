"""The page that lists all results, and those of the ledger and of the tables, to which it links."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from markupsafe import Markup, escape

from ankleloop.pages.rendering import describe_table, render_page, render_template
from ankleloop.paper.judgement import (
    AT_TOLERANCE,
    BY_CONSTRUCTION,
    CONDITIONAL,
    CONTRADICTION,
    NOT_REPRODUCED,
    OPEN,
    REPRODUCED,
)
from ankleloop.paper.ledger import VERDICTS, Conclusions, count_held, summarise, tabulate_ledger, tabulate_table1

if TYPE_CHECKING:
    import pandas as pd

# Backgrounds that are told apart in print and by readers who do not see red or green; the words stand in them.
VERDICT_COLOURS = {
    REPRODUCED: "#b7dfc2",
    CONDITIONAL: "#dff0c8",
    AT_TOLERANCE: "#eef0c0",
    NOT_REPRODUCED: "#f3b8a6",
    OPEN: "#e3e3e3",
    CONTRADICTION: "#f6dd9b",
    BY_CONSTRUCTION: "#cfe0f5",
}
# Of the ledger, in their order: a narrow screen shows the first ones.
LEDGER_COLUMNS = ["verdict", "section", "statement", "paper", "ours", "unit", "reason", "difference", "tolerance", "id"]
MOST_ROWS, MOST_COLUMNS = 1000, 12  # of a table in its page; wider ones are divided
KEYS = 3  # columns that each part of a divided table has
SENTENCE = re.compile(r".{40,}?[.!?](?=\s|$)", re.DOTALL)  # of a caption, with what stands before it in short


@dataclass(frozen=True)
class Figure:
    """A figure of the results."""

    name: str  # its file without suffix
    picture: str  # path of the picture, relative to the page
    files: Mapping[str, str]  # paths of its other files by their kind
    caption: str  # what it shows; empty if not known

    @property
    def summary(self) -> str:
        """First sentence of the caption."""
        sentence = SENTENCE.match(self.caption)
        return sentence[0] if sentence else self.caption

    @property
    def details(self) -> str:
        """The other sentences."""
        return self.caption[len(self.summary) :].strip()


@dataclass(frozen=True)
class Results:
    """What a run has made, as far as it exists; tables as text."""

    links: Mapping[str, str]  # pages and files of the whole run by their description
    verdicts: Mapping[str, int]  # number of claims with each verdict of the ledger; empty without a ledger
    studies: pd.DataFrame  # a row for each study
    study_links: Sequence[str]  # page of each study; empty where it has none
    figures: Mapping[str, Sequence[Figure]]  # by the titles of their studies
    recordings: pd.DataFrame  # a row for each recording
    recording_links: Sequence[str]  # page of each recording; empty where it has none
    provenance: Sequence[tuple[str, str]]  # terms and texts


def render_index(results: Results, ledger: pd.DataFrame | None = None, conclusions: Conclusions | None = None) -> str:
    """Page that lists all results; it opens with what was found, where there is a ledger."""
    opening = None
    if ledger is not None:
        sentences = [_emphasise(text) for text in summarise(ledger, conclusions or {})]
        opening = {"sentences": sentences, "held": count_held(ledger), "table": describe_table1(ledger)}
    body = render_template(
        "index.html.j2",
        results=results,
        opening=opening,
        verdicts=_explain(results.verdicts),
        studies=describe_table(results.studies, results.study_links),
        recordings=describe_table(results.recordings, results.recording_links),
    )
    return render_page("Results", body, pictures_of_files=True)


def describe_table1(ledger: pd.DataFrame) -> dict[str, Any]:
    """Table 1 for the template `table.html.j2`, each cell in the colour of its verdict."""
    cells, verdicts = tabulate_table1(ledger)
    return describe_table(cells, colours={text: VERDICT_COLOURS[verdict] for text, verdict in verdicts.items()})


def _emphasise(text: str) -> Markup:
    """Markdown of a sentence as HTML: bold words and code."""
    marked = re.sub(r"\*\*(.+?)\*\*", r"<b>\1</b>", str(escape(text)))
    return Markup(re.sub(r"`(.+?)`", r"<code>\1</code>", marked))  # noqa: S704 # what is not ours has been escaped


def _explain(counts: Mapping[str, int]) -> dict[str, tuple[int, str, str]]:
    """Number, meaning and colour of each verdict."""
    return {verdict: (count, VERDICTS[verdict], VERDICT_COLOURS[verdict]) for verdict, count in counts.items()}


def render_ledger(ledger: pd.DataFrame) -> str:
    """Page of the ledger: each number and claim of the paper with its verdict in its colour."""
    body = render_template(
        "ledger.html.j2",
        held=count_held(ledger),
        verdicts=_explain(ledger["verdict"].value_counts().reindex(list(VERDICTS), fill_value=0).to_dict()),
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
