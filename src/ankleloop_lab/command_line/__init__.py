"""The command `ankleloop`: recordings of a laboratory from files to results, without a workflow."""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(
        _name, "1"
    )  # before numpy is imported; as in the jobs of the workflow, for equal bits
