"""Metadata of the run, and the page that lists all results with those of the ledger and of the tables."""

import json
from dataclasses import asdict
from pathlib import Path

import pandas as pd

from ankleloop.pages.index import render_index, render_ledger, render_tables
from ankleloop.paper.ledger import read_conclusions
from ankleloop.studies.provenance import read_provenance, write_crate
from ankleloop.studies.results_index import collect_results, read_run_times, read_tables
from ankleloop.trials.files import atomic_file

from job import running


def write_text(path: str, text: str) -> None:
    """Write a page, or the text of another file."""
    with atomic_file(path, overwrite=True) as partial:
        partial.write_text(text, encoding="utf-8")


with running(snakemake):
    output, studies = snakemake.output, snakemake.params.studies
    folder, logs = Path(output.index).parent, Path(snakemake.log[0]).parent
    provenance = read_provenance(snakemake.params.repository)
    for path, content in (
        (output.configuration, snakemake.params.configuration),
        (output.provenance, asdict(provenance)),
    ):
        write_text(path, json.dumps(content, indent=2, ensure_ascii=False) + "\n")
    seeds = {name: study["seed"] for name, study in studies.items() if study["seed"] is not None}
    write_crate(folder, snakemake.input.results, Path(output.configuration), provenance, seeds)
    names = [*studies, "economy"] if output.ledger else studies
    paths = [folder / "tables" / f"{name}.csv" for name in names]
    write_text(output.tables, render_tables(read_tables(path for path in paths if path.exists())))
    opening = []
    for path in output.ledger:  # none without the ledger
        ledger = pd.read_csv(folder / "verification.csv")
        write_text(path, render_ledger(ledger))
        opening = [ledger, read_conclusions(snakemake.input.conclusions)]
    times = read_run_times(logs, snakemake.params.jobs)
    results = collect_results(folder, studies, times, provenance, has_article=bool(output.ledger))
    write_text(output.index, render_index(results, *opening))
