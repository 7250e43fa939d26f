"""What the checks of data cost: time of every method with them over the time without them.

Every `ankleloop.identify` checks its data (`ankleloop.joint.data_checks.check_data`). Calls with and without these
checks alternate on the same simulated trials, on one thread; a ratio is that of two calls that follow each other, in
time of the processor. What an identification and its checks share (decimated signals) counts for the identification
alone, as it is computed in both.

Run by: python benchmarks/data_checks.py
"""

import argparse
import json
import os

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))

import gc
import time
from contextlib import contextmanager

import numpy as np

from ankleloop import METHODS, identify, simulate
from ankleloop.methods import method as method_module

DURATIONS = (20.0, 60.0)  # s
PAIRS = 120  # of calls of each method
BITS = 16  # of a converter: samples that come again at once need a closer look
WARM = 3  # pairs that do not count


def digitise(trial):
    """The trial as a converter of 16 bits records it, whose range is four times that of each channel."""
    channels = {}
    for name in ("position", "torque", "reference"):
        step = 4.0 * np.ptp(trial[name].values) / 2**BITS
        channels[name] = trial[name].copy(data=step * np.round(trial[name].values / step))
    return trial.assign(channels)


DATA = {"simulated": lambda trial: trial, f"of a converter of {BITS} bits": digitise}


@contextmanager
def without_checks():
    """Identifications that do not check their data."""
    check = method_module.check_data
    method_module.check_data = lambda trials, use: []
    try:
        yield
    finally:
        method_module.check_data = check


def time_call(trial, method):
    """Processor time of an identification of a trial that is not prepared [s]."""
    start = time.process_time_ns()
    identify(trial, method)
    return 1e-9 * (time.process_time_ns() - start)


def time_pair(trial, method, *, checks_first):
    """Processor times with and without checks."""
    times = {}
    for checks in (checks_first, not checks_first):
        if checks:
            times[True] = time_call(trial, method)
        else:
            with without_checks():
                times[False] = time_call(trial, method)
    return times[True], times[False]


def measure(trial, method, pairs):
    """Quartiles of the ratio, and median times with and without checks."""
    gc.collect()
    gc.disable()
    try:
        times = [time_pair(trial, method, checks_first=bool(k % 2)) for k in range(WARM + pairs)][WARM:]
    finally:
        gc.enable()
    checked, unchecked = np.transpose(times)
    low, middle, high = np.percentile(checked / unchecked, [25, 50, 75])
    return {
        "ms": 1e3 * float(np.median(checked)),
        "share": 100.0 * float(middle - 1.0),
        "low": 100.0 * float(low - 1.0),
        "high": 100.0 * float(high - 1.0),
    }


def measure_all(pairs, methods):
    """A row for each duration, kind of data and method."""
    rows = []
    for duration in DURATIONS:
        trial = simulate(seed=1, duration=duration)
        for data, change in DATA.items():
            for method in methods:
                rows.append({"duration": duration, "data": data, "method": method})
                rows[-1] |= measure(change(trial), method, pairs)
                text = "{duration:g} s, {data}, {method}: {ms:.2f} ms, checks {share:+.1f} % ({low:+.1f} … {high:+.1f})"
                print(text.format(**rows[-1]), flush=True)
    return rows


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--pairs", type=int, default=PAIRS, help="pairs of calls of each method (%(default)s)")
    parser.add_argument("--methods", nargs="+", default=list(METHODS), choices=list(METHODS), help="methods to time")
    arguments = parser.parse_args()
    print(json.dumps(measure_all(arguments.pairs, arguments.methods)))
