"""The page that lists all results: after a run, or after one that failed, which it says."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from ankleloop.trials.files import PathLike, atomic_file
from ankleloop_lab.provenance import read_provenance
from ankleloop_workflow.jobs.results import (
    METADATA,
    Provenance,
    Study,
    collect_results,
    tabulate_recordings,
)
from ankleloop_workflow.pages.index import render_index
from ankleloop_workflow.paper.ledger import read_conclusions

# A failed job in the log of Snakemake, and the line of its own log that says why.
FAILED_JOB = re.compile(r"^Error in rule (?P<rule>\w+):\n(?P<lines>(?:    .*\n)*)", re.MULTILINE)
JOB_LOG = re.compile(r"^    log: (\S+)", re.MULTILINE)
REASON = re.compile(r"^[\d-]+ [\d:,]+ (rule .*)$", re.MULTILINE)


def write_index(
    folder: Path,
    studies: Sequence[Study],
    recordings: Iterable[Path],
    provenance: Provenance,
    conclusions: PathLike,
    ledger: pd.DataFrame | None,
    failures: Sequence[Mapping[str, str]] = (),
) -> dict[str, Any]:
    """Write the page that lists what lies in the folder of results, and return what it lists.

    `recordings` are tables of scores; `failures` are those of `list_failures`, where the run has failed.
    """
    table = tabulate_recordings(recordings)
    results = collect_results(folder, studies, table, provenance, ledger)
    page = render_index(results, ledger, read_conclusions(conclusions), failures)
    with atomic_file(folder / "index.html", overwrite=True) as partial:
        partial.write_text(page, encoding="utf-8")
    return results


def write_failed_index(
    logs: Iterable[PathLike],
    studies: Sequence[Study],
    recordings: Iterable[str],
    repository: Path,
    *,
    has_article: bool,
) -> None:
    """Write the page of results after a run that failed: what failed and why, and what lies in the folder all the same.

    The metadata of an earlier run go, since they describe other results; the next run makes them and the page again.
    """
    failures = list_failures(logs)
    folder = Path("results")
    if not failures or not folder.exists():
        return
    (folder / METADATA).unlink(missing_ok=True)
    ledger = folder / "verification.csv"
    write_index(
        folder,
        studies,
        recordings=filter(Path.exists, map(Path, recordings)),
        provenance=read_provenance(repository),
        conclusions=repository / "data" / "conclusions.yaml",
        ledger=pd.read_csv(ledger) if has_article and ledger.exists() else None,
        failures=failures,
    )


def list_failures(logs: Iterable[PathLike]) -> list[dict[str, str]]:
    """Jobs that failed by the logs of Snakemake: the rule, the log of the job, and the reason that stands there."""
    failures = {}
    content = "".join(Path(log).read_text(encoding="utf-8") for log in logs)
    for job in FAILED_JOB.finditer(content):
        path = JOB_LOG.search(job["lines"])
        name = path[1] if path else ""
        text = Path(name).read_text(encoding="utf-8") if name and Path(name).exists() else ""
        reasons = REASON.findall(text)
        reason = (
            reasons[-1] if reasons else "it was stopped from outside, or failed before its work"
        )
        failures[name or job["rule"]] = {"rule": job["rule"], "log": name, "reason": reason}
    return list(failures.values())
