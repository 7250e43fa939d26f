"""Identify the trials of a chunk by every method of their study, and score the estimates."""

from ankleloop.studies.identification import FILES, identify_chunk

from job import print_failures, running

with running(snakemake):
    files = {name: snakemake.output[name] for name in FILES}
    identify_chunk(snakemake.input.trials, files, snakemake.wildcards.study, **snakemake.params.arguments)
    print_failures(snakemake)
