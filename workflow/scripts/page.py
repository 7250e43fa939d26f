"""Render an executed notebook as one HTML page that needs no other files."""

import nbformat

from ankleloop.trials.files import atomic_file
from ankleloop_workflow.jobs.job import running
from ankleloop_workflow.pages.report import render_article, render_study

with running(snakemake):
    notebook = nbformat.read(snakemake.input.code, as_version=4)
    render = render_article if snakemake.rule == "article" else render_study
    with atomic_file(snakemake.output.page, overwrite=True) as path:
        path.write_text(render(notebook), encoding="utf-8")
