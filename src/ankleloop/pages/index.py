"""The page that lists all results, and those of the ledger and of the tables, to which it links."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from ankleloop.pages.rendering import render_page, render_template
from ankleloop.pages.tables import describe_table
from ankleloop.paper.judgement import (
    BY_CONSTRUCTION,
    CONDITIONAL,
    CONTRADICTION,
    NOT_REPRODUCED,
    OPEN,
    REPRODUCED,
)
from ankleloop.paper.ledger import VERDICTS, tabulate_ledger

if TYPE_CHECKING:
    import pandas as pd

# Backgrounds that are told apart in print and by readers who do not see red or green; the words stand in them.
VERDICT_COLOURS = {
    REPRODUCED: "#b7dfc2",
    CONDITIONAL: "#dff0c8",
    NOT_REPRODUCED: "#f3b8a6",
    OPEN: "#e3e3e3",
    CONTRADICTION: "#f6dd9b",
    BY_CONSTRUCTION: "#cfe0f5",
}
# Of the ledger, in their order: a narrow screen shows the first ones.
LEDGER_COLUMNS = ["verdict", "section", "statement", "paper", "ours", "unit", "reason", "difference", "tolerance", "id"]
MOST_ROWS = 1000  # of a table in its page


@dataclass(frozen=True)
class Figure:
    """A figure of the results."""

    name: str  # its file without suffix
    picture: str  # path of the picture, relative to the page
    files: Mapping[str, str]  # paths of its other files by their kind
    caption: str  # what it shows; empty if not known


@dataclass(frozen=True)
class Results:
    """What a run has made, as far as it exists.

    Parameters
    ----------
    links : dict of str to str
        Pages and files of the whole run by their description.
    verdicts : dict of str to int
        Number of claims with each verdict of the ledger; empty without a ledger.
    studies : pandas.DataFrame
        A row for each study, as text.
    study_links : sequence of str
        Page of each study; empty where it has none.
    figures : dict of str to list of Figure
        Figures by the headings of their studies.
    recordings : pandas.DataFrame
        A row for each recording, as text.
    recording_links : sequence of str
        Page of each recording; empty where it has none.
    run_times : dict of str to pandas.DataFrame
        Tables of times, as text, by their headings.
    provenance : list of (str, str)
        Terms and texts.
    details : dict of str to str
        Long texts by their headings, such as the configuration.
    """

    links: Mapping[str, str]
    verdicts: Mapping[str, int]
    studies: pd.DataFrame
    study_links: Sequence[str]
    figures: Mapping[str, Sequence[Figure]]
    recordings: pd.DataFrame
    recording_links: Sequence[str]
    run_times: Mapping[str, pd.DataFrame]
    provenance: Sequence[tuple[str, str]]
    details: Mapping[str, str] = field(default_factory=dict)


def render_index(results: Results) -> str:
    """Page that lists all results."""
    body = render_template(
        "index.html.j2",
        results=results,
        verdicts={
            verdict: (count, VERDICTS[verdict], VERDICT_COLOURS[verdict]) for verdict, count in results.verdicts.items()
        },
        studies=describe_table(results.studies, results.study_links),
        recordings=describe_table(results.recordings, results.recording_links),
        run_times={heading: describe_table(table) for heading, table in results.run_times.items()},
    )
    return render_page("Results", body, pictures_of_files=True)


def render_ledger(ledger: pd.DataFrame) -> str:
    """Page of the ledger: each number and claim of the paper with its verdict in its colour."""
    counts = ledger["verdict"].value_counts()
    body = render_template(
        "ledger.html.j2",
        count=len(ledger),
        verdicts={
            verdict: (int(counts.get(verdict, 0)), meaning, VERDICT_COLOURS[verdict])
            for verdict, meaning in VERDICTS.items()
        },
        table=describe_table(
            tabulate_ledger(ledger)[LEDGER_COLUMNS], colours=VERDICT_COLOURS, identifier="claims", compact=True
        ),
    )
    return render_page("Ledger", body, index="index.html", wide=True)


def render_tables(tables: Mapping[str, pd.DataFrame]) -> str:
    """Page of tables that readers sort and search."""
    described = {
        name: (describe_table(table.head(MOST_ROWS), identifier=f"table-{name}"), len(table))
        for name, table in tables.items()
    }
    return render_page("Tables", render_template("tables.html.j2", tables=described), index="index.html", wide=True)
