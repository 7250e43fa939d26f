"""Identification with other programs side by side: time, peak memory and accuracy, on one thread.

Run by `make benchmark`. Everything is timed in one process, program after program in each round, so that other load of
the machine slows all of them alike; memory is measured in a process for each. Writes results/benchmarks/peers.csv,
peers.md and peers.png.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import time
import warnings
from functools import partial
from pathlib import Path

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))
sys.path.append(str(Path(sys.prefix) / "peers"))  # behind the packages of the environment

import numpy as np
import pandas as pd
import programs
from datasets import make_data, score_model
from kernels import prepare_kernels

RESULTS = Path(__file__).resolve().parents[1] / "results" / "benchmarks"
MEMORY_LIMIT = 8 * 2**30  # bytes of address space of a process whose memory is measured
SLOW = 2.0  # s: a call that takes longer is timed once
ROUNDS = 7
WARM_UP_SAMPLES = 1_000
CASES = [(kind, samples, rows) for kind in ("open loop", "paper") for samples in (5_000, 50_000) for rows in (15, 20)]
SWEEPS = {
    "samples": [{"samples": n} for n in (1_000, 2_000, 5_000, 10_000, 20_000, 50_000)],
    "inputs": [{"inputs": m} for m in (1, 2, 4, 8, 16)],
    "block rows": [{"block_rows": s} for s in (10, 15, 20, 30, 40)],
}
CENTRE = {"samples": 5_000, "inputs": 8, "block_rows": 15}  # of the sweeps
LARGEST_SWEEP = {"nfoursid": 10_000}  # samples for which a program has enough memory


def measure_times(calls, rounds):
    """Median time of each call [s], with one of each in every round; and the errors of those that fail.

    Slow calls are timed once. A quick call is run twice, and the second run is timed, so that it finds its own data in
    the cache.
    """
    times, failures = {name: [] for name in calls}, {}
    for number in range(rounds + 1):
        for name, call in calls.items():
            if name in failures or (times[name] and times[name][0] > SLOW):
                continue
            try:
                if times[name]:
                    call()
                start = time.perf_counter()
                call()
                seconds = time.perf_counter() - start
            except Exception as error:
                failures[name] = f"{type(error).__name__}: {error}"
                continue
            if number or seconds > SLOW:  # the first round compiles and warms up
                times[name].append(seconds)
    return {name: float(np.median(values)) if values else np.nan for name, values in times.items()}, failures


def measure_memory(name, kind, samples, block_rows):
    """Peak memory that one identification adds [MiB], in a process of its own; or the reason of its failure."""
    arguments = [sys.executable, __file__, "--memory", json.dumps([name, kind, samples, block_rows])]
    process = subprocess.run(arguments, capture_output=True, text=True, check=False)
    if process.returncode == 0:
        return json.loads(process.stdout.splitlines()[-1])
    lines = (process.stderr or "killed").strip().splitlines()
    return "out of memory" if "MemoryError" in process.stderr or process.returncode < 0 else lines[-1][:100]


def print_memory(name, kind, samples, block_rows):
    """Print the peak memory that one identification adds."""
    data = make_data(kind, samples)
    programs.PROGRAMS[name](make_data(kind, WARM_UP_SAMPLES), block_rows)  # loads packages and compiles
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, MEMORY_LIMIT))
    before = _peak_memory(reset=True)
    programs.PROGRAMS[name](data, block_rows)
    print(json.dumps(_peak_memory() - before))


def _peak_memory(*, reset=False):
    """Most memory that the process has had since the last reset [MiB]; Linux only."""
    if reset:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    lines = Path("/proc/self/status").read_text(encoding="ascii", errors="ignore").splitlines()
    return next(float(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024


def compare(kind, samples, block_rows, rounds):
    """Table of one data set: a row for each program."""
    data = make_data(kind, samples)
    memory = {name: measure_memory(name, kind, samples, block_rows) for name in programs.PROGRAMS}
    failures = {name: reason for name, reason in memory.items() if isinstance(reason, str)}
    usable = {name: program for name, program in programs.PROGRAMS.items() if name not in failures}
    calls = {name: partial(program, data, block_rows) for name, program in usable.items()}
    calls["kernels"] = prepare_kernels(data, block_rows)
    if kind == "paper":
        calls["ankleloop with torques"] = partial(programs.ankleloop_with_torques, data, block_rows)
    for program in usable.values():
        program(make_data(kind, WARM_UP_SAMPLES), block_rows)  # loads packages and compiles
    times, errors = measure_times(calls, rounds)
    failures |= errors
    rows = []
    for name in dict.fromkeys([*programs.PROGRAMS, *calls]):
        row = {"data": kind, "samples": samples, "block_rows": block_rows, "program": name}
        failure = failures.get(name)
        if failure is None:
            row |= {"ms": 1e3 * times[name], "ratio": times[name] / times["ankleloop"], "mib": memory.get(name)}
            if name in usable:
                row |= score_model(data, usable[name](data, block_rows))
                failure = None if np.isfinite(row["vaf"]) else "its model diverges"
        rows.append({**row, "failure": failure})
    return pd.DataFrame(rows)


def sweep(rounds):
    """Times against samples, inputs and block rows on open-loop data."""
    rows = []
    for variable, points in SWEEPS.items():
        for point in points:
            case = CENTRE | point
            data = make_data("open loop", case["samples"], case["inputs"])
            calls = {
                name: partial(program, data, case["block_rows"])
                for name, program in programs.PROGRAMS.items()
                if case["samples"] <= LARGEST_SWEEP.get(name, case["samples"])
            }
            times, _ = measure_times({**calls, "kernels": prepare_kernels(data, case["block_rows"])}, rounds)
            rows += [{"variable": variable, **case, "program": name, "ms": 1e3 * s} for name, s in times.items()]
            print(f"  {variable}: {point}", file=sys.stderr)
    return pd.DataFrame(rows)


def main():
    """Compare all programs, or print the memory of one identification."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--memory", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    if arguments.memory:
        print_memory(*json.loads(arguments.memory))
        return
    from report import write_report

    missing = [name for name in programs.PACKAGES if not programs.is_installed(name)]
    if missing:
        print(f"Without {', '.join(missing)}: `make benchmark` installs them.", file=sys.stderr)
    tables = []
    for case in CASES:
        print("{}, {:,} samples, {} block rows".format(*case), file=sys.stderr)
        tables.append(compare(*case, arguments.rounds))
    write_report(pd.concat(tables, ignore_index=True), sweep(max(3, arguments.rounds // 2)), RESULTS)


if __name__ == "__main__":
    main()
