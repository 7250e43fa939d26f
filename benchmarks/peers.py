"""Identification with other programs side by side: time, peak memory and accuracy, on one thread.

Run by `make benchmark`. Everything is timed in one process, program after program in each round, so that a busy
machine slows all of them alike; memory is taken in a process for each. Writes results/benchmarks/peers.csv, peers.md
and peers.png.
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
from datasets import accuracy, open_loop, paper
from floor import floor

RESULTS = Path(__file__).resolve().parents[1] / "results" / "benchmarks"
LIMIT = 8 * 2**30  # bytes of address space of a process that is asked for its memory
SLOW = 2.0  # s: what takes longer is timed once
ROUNDS = 7
MAIN = [(kind, samples, rows) for kind in ("open loop", "paper") for samples in (5_000, 50_000) for rows in (15, 20)]
SWEEPS = {
    "samples": [{"samples": n} for n in (1_000, 2_000, 5_000, 10_000, 20_000, 50_000)],
    "inputs": [{"inputs": m} for m in (1, 2, 4, 8, 16)],
    "block rows": [{"rows": s} for s in (10, 15, 20, 30, 40)],
}


def data_of(kind, samples, inputs=8):
    """One of the two kinds of data sets."""
    return open_loop(samples, inputs) if kind == "open loop" else paper(samples)


def timed(calls, rounds):
    """Median time of each call [s], one of each in every round; slow ones once. What fails says why.

    A quick call is made twice, and the second one timed: what other programs leave in the cache is not its business.
    """
    times, failed = {name: [] for name in calls}, {}
    for k in range(rounds + 1):
        for name, call in calls.items():
            if name in failed or (times[name] and times[name][0] > SLOW):
                continue
            try:
                if times[name]:
                    call()
                start = time.perf_counter()
                call()
            except Exception as error:
                failed[name] = f"{type(error).__name__}: {error}"
                continue
            if k or time.perf_counter() - start > SLOW:  # the first round compiles and warms up
                times[name].append(time.perf_counter() - start)
    return {name: float(np.median(values)) if values else np.nan for name, values in times.items()}, failed


def memory(name, kind, samples, rows):
    """Peak memory that one identification adds [MiB], in a process of its own; or why there is none."""
    arguments = [sys.executable, __file__, "--child", json.dumps([name, kind, samples, rows])]
    done = subprocess.run(arguments, capture_output=True, text=True, check=False)
    if done.returncode == 0:
        return json.loads(done.stdout.splitlines()[-1])
    lines = (done.stderr or "killed").strip().splitlines()
    return "out of memory" if "MemoryError" in done.stderr or done.returncode < 0 else lines[-1][:100]


def child(name, kind, samples, rows):
    """Print the peak memory that one identification adds."""
    data = data_of(kind, samples)
    programs.PROGRAMS[name](data_of(kind, 1_000), rows)  # imports and compiled code are not its memory
    resource.setrlimit(resource.RLIMIT_AS, (LIMIT, LIMIT))
    before = _resident(reset=True)
    programs.PROGRAMS[name](data, rows)
    print(json.dumps(_resident() - before))


def _resident(*, reset=False):
    """Most memory that the process has had since the last reset [MiB]; Linux only."""
    if reset:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    lines = Path("/proc/self/status").read_text(encoding="ascii", errors="ignore").splitlines()
    return next(float(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024


def compare(kind, samples, rows, rounds):
    """Table of one data set: a row for each program."""
    data = data_of(kind, samples)
    used = {name: memory(name, kind, samples, rows) for name in programs.PROGRAMS}
    able = {name: program for name, program in programs.PROGRAMS.items() if not isinstance(used[name], str)}
    calls = {name: partial(program, data, rows) for name, program in able.items()}
    calls |= {"floor": floor(data, rows)}
    if kind == "paper":
        calls |= {"ankleloop with torques": partial(programs.with_torques, data, rows)}
    for program in able.values():
        program(data_of(kind, 1_000), rows)  # what a first call imports and compiles is not timed
    times, failed = timed(calls, rounds)
    lines = []
    for name in [*programs.PROGRAMS, *(set(calls) - set(programs.PROGRAMS))]:
        row = {"data": kind, "samples": samples, "block_rows": rows, "program": name}
        why = used.get(name) if isinstance(used.get(name), str) else failed.get(name)
        if why is None:
            row |= {"ms": 1e3 * times[name], "ratio": times[name] / times["ankleloop"], "mib": used.get(name)}
        if why is None and name in programs.PROGRAMS:
            row |= accuracy(data, programs.PROGRAMS[name](data, rows))
            why = None if np.isfinite(row["vaf"]) else "its model diverges"
        lines.append({**row, "failed": why})
    return pd.DataFrame(lines)


def sweep(rounds):
    """Times against samples, inputs and block rows on open-loop data."""
    lines = []
    for along, points in SWEEPS.items():
        for point in points:
            given = {"samples": 5_000, "inputs": 8, "rows": 15} | point
            data = open_loop(given["samples"], given["inputs"])
            calls = {
                name: partial(program, data, given["rows"])
                for name, program in programs.PROGRAMS.items()
                if name != "nfoursid" or given["samples"] <= 10_000
            }
            times, _ = timed({**calls, "floor": floor(data, given["rows"])}, rounds)
            lines += [{"along": along, **given, "program": name, "ms": 1e3 * value} for name, value in times.items()]
            print(f"  {along}: {point}", file=sys.stderr)
    return pd.DataFrame(lines)


def main():
    """Everything, or the memory of one identification."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--child", help=argparse.SUPPRESS)
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    if given.child:
        child(*json.loads(given.child))
        return
    from report import report

    missing = [name for name in programs.PEERS if not programs.available(name)]
    if missing:
        print(f"Without {', '.join(missing)}: `make benchmark` installs them.", file=sys.stderr)
    tables = []
    for case in MAIN:
        print("{}, {:,} samples, {} block rows".format(*case), file=sys.stderr)
        tables.append(compare(*case, given.rounds))
    report(pd.concat(tables, ignore_index=True), sweep(max(3, given.rounds // 2)), RESULTS)


if __name__ == "__main__":
    main()
