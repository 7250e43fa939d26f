"""Identification with other programs side by side: time, peak memory and accuracy, on one thread.

Run by `make benchmark`. Times are those of the processor, without the time that other processes take. All programs run
in one process, one after the other in each round, so that the state of the machine is the same for all, and ratios are
those of the same round; memory is measured in a process for each. Writes results/benchmarks/peers.csv, peers-times.csv,
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
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))
sys.path.append(str(Path(sys.prefix) / "peers"))  # behind the packages of the environment

import numpy as np
import pandas as pd
import programs
from datasets import Case, make_data, score_model
from kernels import prepare_kernels
from tools import ROOT, peak_memory

RESULTS = ROOT / "results" / "benchmarks"
MEMORY_LIMIT = 8 * 2**30  # bytes of address space of a process whose memory is measured
ROUNDS = 31
BUDGET = 2.0  # s of each program in one case, in which it is run once for each round
SWEEP_BUDGET = 0.3  # s, in the sweeps
WARM_UP_SAMPLES = 1_000
LEAST_VAF = -1e4  # %: a model with less of it follows nothing
CASES = [
    Case("open loop", 5_000, 15),
    Case("open loop", 50_000, 15),
    Case("paper", 5_000, 15),
    Case("paper", 50_000, 15),
    Case("coloured inputs", 2_048, 20, 2),
    Case("narrow-band inputs", 2_048, 20, 2),
    Case("nearly noise-free", 2_048, 20, 2),
    Case("nearly noise-free", 1_000, 10, 1),
    Case("nearly noise-free", 400, 8, 2),
]
SWEEPS = {
    "samples": [{"samples": n} for n in (1_000, 2_000, 5_000, 10_000, 20_000, 50_000)],
    "inputs": [{"channels": m} for m in (1, 2, 4, 8, 16)],
    "block rows": [{"block_rows": s} for s in (10, 15, 20, 30, 40)],
}
CENTRE = Case("open loop", 5_000, 15)  # of the sweeps
LARGEST_SWEEP = {"nfoursid": 10_000}  # samples for which a program has enough memory


@dataclass
class Runs:
    """Runs of one program: times of its calls [s], what the last one returned, and the error of one that failed."""

    times: list[float] = field(default_factory=list)
    result: Any = None
    failure: str | None = None


def run_rounds(calls, rounds, budget):
    """Run the calls of all programs one after the other in each round, each as often as its budget allows.

    A first round, which is not timed, warms up all but slow calls. A quick call is run twice, and the second run is
    timed, so that it finds its own data in the cache.
    """
    runs = {name: Runs() for name in calls}
    for number in range(rounds + 1):
        for name, call in calls.items():
            run = runs[name]
            if run.failure or sum(run.times) > budget:
                continue
            try:
                if run.times and run.times[0] < budget / rounds:
                    call()
                start = time.process_time()
                run.result = call()
                seconds = time.process_time() - start
            except Exception as error:
                run.failure = f"{type(error).__name__}: {error}"
                continue
            if number or seconds > budget:
                run.times.append(seconds)
    return runs


def summarise_times(runs):
    """Number of rounds, and median and quartiles of the times [ms]."""
    times = np.array(runs.times)
    return {
        "rounds": times.size,
        "ms": 1e3 * np.median(times),
        "ms_low": 1e3 * np.quantile(times, 0.25),
        "ms_high": 1e3 * np.quantile(times, 0.75),
    }


def compare_times(runs, others):
    """Median and quartiles of the ratio of two programs, round by round."""
    count = min(len(runs.times), len(others.times))
    ratios = np.array(runs.times[:count]) / np.array(others.times[:count])
    return dict(zip(("low", "median", "high"), np.quantile(ratios, [0.25, 0.5, 0.75]), strict=True))


def measure_memory(name, case):
    """Peak memory that one identification adds [MiB], in a process of its own; or the reason of its failure."""
    arguments = [sys.executable, __file__, "--memory", json.dumps([name, case])]
    process = subprocess.run(arguments, capture_output=True, text=True, check=False)
    if process.returncode == 0:
        return json.loads(process.stdout.splitlines()[-1])
    lines = (process.stderr or "killed").strip().splitlines()
    return "out of memory" if "MemoryError" in process.stderr or process.returncode < 0 else lines[-1][:100]


def print_memory(name, case):
    """Print the peak memory that one identification adds."""
    data, program = make_data(case), programs.select_programs(case)[name]
    program(make_data(_shorten(case)), case.block_rows)  # loads packages and compiles
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, MEMORY_LIMIT))
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")  # Linux only: the peak begins anew
    before = peak_memory()
    program(data, case.block_rows)
    print(json.dumps(peak_memory() - before))


def _shorten(case):
    """The case with as many samples as a warm-up needs."""
    return case._replace(samples=min(case.samples, WARM_UP_SAMPLES))


def compare(case, rounds):
    """Table of one data set: a row for each program."""
    data, selected = make_data(case), programs.select_programs(case)
    memory = {name: measure_memory(name, case) for name in selected}
    calls = {
        name: partial(program, data, case.block_rows)
        for name, program in selected.items()
        if not isinstance(memory[name], str)
    }
    for name in calls:
        selected[name](make_data(_shorten(case)), case.block_rows)  # loads packages and compiles
    if case.kind in ("open loop", "paper"):
        calls["kernels"] = prepare_kernels(data, case.block_rows)
    if case.kind == "paper":
        calls["ankleloop with torques"] = partial(programs.ankleloop_with_torques, data, case.block_rows)
    runs = run_rounds(calls, rounds, BUDGET)
    rows = []
    for name in dict.fromkeys([*selected, *calls]):
        row = {**case._asdict(), "program": name, "failure": memory.get(name)}
        if name in runs and runs[name].times:
            row |= {"mib": memory.get(name), "failure": None, **summarise_times(runs[name])}
            for other in ("ankleloop", "ctrlsys"):
                if other in runs and runs[other].times:
                    ratio = compare_times(runs[name], runs[other])
                    row |= {f"over_{other}_{key}": value for key, value in ratio.items()}
            if name in selected:
                scores = score_model(data, runs[name].result)
                row |= scores if scores["vaf"] > LEAST_VAF else {"failure": "its model diverges"}
        elif name in runs:
            row["failure"] = runs[name].failure
        rows.append(row)
    return pd.DataFrame(rows)


def sweep(rounds):
    """Times against samples, inputs and block rows on open-loop data."""
    rows = []
    for variable, points in SWEEPS.items():
        for point in points:
            case = CENTRE._replace(**point)
            data = make_data(case)
            calls = {
                name: partial(program, data, case.block_rows)
                for name, program in programs.PROGRAMS.items()
                if case.samples <= LARGEST_SWEEP.get(name, case.samples)
            }
            runs = run_rounds({**calls, "kernels": prepare_kernels(data, case.block_rows)}, rounds, SWEEP_BUDGET)
            rows += [
                {"variable": variable, **case._asdict(), "program": name, **summarise_times(run)}
                for name, run in runs.items()
                if run.times
            ]
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
        name, case = json.loads(arguments.memory)
        print_memory(name, Case(*case))
        return
    from report import write_report

    missing = [name for name in programs.PACKAGES if not programs.is_installed(name)]
    if missing:
        print(f"Without {', '.join(missing)}: `make benchmark` installs them.", file=sys.stderr)
    tables = []
    for case in CASES:
        print(f"{case.kind}, {case.samples:,} samples, {case.block_rows} block rows", file=sys.stderr)
        tables.append(compare(case, arguments.rounds))
    write_report(pd.concat(tables, ignore_index=True), sweep(max(3, arguments.rounds // 3)), RESULTS)


if __name__ == "__main__":
    main()
