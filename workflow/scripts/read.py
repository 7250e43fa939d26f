"""Read one recording of a laboratory."""

from ankleloop.batch import save_trials
from ankleloop.readers import read_trial

from job import running

with running(snakemake):
    mapping = {name: value for name, value in snakemake.params.mapping.items() if name != "file"}
    save_trials([read_trial(snakemake.input.recording, **mapping)], snakemake.output.trials)
