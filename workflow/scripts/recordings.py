"""Recordings from files to pages: checks, every valid method, export. A refused recording does not stop the others."""

import sys
from pathlib import Path

import pandas as pd
import pyarrow as pa

from ankleloop.jobs.job import log, running
from ankleloop.jobs.recordings import analyse_recordings
from ankleloop.tables.trial_tables import save_table

with running(snakemake):
    folder = Path(snakemake.output.folder)
    folder.mkdir(parents=True, exist_ok=True)
    window = {name: snakemake.params.figure[name] for name in ("start", "length")}
    points = snakemake.params.points
    tables = []
    # Rule `publish` copies the pages to results/reports/{study}.
    results = analyse_recordings(
        points, snakemake.params.methods, folder, window, index="../../index.html"
    )
    for name, outcome in results:
        tables.append(outcome)
        log.info("analysed %d of %d", len(tables), len(points))
        if outcome["verdict"].iloc[0] == "refused":
            print(f"{name} refused: {outcome['reasons'].iloc[0]}", file=sys.stderr)
    table = pd.concat(tables, ignore_index=True).replace("", None)
    rows = pa.Table.from_pandas(table, preserve_index=False)
    save_table(rows, snakemake.output.table)
