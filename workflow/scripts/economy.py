"""Measure what PR-MOESP and EIV-MOESP cost on one trial, side by side."""

import pandas as pd

from ankleloop.records.files import atomic_file
from ankleloop.records.trial_files import load_trials
from ankleloop.studies.economy import measure_economy

from job import running

with running(snakemake):
    quantities = measure_economy(next(load_trials(snakemake.input.trials[0])))
    with atomic_file(snakemake.output.table) as path:
        pd.DataFrame({"quantity": list(quantities), "value": list(quantities.values())}).to_csv(path, index=False)
