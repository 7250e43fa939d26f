"""Recordings from files to pages: checks, every valid method, export. A refused recording does not stop the others."""

import sys
from pathlib import Path

import pandas as pd

from ankleloop.studies.recordings import analyse_recordings
from ankleloop.trials.files import atomic_file

from job import progress, running

with running(snakemake):
    folder = Path(snakemake.output.folder)
    folder.mkdir(parents=True, exist_ok=True)
    window = {name: snakemake.params.figure[name] for name in ("start", "length")}
    points, tables = snakemake.params.points, []
    # Rule `publish` copies the pages to results/reports/{study}.
    results = analyse_recordings(points, snakemake.params.methods, folder, window, index="../../index.html")
    for name, table, refusals in progress(results, len(points), "analysed"):
        tables.append(table)
        for text in refusals:
            print(f"{name} refused: {text}", file=sys.stderr)
    with atomic_file(snakemake.output.table, overwrite=True) as path:
        pd.concat(tables, ignore_index=True).to_csv(path, index=False)
