"""Recordings from files to pages: checks, every valid method, export. A refused recording does not stop the others."""

import sys
from pathlib import Path

import pandas as pd
import pyarrow as pa

from ankleloop_lab.results import analyse_recordings
from ankleloop_workflow.jobs.job import log, running
from ankleloop_workflow.tables.trial_tables import save_table

with running(snakemake):
    folder = Path(snakemake.output.folder)
    folder.mkdir(parents=True, exist_ok=True)
    arguments = snakemake.params.arguments
    tables = []
    # Rule `publish` copies the pages to results/reports/{study}.
    results = analyse_recordings(folder=folder, index="../../index.html", **arguments)
    for name, outcome in results:
        tables.append(outcome)
        log.info("analysed %d of %d", len(tables), len(arguments["recordings"]))
        if outcome["verdict"].iloc[0] == "refused":
            print(f"{name} refused: {outcome['reasons'].iloc[0]}", file=sys.stderr)
    table = pd.concat(tables, ignore_index=True).replace("", None)
    rows = pa.Table.from_pandas(table, preserve_index=False)
    save_table(rows, snakemake.output.table)
