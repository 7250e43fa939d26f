"""Recordings from files to pages: checks, every valid method, export. A refused recording does not stop the others."""

import sys
from pathlib import Path

import pandas as pd
import pyarrow as pa

from ankleloop.paper.trial_tables import save_table
from ankleloop.studies.job import log, running
from ankleloop.studies.recordings import analyse_recordings

with running(snakemake):
    folder = Path(snakemake.output.folder)
    folder.mkdir(parents=True, exist_ok=True)
    window = {name: snakemake.params.figure[name] for name in ("start", "length")}
    points, tables = snakemake.params.points, []
    # Rule `publish` copies the pages to results/reports/{study}.
    results = analyse_recordings(
        points, snakemake.params.methods, folder, window, index="../../index.html"
    )
    for name, table in results:
        tables.append(table)
        log.info("analysed %d of %d", len(tables), len(points))
        if table["verdict"].iloc[0] == "refused":
            print(f"{name} refused: {table['reasons'].iloc[0]}", file=sys.stderr)
    rows = pa.Table.from_pandas(
        pd.concat(tables, ignore_index=True).replace("", None), preserve_index=False
    )
    save_table(rows, snakemake.output.table, snakemake.params.settings)
