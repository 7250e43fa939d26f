"""Put the scores and parameters of all trials of a study into one table."""

from ankleloop_workflow.jobs.job import running
from ankleloop_workflow.tables.trial_tables import join_tables

with running(snakemake):
    output = snakemake.output
    join_tables(output.table, output.text, snakemake.input.chunks, rows=snakemake.params.rows)
