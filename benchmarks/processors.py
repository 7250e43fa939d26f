"""What the kind of processor changes: the same trials and methods with the kernels of other processors.

OpenBLAS has kernels for each kind of processor, and takes those that the variable OPENBLAS_CORETYPE names, where this
machine can run them. They add the same numbers in another order, so results differ in their last bits; how far methods
amplify that is measured here, in child processes.

Run by: python benchmarks/processors.py
"""

import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

KINDS = ("SkylakeX", "Haswell", "Nehalem", "Prescott")
# The simulation is compiled by numba, for the processor that it is told.
OLD = {"NUMBA_CPU_NAME": "nehalem", "NUMBA_CPU_FEATURES": ""}
TRIALS = 3  # at each point
POINTS = {
    "gain 13": {"reflex_gain": 13.0, "snr_db": 10.0, "voluntary": 0.05},
    "gain 2": {"reflex_gain": 2.0, "snr_db": 10.0, "voluntary": 0.05},
    "gain 30, no noise": {"reflex_gain": 30.0, "snr_db": None, "voluntary": 0.0},
    "voluntary torque": {"reflex_gain": 13.0, "snr_db": 10.0, "voluntary": 1.0},
}
METHODS = {
    "PR-MOESP": ("pr-moesp", {}),
    "PR-MOESP, B free": ("pr-moesp", {"free_b": True}),
    "EIV-MOESP": ("eiv-moesp", {}),
    "PI-MOESP": ("pi-moesp", {}),
    "Parallel cascade": ("parallel-cascade", {}),
    "Real-time algorithm": ("real-time", {}),
    "riv": ("riv", {}),
    "riv, delay estimated": ("riv", {"delay": None}),
}
PARAMETERS = ("K", "B", "I", "G")
TORQUES = ("net", "intrinsic", "reflex")
LIMIT = 1e-5  # largest relative difference that the documentation promises


def identify_all():
    """Parameters, torques and number of iterations of every method on every trial."""
    from ankleloop import DataError, identify, simulate
    from ankleloop.joint.prepared import prepare

    results = {}
    for point, settings in POINTS.items():
        for seed in range(TRIALS):
            trial = prepare(simulate(seed=seed, duration=30.0, **settings))
            for name, (method, options) in METHODS.items():
                try:
                    estimate = identify(trial, method, **options)
                except DataError as error:
                    results[f"{name}/{point}/{seed}"] = {"error": str(error)}
                    continue
                values = {**estimate.stiffness, **estimate.reflex}
                counts = (estimate.diagnostics.get(key) for key in ("passes", "iterations"))
                results[f"{name}/{point}/{seed}"] = {
                    **{parameter: values[parameter] for parameter in PARAMETERS if parameter in values},
                    **{torque: estimate.torque[torque].values.tolist() for torque in TORQUES},
                    "count": next((count for count in counts if count is not None), 0),
                }
    return results


def run_kinds():
    """Results by the kernels that OpenBLAS took; kinds that this machine cannot run are left out."""
    results = {}
    for kind in KINDS:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "results.json")
            environment = {**os.environ, "OPENBLAS_CORETYPE": kind, "OPENBLAS_VERBOSE": "2", "OMP_NUM_THREADS": "1"}
            if kind == "Nehalem":
                environment |= {**OLD, "NUMBA_CACHE_DIR": folder}
            process = subprocess.run(
                [sys.executable, __file__, str(path)], env=environment, capture_output=True, text=True
            )
            core = re.search(r"^Core: (\w+)", process.stderr + process.stdout, re.MULTILINE)
            if process.returncode == 0:
                results.setdefault(core[1] if core else kind, json.loads(path.read_text()))
            elif process.returncode > 0:  # a signal says that the processor does not know an instruction
                raise RuntimeError(f"{kind}: {process.stderr}")
    return results


def compare(results):
    """For each method the largest relative difference of each quantity from the first kind, and changed iterations.

    A difference of a torque is relative to its standard deviation.
    """
    import numpy as np

    first, *others = results.values()
    rows = {}
    for name in METHODS:
        row = dict.fromkeys((*PARAMETERS, *TORQUES), 0.0) | {"count": 0}
        keys = [key for key in first if key.split("/")[0] == name]
        for key, other in ((key, other[key]) for other in others for key in keys):
            if set(other) != set(first[key]):
                raise RuntimeError(f"{key}: an identification fails with one kind of processor, and not with another.")
            for quantity in set(row) & set(other):
                a, b = np.array(first[key][quantity]), np.array(other[quantity])
                if quantity == "count":
                    row["count"] += int(a != b)
                else:
                    size = a.std() if quantity in TORQUES else np.abs(a)
                    row[quantity] = max(row[quantity], float(np.abs(b - a).max() / max(size, np.finfo(float).tiny)))
        rows[name] = row
    return rows


def main():
    """Write the results of this process, or compare those of child processes."""
    if len(sys.argv) > 1:
        Path(sys.argv[1]).write_text(json.dumps(identify_all()), encoding="utf-8")
        return
    results = run_kinds()
    print("kernels:", ", ".join(results))
    for name, row in compare(results).items():
        print(f"{name:22}", *(f"{quantity} {value:.1e}" for quantity, value in row.items()))


if __name__ == "__main__":
    main()
