"""Measure what PR-MOESP and EIV-MOESP cost on the trials of a study, side by side."""

# ruff: noqa: E402

import os

# The job has all cores, so that no other job shares them; linear algebra has one thread as everywhere. This comes
# before any import of numpy.
LIBRARIES = ("OMP_NUM", "OPENBLAS_NUM", "GOTO_NUM", "MKL_NUM", "NUMEXPR_NUM", "VECLIB_MAXIMUM")
os.environ.update({f"{name}_THREADS": "1" for name in LIBRARIES})

from itertools import chain

from ankleloop.studies.economy import measure_economy
from ankleloop.trials.files import atomic_file
from ankleloop.trials.trial_files import load_trials

from job import running

with running(snakemake):
    trials = chain.from_iterable(load_trials(path) for path in snakemake.input.trials)
    quantities = measure_economy(trials, snakemake.params.options)
    with atomic_file(snakemake.output.table, overwrite=True) as path:
        quantities.to_csv(path, index=False)
