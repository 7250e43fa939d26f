"""The page that lists all results, and those of the ledger and of the tables."""

from pathlib import Path

import pandas as pd

from ankleloop.pages.index import render_index, render_ledger, render_tables
from ankleloop.studies.provenance import load_provenance
from ankleloop.studies.results_index import collect_results, read_tables
from ankleloop.trials.files import atomic_file

from job import running


def write_page(path: str, page: str) -> None:
    """Write a page."""
    with atomic_file(path, overwrite=True) as partial:
        partial.write_text(page, encoding="utf-8")


with running(snakemake):
    folder, logs = Path(snakemake.params.folder), Path(snakemake.log[0]).parent
    provenance = load_provenance(snakemake.input.provenance)
    write_page(snakemake.output.tables, render_tables(read_tables(folder)))
    for path in snakemake.output.ledger:  # none without the ledger
        write_page(path, render_ledger(pd.read_csv(folder / "verification.csv")))
    has_article = bool(snakemake.output.ledger)
    results = collect_results(folder, logs, snakemake.params.studies, provenance, has_article=has_article)
    write_page(snakemake.output.index, render_index(results))
