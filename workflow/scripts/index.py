"""Metadata of the run, and the page that lists all results with that of the ledger."""

import json
from pathlib import Path

import pandas as pd

from ankleloop.trials.files import atomic_file
from ankleloop_lab.provenance import read_provenance
from ankleloop_workflow.jobs.crate import write_crate
from ankleloop_workflow.jobs.index import write_index
from ankleloop_workflow.jobs.job import running
from ankleloop_workflow.jobs.results import report_versions
from ankleloop_workflow.pages.index import render_ledger


def write_text(path: str, text: str) -> None:
    """Write a page, or the text of another file."""
    with atomic_file(path, overwrite=True) as partial:
        partial.write_text(text, encoding="utf-8")


def write_json(path: str, content: dict) -> None:
    """Write a file of metadata."""
    write_text(path, json.dumps(content, indent=2, ensure_ascii=False) + "\n")


with running(snakemake):
    output = snakemake.output
    folder = Path(output.index).parent
    provenance = report_versions(
        read_provenance(snakemake.params.repository),
        tables=[*snakemake.input.trial_tables, *snakemake.input.tables],
    )
    write_json(output.configuration, snakemake.params.configuration)
    write_json(output.provenance, provenance)
    ledger = pd.read_csv(snakemake.input.ledger[0]) if output.ledger else None
    for path in output.ledger:
        write_text(path, render_ledger(ledger))
    results = write_index(
        folder,
        snakemake.params.studies,
        recordings=map(Path, snakemake.input.tables),
        provenance=provenance,
        conclusions=snakemake.input.conclusions,
        ledger=ledger,
    )
    figures = [figure for part in results["figures"].values() for figure in part]
    linked = [path for figure in figures for path in figure["files"].values()]
    linked += [*results["tables"], *results["links"].values()]
    write_crate(
        folder,
        Path(snakemake.params.repository),
        provenance,
        recordings=snakemake.params.recordings,
        configurations=snakemake.params.configurations,
        results=[*snakemake.input.results, output.index, *[folder / path for path in linked]],
    )
