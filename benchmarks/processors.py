"""What the kind of processor changes: the same trials and methods with the kernels of other processors.

OpenBLAS has kernels for each kind of processor, and takes those that the variable OPENBLAS_CORETYPE names, where this
machine can run them. They add the same numbers in another order, so results differ in their last bits; how far methods
amplify that is measured here, in child processes.

Run by: python benchmarks/processors.py
"""

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

from ankleloop import identify, simulate
from ankleloop.joint.prepared import prepare

KINDS = ("SkylakeX", "Haswell", "Nehalem", "Prescott")
# The simulation is compiled by numba, for the processor that it is told.
OLD = {"NUMBA_CPU_NAME": "nehalem", "NUMBA_CPU_FEATURES": ""}
TRIALS = 3  # at each point
POINTS = {
    "gain 13": {"reflex_gain": 13.0, "voluntary": 0.05},
    "gain 2": {"reflex_gain": 2.0, "voluntary": 0.05},
    "gain 30, no noise": {"reflex_gain": 30.0, "snr_db": None, "voluntary": 0.0},
    "voluntary torque": {"reflex_gain": 13.0, "voluntary": 1.0},
}
METHODS = {
    name: (name, {})
    for name in ("pr-moesp", "eiv-moesp", "pi-moesp", "parallel-cascade", "real-time", "riv")
}
METHODS["pr-moesp, B free"] = "pr-moesp", {"free_b": True}
METHODS["riv, delay estimated"] = "riv", {"delay": None}
PARAMETERS = ("K", "B", "I", "G")
TORQUES = ("net", "intrinsic", "reflex")
LIMIT = 1e-5  # largest relative difference that the documentation promises


def identify_all():
    """Parameters, torques and number of iterations of every method on every trial, by METHOD/POINT/SEED/QUANTITY."""
    results = {}
    for point, settings in POINTS.items():
        for seed in range(TRIALS):
            trial = prepare(simulate(seed=seed, duration=30.0, **settings))
            for name, (method, options) in METHODS.items():
                estimate = identify(trial, method, **options)
                values = {**estimate.stiffness, **estimate.reflex}
                quantities = {key: values[key] for key in PARAMETERS if key in values}
                quantities |= {key: estimate.torque[key].values for key in TORQUES}
                quantities |= {
                    key: estimate.diagnostics.get(key, 0) for key in ("passes", "iterations")
                }
                results |= {
                    f"{name}/{point}/{seed}/{key}": value for key, value in quantities.items()
                }
    return results


def run_kinds():
    """Results by the kernels that OpenBLAS took; kinds that this machine cannot run are left out."""
    results = {}
    for kind in KINDS:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "results.npz")
            environment = {
                **os.environ,
                "OPENBLAS_CORETYPE": kind,
                "OPENBLAS_VERBOSE": "2",
                "OMP_NUM_THREADS": "1",
            }
            if kind == "Nehalem":
                environment |= {**OLD, "NUMBA_CACHE_DIR": folder}
            process = subprocess.run(
                [sys.executable, __file__, path], env=environment, capture_output=True, text=True
            )
            core = re.search(r"^Core: (\w+)", process.stderr + process.stdout, re.MULTILINE)
            if process.returncode == 0:
                with np.load(path) as arrays:
                    results.setdefault(core[1] if core else kind, dict(arrays))
            elif (
                process.returncode > 0
            ):  # a signal says that the processor does not know an instruction
                raise RuntimeError(f"{kind}: {process.stderr}")
    return results


def compare(results):
    """Largest relative difference of each quantity (columns) of each method from the first kind, NaN where it has none.

    A difference of a torque is relative to its standard deviation. All differences of iterations count.
    """
    first, *others = results.values()
    rows = []
    for key, a in first.items():
        method, *_, quantity = key.split("/")
        size = a.std() if a.ndim else max(abs(a), np.finfo(float).tiny)
        rows += [(method, quantity, np.abs(other[key] - a).max() / size) for other in others]
    table = pd.DataFrame(rows, columns=["method", "quantity", "difference"])
    return table.pivot_table("difference", "method", "quantity", aggfunc="max", sort=False)


def main():
    """Write the results of this process, or compare those of child processes."""
    if len(sys.argv) > 1:
        np.savez(sys.argv[1], **identify_all())
        return
    results = run_kinds()
    print("kernels:", ", ".join(results))
    print(compare(results).to_string(float_format="{:.1e}".format))


if __name__ == "__main__":
    main()
