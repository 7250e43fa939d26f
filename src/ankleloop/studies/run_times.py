"""Times and memory of the jobs of a run, from the benchmark files that Snakemake leaves beside their logs."""

from __future__ import annotations

import os
from datetime import UTC, datetime
from pathlib import Path

import pandas as pd

COLUMNS = {"s": "seconds", "cpu_time": "cpu_seconds", "max_rss": "memory"}


def read_run_times(folder: str | os.PathLike[str]) -> pd.DataFrame:
    """Read the benchmark files of a run."""
    folder = Path(folder)
    rows = []
    for path in sorted(folder.rglob("*.tsv")):
        table = pd.read_csv(path, sep="\t", na_values="-")
        if not set(COLUMNS) <= set(table) or table.empty:
            continue
        parts = path.relative_to(folder).with_suffix("").parts
        study = parts[1] if len(parts) > 1 else ""
        values = {name: float(table[column].iloc[-1]) for column, name in COLUMNS.items()}
        rows.append({"rule": parts[0], "study": study, **values, "end": path.stat().st_mtime})
    return pd.DataFrame(rows, columns=["rule", "study", *COLUMNS.values(), "end"])


def summarise_run_times(times: pd.DataFrame, by: str) -> pd.DataFrame:
    """Sums over jobs."""
    sums = times.groupby(by, sort=True).agg(
        jobs=("seconds", "size"),
        seconds=("seconds", "sum"),
        longest=("seconds", "max"),
        cpu_seconds=("cpu_seconds", "sum"),
        memory=("memory", "max"),
    )
    return sums.sort_values("seconds", ascending=False, kind="stable").reset_index()


def measure_span(times: pd.DataFrame) -> tuple[datetime, datetime, float] | None:
    """When jobs ran, and how long."""
    if times.empty:
        return None
    intervals = sorted(zip(times["end"] - times["seconds"], times["end"], strict=True))
    duration, covered = 0.0, intervals[0][0]
    for start, end in intervals:
        duration += max(0.0, end - max(start, covered))
        covered = max(covered, end)
    first, last = (datetime.fromtimestamp(value, UTC) for value in (intervals[0][0], covered))
    return first, last, duration
