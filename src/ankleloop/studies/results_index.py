"""What a run has made, collected from its files for the page that lists all results.

Earlier runs may have left other files in the same folders: only those of the studies and of the jobs of the run count.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pandas as pd

from ankleloop.pages.index import Figure, Results
from ankleloop.paper.ledger import VERDICTS
from ankleloop.studies.provenance import Provenance

# Pages and files of the whole run, in the order of the list.
LINKS = {
    "Article: the replication in the order of the paper": "article.html",
    "Ledger: every number and claim of the paper with its verdict": "ledger.html",
    "Tables: to sort and search": "tables.html",
    "Ledger as CSV": "verification.csv",
    "Configuration with all defaults": "configuration.json",
    "Metadata of the run (RO-Crate)": "ro-crate-metadata.json",
}
OF_ARTICLE = {"article.html", "ledger.html", "verification.csv"}
MADE_WITH_INDEX = {"ledger.html", "tables.html"}
DIAGRAM_CAPTIONS = {
    "figure1": "The joint with its intrinsic and its reflex path.",
    "figure2": "The joint with its load in closed loop.",
}
MINUTE = 60.0  # s
NO_NUMBER = "–"
TIMES = {"s": "seconds", "cpu_time": "cpu_seconds", "max_rss": "memory"}  # columns of benchmark files

Studies = Mapping[
    str, Mapping[str, Any]
]  # for each its title, kind, points, methods, trials, seed, tables of recordings


def collect_results(
    folder: Path, studies: Studies, times: pd.DataFrame, provenance: Provenance, *, has_article: bool
) -> Results:
    """Collect what a run has made."""
    left_out = set() if has_article else OF_ARTICLE
    present = {path for path in LINKS.values() if path in MADE_WITH_INDEX or (folder / path).exists()} - left_out
    recordings = _tabulate_recordings(studies)
    return Results(
        links={text: path for text, path in LINKS.items() if path in present},
        verdicts=_count_verdicts(folder / "verification.csv") if has_article else {},
        studies=_tabulate_studies(studies, times),
        study_links=[_existing(folder, f"reports/{name}.html") for name in studies],
        figures=_collect_figures(folder, studies),
        recordings=recordings,
        recording_links=[
            _existing(folder, f"reports/{row.study}/{row.recording}.html") for row in recordings.itertuples()
        ],
        run_times=_tabulate_run_times(times),
        provenance=_describe_provenance(provenance, times, studies),
        details=_collect_details(folder, provenance),
    )


def read_tables(paths: Iterable[Path]) -> dict[str, pd.DataFrame]:
    """Tables as text for a page, without the columns in which no row has a value."""
    tables = {path.stem: pd.read_csv(path).dropna(axis="columns", how="all") for path in sorted(paths)}
    return {stem: table.map(_format_cell) for stem, table in tables.items()}


def read_run_times(folder: Path, jobs: Iterable[str]) -> pd.DataFrame:
    """Times and memory of jobs, from the benchmark files that Snakemake leaves beside their logs."""
    rows = []
    for path in (folder / f"{job}.tsv" for job in jobs):
        if path.exists():
            values = pd.read_csv(path, sep="\t", na_values="-").iloc[-1]
            rule, *study = path.relative_to(folder).with_suffix("").parts[:2]
            row = {"rule": rule, "study": "".join(study), "end": path.stat().st_mtime}
            rows.append(row | {name: float(values[column]) for column, name in TIMES.items()})
    return pd.DataFrame(rows, columns=["rule", "study", *TIMES.values(), "end"])


def measure_span(times: pd.DataFrame) -> tuple[datetime, datetime, float]:
    """When jobs ran, and how long [s]."""
    intervals = sorted(zip(times["end"] - times["seconds"], times["end"], strict=True))
    duration, covered = 0.0, intervals[0][0]
    for start, end in intervals:
        duration += max(0.0, end - max(start, covered))
        covered = max(covered, end)
    first, last = (datetime.fromtimestamp(value, UTC) for value in (intervals[0][0], covered))
    return first, last, duration


def _format_cell(value: Any) -> str:
    if pd.isna(value):
        return NO_NUMBER
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def _existing(folder: Path, path: str) -> str:
    """A path below the folder; empty where there is no such file."""
    return path if (folder / path).exists() else ""


def _count_verdicts(path: Path) -> dict[str, int]:
    counts = pd.read_csv(path)["verdict"].value_counts()
    return {verdict: int(counts.get(verdict, 0)) for verdict in VERDICTS}


def _tabulate_studies(studies: Studies, times: pd.DataFrame) -> pd.DataFrame:
    minutes = (times.groupby("study")["seconds"].sum() / MINUTE).map("{:.2f}".format)
    rows = [
        {
            "title": study["title"],
            "study": name,
            "data": study["kind"],
            "points": study["points"],
            "methods": study["methods"],
            "trials per point": NO_NUMBER if study["trials"] is None else study["trials"],
            "seed": NO_NUMBER if study["seed"] is None else study["seed"],
            "time of its jobs [min]": minutes.get(name, NO_NUMBER),
        }
        for name, study in studies.items()
    ]
    return pd.DataFrame(rows)


def _collect_figures(folder: Path, studies: Studies) -> dict[str, list[Figure]]:
    """Figures by headings, with the captions that their notebooks give them."""
    captions = {"Diagrams": DIAGRAM_CAPTIONS}
    for name, study in studies.items():
        path = folder / "rendered" / name / "captions.json"
        if path.exists():
            heading = f"{study['title']} ({name})" if study["title"] in captions else study["title"]
            captions[heading] = json.loads(path.read_text(encoding="utf-8"))
    figures = {
        heading: [_describe_figure(folder, name, text) for name, text in texts.items()]
        for heading, texts in captions.items()
    }
    present = {
        heading: [item for item in items if item.picture in item.files.values()] for heading, items in figures.items()
    }
    return {heading: items for heading, items in present.items() if items}


def _describe_figure(folder: Path, name: str, caption: str) -> Figure:
    paths = {kind: f"figures/{name}.{kind.lower()}" for kind in ("PNG", "PDF", "SVG", "CSV")}
    return Figure(name, paths["PNG"], {kind: path for kind, path in paths.items() if (folder / path).exists()}, caption)


def _tabulate_recordings(studies: Studies) -> pd.DataFrame:
    """A row for each recording with its verdict and the method that is recommended."""
    rows = []
    for study, files in ((name, study.get("recordings", ())) for name, study in studies.items()):
        for path in files:
            for recording, table in pd.read_parquet(path).groupby("recording", sort=False):
                first = table.iloc[0]
                labels = table.loc[table["recommended"].eq(True), "label"].tolist()
                groups = {key: _format_cell(first[key]) for key in ("subject", "condition", "trial")}
                row = {"recording": recording, "study": study, **groups, "verdict": first["verdict"]}
                rows.append({**row, "recommended method": ", ".join(labels) or NO_NUMBER})
    return pd.DataFrame(rows)


def _tabulate_run_times(times: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Sums over jobs, as text."""
    tables = {}
    for heading, by in {"By rule": "rule", "By study": "study"}.items() if len(times) else ():
        sums = times.groupby(by).agg(
            jobs=("seconds", "size"),
            seconds=("seconds", "sum"),
            longest=("seconds", "max"),
            cpu_seconds=("cpu_seconds", "sum"),
            memory=("memory", "max"),
        )
        sums = sums.sort_values("seconds", ascending=False, kind="stable").reset_index()
        tables[heading] = pd.DataFrame(
            {
                by: sums[by].replace("", "several studies"),
                "jobs": sums["jobs"],
                "sum [s]": sums["seconds"].map("{:.1f}".format),
                "longest job [s]": sums["longest"].map("{:.1f}".format),
                "processor time [s]": sums["cpu_seconds"].map("{:.1f}".format),
                "most memory of a job [MB]": sums["memory"].map("{:.0f}".format),
            }
        )
    return tables


def _describe_provenance(provenance: Provenance, times: pd.DataFrame, studies: Studies) -> list[tuple[str, str]]:
    commit = provenance.commit or "unknown: these files are no working copy of git"
    seeds: dict[int, list[str]] = {}
    for name, study in studies.items():
        if study["seed"] is not None:
            seeds.setdefault(study["seed"], []).append(name)
    items = [
        ("Version", f"ankleloop {provenance.version}"),
        ("Commit", commit + ", with changes that are not committed" * provenance.changed),
        ("Python", f"{provenance.python}, {provenance.system}"),
        ("Seeds", "; ".join(f"{seed}: {', '.join(names)}" for seed, names in seeds.items()) or "no simulated study"),
    ]
    if len(times):
        first, last, duration = measure_span(times)
        days = f"{first:%Y-%m-%d %H:%M} … {last:%Y-%m-%d %H:%M} UTC"
        items.append(("Jobs", f"{len(times)}, {days}; at least one of them ran during {duration / MINUTE:.1f} min"))
        sums = times[["seconds", "cpu_seconds"]].sum() / MINUTE
        items.append(("Time of all jobs", f"{sums.iloc[0]:.1f} min, processor time {sums.iloc[1]:.1f} min"))
    return items


def _collect_details(folder: Path, provenance: Provenance) -> dict[str, str]:
    packages = [f"{name} {version}" for name, version in provenance.packages.items()]
    details = {f"Packages ({len(packages)})": "\n".join(packages)}
    configuration = folder / "configuration.json"
    if configuration.exists():
        details["Configuration with all defaults"] = configuration.read_text(encoding="utf-8")
    return details
