"""Put the scores and parameters of all trials of a study into one table."""

from ankleloop.paper.trial_tables import write_trial_table

from job import running

with running(snakemake):
    write_trial_table(
        snakemake.output.table,
        snakemake.input.parameters,
        snakemake.input.scores,
        snakemake.params.varied,
        text=snakemake.output.get("text"),
        points=snakemake.params.points,
        methods=snakemake.params.methods,
        trials=snakemake.params.trials,
    )
