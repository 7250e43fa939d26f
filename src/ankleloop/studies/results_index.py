"""What a run has made, collected from its files for the page that lists all results."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from ankleloop.pages.index import Figure, Results
from ankleloop.paper.ledger import VERDICTS
from ankleloop.studies.provenance import Provenance
from ankleloop.studies.run_times import measure_span, read_run_times, summarise_run_times

# Pages and files of the whole run, in the order of the list.
LINKS = {
    "Article: the replication in the order of the paper": "article.html",
    "Ledger: every number and claim of the paper with its verdict": "ledger.html",
    "Tables: to sort and search": "tables.html",
    "Ledger as CSV": "verification.csv",
    "Configuration with all defaults": "configuration.json",
    "Metadata of the run (RO-Crate)": "ro-crate-metadata.json",
    "Comparison with other programs": "benchmarks/peers.md",
}
OF_ARTICLE = ("article.html", "ledger.html", "verification.csv")
DIAGRAMS = "Diagrams"
DIAGRAM_CAPTIONS = {
    "figure1": "The joint with its intrinsic and its reflex path.",
    "figure2": "The joint with its load in closed loop.",
}
MINUTE = 60.0  # s
HIDDEN = ("-trials",)  # tables of all trials: too long for a page
NO_NUMBER = "–"


def collect_results(
    folder: Path, logs: Path, studies: Mapping[str, Mapping[str, Any]], provenance: Provenance, *, has_article: bool
) -> Results:
    """Collect what a run has made."""
    times = read_run_times(logs)
    links = {text: path for text, path in LINKS.items() if (folder / path).exists()}
    # The pages of the index itself are made with it.
    links |= {text: path for text, path in LINKS.items() if path == "tables.html" or _is_ledger(path, folder)}
    if not has_article:
        links = {text: path for text, path in links.items() if path not in OF_ARTICLE}
    recordings, recording_links = _collect_recordings(folder, studies)
    return Results(
        links={text: links[text] for text in LINKS if text in links},
        verdicts=_count_verdicts(folder / "verification.csv") if has_article else {},
        studies=_tabulate_studies(studies, times),
        study_links=_collect_study_links(folder, studies),
        figures=_collect_figures(folder, studies),
        recordings=recordings,
        recording_links=recording_links,
        run_times=_tabulate_run_times(times),
        provenance=_describe_provenance(provenance, times, studies),
        details=_collect_details(folder, provenance),
    )


def read_tables(folder: Path) -> dict[str, pd.DataFrame]:
    """Tables of a run as text, short enough for a page."""
    paths = [path for path in sorted((folder / "tables").glob("*.csv")) if not path.stem.endswith(HIDDEN)]
    return {path.stem: _format_table(pd.read_csv(path)) for path in paths}


def _format_table(table: pd.DataFrame) -> pd.DataFrame:
    """A table as text; a column in which no row has a value is left out."""
    table = table.dropna(axis="columns", how="all")
    return pd.DataFrame({name: [_format_cell(value) for value in table[name]] for name in table.columns})


def _format_cell(value: Any) -> str:
    if pd.isna(value):
        return NO_NUMBER
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def _is_ledger(path: str, folder: Path) -> bool:
    return path == "ledger.html" and (folder / "verification.csv").exists()


def _count_verdicts(path: Path) -> dict[str, int]:
    """Number of claims with each verdict; empty without a ledger."""
    if not path.exists():
        return {}
    counts = pd.read_csv(path)["verdict"].value_counts()
    return {verdict: int(counts.get(verdict, 0)) for verdict in VERDICTS}


def _tabulate_studies(studies: Mapping[str, Mapping[str, Any]], times: pd.DataFrame) -> pd.DataFrame:
    sums = times.groupby("study")["seconds"].sum()
    rows = [
        {
            "title": study["title"],
            "study": name,
            "data": study["kind"],
            "points": str(study["points"]),
            "methods": str(study["methods"]),
            "trials per point": NO_NUMBER if study["trials"] is None else str(study["trials"]),
            "seed": NO_NUMBER if study["seed"] is None else str(study["seed"]),
            "time of its jobs [min]": f"{sums[name] / MINUTE:.2f}" if name in sums else NO_NUMBER,
        }
        for name, study in studies.items()
    ]
    return pd.DataFrame(rows)


def _collect_study_links(folder: Path, studies: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    paths = {study["title"]: f"reports/{name}.html" for name, study in studies.items()}
    return {title: path for title, path in paths.items() if (folder / path).exists()}


def _collect_figures(folder: Path, studies: Mapping[str, Mapping[str, Any]]) -> dict[str, list[Figure]]:
    """Figures by the titles of their studies, with the captions that their notebooks give them."""
    figures = {DIAGRAMS: [_describe_figure(folder, name, text) for name, text in DIAGRAM_CAPTIONS.items()]}
    for name, study in studies.items():
        path = folder / "rendered" / name / "captions.json"
        captions = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
        figures.setdefault(study["title"], []).extend(
            _describe_figure(folder, figure, caption) for figure, caption in captions.items()
        )
    present = {
        title: [figure for figure in items if (folder / figure.picture).exists()] for title, items in figures.items()
    }
    return {title: items for title, items in present.items() if items}


def _describe_figure(folder: Path, name: str, caption: str) -> Figure:
    paths = {kind: f"figures/{name}.{kind.lower()}" for kind in ("PNG", "PDF", "SVG", "CSV")}
    return Figure(name, paths["PNG"], {kind: path for kind, path in paths.items() if (folder / path).exists()}, caption)


def _collect_recordings(folder: Path, studies: Mapping[str, Mapping[str, Any]]) -> tuple[pd.DataFrame, dict[str, str]]:
    """A row for each recording with its verdict and the method that is recommended, and the pages."""
    rows, links = [], {}
    for name in (name for name, study in studies.items() if study["kind"] == "recordings"):
        for path in sorted((folder / "parameters" / name).glob("*.csv")):
            for recording, table in pd.read_csv(path, dtype={"recording": str}).groupby("recording", sort=False):
                first = table.iloc[0]
                recommended = table.get("recommended", pd.Series(False, index=table.index)).eq(True)
                labels = table.loc[recommended, "label"] if recommended.any() else [NO_NUMBER]
                groups = {key: _format_cell(first.get(key)) for key in ("subject", "condition", "trial")}
                row = {"recording": str(recording), "study": name, **groups, "verdict": str(first["verdict"])}
                rows.append({**row, "recommended method": ", ".join(map(str, labels))})
                page = f"reports/{name}/{recording}.html"
                if (folder / page).exists():
                    links[str(recording)] = page
    return pd.DataFrame(rows), links


def _tabulate_run_times(times: pd.DataFrame) -> dict[str, pd.DataFrame]:
    if times.empty:
        return {}
    headings = {"rule": "By rule", "study": "By study"}
    return {heading: _format_times(summarise_run_times(times, by), by) for by, heading in headings.items()}


def _format_times(table: pd.DataFrame, by: str) -> pd.DataFrame:
    columns = {"seconds": "sum [s]", "longest": "longest job [s]", "cpu_seconds": "processor time [s]"}
    formatted = {by: table[by].replace("", "several studies"), "jobs": table["jobs"].astype(str)}
    formatted |= {heading: table[name].map("{:.1f}".format) for name, heading in columns.items()}
    return pd.DataFrame({**formatted, "most memory of a job [MB]": table["memory"].map("{:.0f}".format)})


def _describe_provenance(
    provenance: Provenance, times: pd.DataFrame, studies: Mapping[str, Mapping[str, Any]]
) -> list[tuple[str, str]]:
    commit = provenance.commit or "unknown: these files are no working copy of git"
    items = [
        ("Version", f"ankleloop {provenance.version}"),
        ("Commit", commit + (", with changes that are not committed" if provenance.changed else "")),
        ("Python", f"{provenance.python}, {provenance.system}"),
        ("Seeds", _describe_seeds(studies)),
    ]
    span = measure_span(times)
    if span is not None:
        first, last, duration = span
        days = f"{first:%Y-%m-%d %H:%M} … {last:%Y-%m-%d %H:%M} UTC"
        items.append(("Jobs", f"{len(times)}, {days}; at least one of them ran during {duration / MINUTE:.1f} min"))
        sums = times[["seconds", "cpu_seconds"]].sum() / MINUTE
        items.append(("Time of all jobs", f"{sums.iloc[0]:.1f} min, processor time {sums.iloc[1]:.1f} min"))
    return items


def _describe_seeds(studies: Mapping[str, Mapping[str, Any]]) -> str:
    seeds: dict[Any, list[str]] = {}
    for name, study in studies.items():
        if study["seed"] is not None:
            seeds.setdefault(study["seed"], []).append(name)
    return "; ".join(f"{seed}: {', '.join(names)}" for seed, names in seeds.items()) or "no simulated study"


def _collect_details(folder: Path, provenance: Provenance) -> dict[str, str]:
    packages = [f"{name} {version}" for name, version in provenance.packages.items()]
    details = {f"Packages ({len(packages)})": "\n".join(packages)}
    configuration = folder / "configuration.json"
    if configuration.exists():
        details["Configuration with all defaults"] = configuration.read_text(encoding="utf-8")
    return details
