"""Identification with other programs side by side: time, peak memory and accuracy, on one thread.

Times are those of the processor, without the time that other processes take. All programs run in one process, one after
the other in each round, so that the state of the machine is the same for all, and ratios are those of the same round;
memory is measured in a process for each. `make benchmark` makes a page of the table; this file prints it.
"""

import argparse
import os
import resource
import sys
import time
import warnings
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

os.environ.update(
    dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
)
sys.path.append(str(Path(sys.prefix) / "peers"))  # behind the packages of the environment

import numpy as np
import programs
from datasets import Case, make_data, score_model
from tools import format_table, peak_memory, run_alone

MEMORY_LIMIT = 8 * 2**30  # bytes of address space of a process whose memory is measured
ROUNDS = 31
BUDGET = 2.0  # s of each program in one case, in which it is run once for each round
LEAST_ROUNDS = 4  # that have quartiles
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


def measure_memory(name, case):
    """Peak memory that one identification adds [MiB]; for a process of its own."""
    warnings.simplefilter("ignore")
    program = programs.select_programs(case)[name]
    data, short = make_data(case), case._replace(samples=min(case.samples, 1_000))
    program(make_data(short), case.block_rows)  # loads packages and compiles
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, MEMORY_LIMIT))
    Path("/proc/self/clear_refs").write_text(
        "5", encoding="ascii"
    )  # Linux only: the peak begins anew
    before = peak_memory()
    program(data, case.block_rows)
    return peak_memory() - before


def describe_memory(name, case):
    """Peak memory of a program [MiB], or the reason of its failure."""
    try:
        return run_alone(measure_memory, name, case)
    except (MemoryError, BrokenProcessPool):
        return "out of memory"
    except Exception as error:
        return f"{type(error).__name__}: {error}"[:100]


def run_rounds(calls, rounds):
    """Times of the calls of all programs [s], one after the other in each round, each as often as its budget allows.

    A quick call is run twice, and the second run is timed, so that it finds its own data in the cache.
    """
    times = {name: [] for name in calls}
    for _ in range(rounds):
        for name, call in calls.items():
            if sum(times[name]) > BUDGET:
                continue
            if not times[name] or times[name][0] < BUDGET / rounds:
                call()
            start = time.process_time()
            call()
            times[name].append(time.process_time() - start)
    return {name: np.array(values) for name, values in times.items()}


def compare(case, rounds):
    """Rows of the table for one data set, a row for each program."""
    print(case, file=sys.stderr)
    data, selected = make_data(case), programs.select_programs(case)
    memories = {name: describe_memory(name, case) for name in selected}
    calls = {
        name: lambda program=program: program(data, case.block_rows)
        for name, program in selected.items()
        if not isinstance(memories[name], str)
    }
    times, rows = run_rounds(calls, rounds), []
    for name in selected:
        row = {"data": "" if rows else str(case), "program": name}
        if name not in calls:
            rows.append(row | {"failure": memories[name]})
            continue
        count = len(times[name])
        low, middle, high = np.quantile(times[name] / times["ankleloop"][:count], [0.25, 0.5, 0.75])
        row |= {
            "median [ms]": f"{1e3 * np.median(times[name]):,.2f}",
            "over ankleloop": f"{middle:,.2f}",
        }
        row |= {
            "quartiles": f"{low:,.2f} … {high:,.2f}" if count >= LEAST_ROUNDS else "",
            "rounds": count,
        }
        vaf, pole_error = score_model(data, *calls[name]())
        diverges = vaf < LEAST_VAF
        row["peak [MiB]"] = f"{memories[name]:,.0f}"
        row["error of a pole"] = "" if diverges or np.isnan(pole_error) else f"{pole_error:.0e}"
        row["VAF, validation [%]"] = "" if diverges else f"{vaf:,.3f}"
        rows.append(row | {"failure": "its model diverges" if diverges else ""})
    return rows


def compare_all(rounds=ROUNDS):
    """Table of all programs on all data sets as Markdown."""
    warnings.simplefilter("ignore")
    if programs.MISSING:
        print(
            f"Without {'; '.join(programs.MISSING)}: `make benchmark` installs them.",
            file=sys.stderr,
        )
    return format_table([row for case in CASES for row in compare(case, rounds)])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    print(compare_all(parser.parse_args().rounds))
