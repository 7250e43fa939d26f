"""Put the scores and parameters of all trials of a study into one table."""

from ankleloop.jobs.job import running
from ankleloop.tables.trial_tables import join_tables

with running(snakemake):
    params, output = snakemake.params, snakemake.output
    chunks = dict(zip(snakemake.input.chunks, params.hashes, strict=True))
    join_tables(output.table, chunks, params.rows, params.settings, output.get("text"))
