"""Recordings from files to pages: checks, every valid method, export. A refused recording does not stop the others."""

import shutil
import sys
from pathlib import Path

import pandas as pd

from ankleloop.errors import NUMERICAL_ERRORS
from ankleloop.pages.recordings import embed_recording_figures, render_recording_page
from ankleloop.recordings.files import analyse_files, export_estimates, refuse_recording, tabulate_analysis
from ankleloop.recordings.recommendation import recommend
from ankleloop.records.files import atomic_file

from job import log, progress, running


def write_results(name, mapping, trials, analysis):
    """Write the estimates and the page of a recording; return its rows of the table."""
    log.info("%s: %s\n%s", name, analysis.check.verdict, analysis.check)
    for finding in analysis.check.findings:
        if finding.verdict == "refused":
            print(f"{name} refused: {finding.text}", file=sys.stderr)
    table = tabulate_analysis(name, mapping, analysis, keys)
    export_estimates({keys[label]: estimates for label, estimates in analysis.records.items()}, folder / name)
    figures = embed_recording_figures(trials[0] if trials else None, analysis, **window)
    page = render_recording_page(name, mapping, analysis, recommend(analysis), figures)
    with atomic_file(folder / f"{name}.html") as path:
        path.write_text(page, encoding="utf-8")
    return table


with running(snakemake):
    points, folder = snakemake.params.points, Path(snakemake.output.folder)
    keys = {method["label"] or key: key for key, method in snakemake.params.methods.items()}
    methods = {label: snakemake.params.methods[key] for label, key in keys.items()}
    window = {name: snakemake.params.figure[name] for name in ("start", "length")}
    folder.mkdir(parents=True, exist_ok=True)
    tables = []
    for name, mapping in progress(list(points.items()), "analysed"):
        trials, analysis = analyse_files(mapping["paths"], mapping["parts"], methods)
        try:
            tables.append(write_results(name, mapping, trials, analysis))
        except NUMERICAL_ERRORS as error:  # of a figure or an export
            shutil.rmtree(folder / name, ignore_errors=True)
            tables.append(write_results(name, mapping, [], refuse_recording(error)))
    with atomic_file(snakemake.output.table) as path:
        pd.concat(tables, ignore_index=True).to_csv(path, index=False)
