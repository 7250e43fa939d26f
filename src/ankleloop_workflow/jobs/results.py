"""Where the results of a run come from, as a Research Object Crate, and what it has made, for the page that lists them.

Earlier runs may have left other files in the same folders: those of the studies and of the jobs of the run count, and
pages of earlier runs are listed as such.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence, Set
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pandas as pd

from ankleloop.trials.files import PathLike
from ankleloop_workflow.tables.trial_tables import list_versions

TITLE = "Results of ankleloop: intrinsic and reflex joint stiffness identified in closed loop"
METADATA = "ro-crate-metadata.json"  # of the run, written after its pages
# Pages and files of the whole run, in the order of the list.
LINKS = {
    "Article: the replication in the order of the paper": "article.html",
    "Ledger: numbers and claims of the paper with their verdicts": "ledger.html",
    "Ledger as CSV": "verification.csv",
    "Configuration with all defaults": "configuration.json",
    "Versions of all packages": "provenance.json",
    "Metadata of the run (RO-Crate)": METADATA,
}
OF_ARTICLE = {"article.html", "ledger.html", "verification.csv"}
DIAGRAM_CAPTIONS = {
    "figure1": "The joint with its intrinsic and its reflex path.",
    "figure2": "The joint with its load in closed loop.",
}
FIGURE_KINDS = ("PNG", "PDF", "SVG", "CSV")
NO_NUMBER = "–"
# Columns of the table of studies, by what they are made of.
STUDY_COLUMNS = {
    "title": "title",
    "study": "study",
    "kind": "data",
    "points": "points",
    "labels": "methods",
    "trials_per_point": "trials per point",
    "seed": "seed",
}

Provenance = Mapping[str, Any]
Figures = dict[str, list[dict[str, Any]]]  # by heading
Study = Mapping[str, Any]  # as `ankleloop_workflow.config.study.Study.describe` does


def describe_version(provenance: Provenance) -> str:
    """Version and commit of the program, and whether its files differ from the commit, as PEP 440 writes them."""
    local = [provenance["commit"][:12], "changed" if provenance["changed"] else ""]
    return "+".join(filter(None, [provenance["version"], ".".join(filter(None, local))]))


def report_versions(provenance: Provenance, tables: Iterable[PathLike]) -> Provenance:
    """Provenance with the versions that made tables, several where they differ, in the place of those installed now."""
    made = pd.DataFrame(list_versions(tables))
    versions = {name: " and ".join(sorted(set(made[name]))) for name in made}
    return {**provenance, "packages": {**provenance["packages"], **versions}}


def collect_results(
    folder: Path,
    studies: Sequence[Study],
    recordings: pd.DataFrame,
    provenance: Provenance,
    ledger: pd.DataFrame | None = None,
) -> dict[str, Any]:
    """Collect what a run has made, as far as it exists: links, tables as text, figures and provenance."""

    def find(path: str) -> str:
        """A path below the folder; empty where there is no such file."""
        return path if (folder / path).exists() else ""

    table = pd.DataFrame(studies, columns=list(STUDY_COLUMNS), dtype=object)
    for name in ("points", "labels"):
        table[name] = table[name].map(len)
    left_out = OF_ARTICLE if ledger is None else set()
    return {
        "links": {
            text: path
            for text, path in LINKS.items()
            if path not in left_out and (find(path) or path == METADATA)
        },
        "earlier": _list_earlier(folder, set(table["study"]), left_out),
        "tables": list(
            filter(find, [f"tables/{name}.csv" for name in (*table["study"], "economy")])
        ),
        "trial_tables": list(
            filter(find, [f"tables/{name}-trials.parquet" for name in table["study"]])
        ),
        "studies": table.map(_format_cell).rename(columns=STUDY_COLUMNS),
        "study_links": [find(f"reports/{name}.html") for name in table["study"]],
        "figures": _collect_figures(folder, studies),
        "recordings": recordings,
        "recording_links": [
            find(f"reports/{row.study}/{row.recording}.html") for row in recordings.itertuples()
        ],
        "provenance": {
            "Version": f"ankleloop {describe_version(provenance)}",
            "Python": f"{provenance['python']}, {provenance['system']}",
            "Made": f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
            "Trials and estimates on disk": _measure_size(folder / "trials", folder / "estimates"),
        },
    }


def _measure_size(*folders: Path) -> str:
    """Size of all files in some folders."""
    files = (path for folder in folders for path in folder.rglob("*") if path.is_file())
    return f"{sum(path.stat().st_size for path in files) / 1e6:,.0f} MB"


def _list_earlier(folder: Path, studies: Set[str], left_out: Set[str]) -> dict[str, str]:
    """Pages that earlier runs have left in the folder, by what they are."""
    links = {text: path for text, path in LINKS.items() if path in left_out}
    for page in sorted(folder.glob("reports/*.html")):
        if page.stem not in studies:
            links[f"Study {page.stem}"] = f"reports/{page.name}"
    return {text: path for text, path in links.items() if (folder / path).exists()}


def _format_cell(value: Any) -> str:
    if pd.isna(value):
        return NO_NUMBER
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def _collect_figures(folder: Path, studies: Iterable[Study]) -> Figures:
    """Figures by headings, with the captions that their notebooks give them."""
    captions = [("Diagrams", "", DIAGRAM_CAPTIONS)]
    for study in studies:
        name = study["study"]
        path = folder / "rendered" / name / "captions.json"
        if path.exists():
            captions.append((study["title"], name, json.loads(path.read_text(encoding="utf-8"))))
    figures: Figures = {}
    for heading, study_name, texts in captions:
        for name, caption in texts.items():
            paths = {kind: f"figures/{name}.{kind.lower()}" for kind in FIGURE_KINDS}
            files = {kind: path for kind, path in paths.items() if (folder / path).exists()}
            if "PNG" in files:
                figure = {"name": name, "study": study_name, "files": files, "caption": caption}
                figures.setdefault(heading, []).append(figure)
    return figures


def tabulate_recordings(paths: Iterable[Path]) -> pd.DataFrame:
    """A row for each recording with its verdict and the method that is recommended.

    `paths` are tables of scores, in folders with the names of their studies.
    """
    groups = ["subject", "condition", "trial", "verdict"]
    # Where all recordings of a chunk are refused, their table has no methods.
    columns = ["recording", *groups, "label", "recommended"]
    rows = []
    for path in paths:
        tables = pd.read_parquet(path).reindex(columns=columns)
        for recording, table in tables.groupby("recording", sort=False):
            labels = table.loc[table["recommended"].eq(True), "label"]
            rows.append(
                {
                    "recording": recording,
                    "study": path.parent.name,
                    **table[groups].iloc[0].map(_format_cell),
                    "recommended method": ", ".join(labels) or NO_NUMBER,
                }
            )
    return pd.DataFrame(rows)
