"""Identify a record that does not fit into memory: time and peak memory against its length.

`python benchmarks/long_record.py` takes 36,000,000 samples, 100 hours at 100 Hz; `--samples 3600000` takes a tenth of
the time. The last line that it prints is its result as JSON.
"""

import argparse
import json
import multiprocessing
import sys
import tempfile
import time
from pathlib import Path

import h5py
from tools import peak_memory

from ankleloop.methods.long_records import identify_file
from ankleloop.simulation.simulate import simulate
from ankleloop.trials.long_record import LongRecord

RATE = 100.0  # Hz
PART = 1000.0  # s: the record consists of simulated trials of this length, end to end
CHANNELS = ("position", "torque", "reference")


def write_record(path, samples):
    """Write a record of a number of samples, one simulated trial at a time."""
    settings = {
        "duration": PART,
        "recording_rate": RATE,
        "integration_rate": 1000.0,
        "antialias_cutoff": 40.0,
        "noise_rate": RATE,
        "reflex_gain": 13.0,
    }
    with h5py.File(path, "w") as file:
        file.attrs["sampling_rate"] = RATE
        variables = {name: file.create_dataset(name, (samples,), float, chunks=(100_000,)) for name in CHANNELS}
        start = 0
        for seed in range(-(-samples // round(PART * RATE))):
            trial = simulate(seed=seed, **settings)
            stop = min(start + trial.sizes["time"], samples)
            for name, variable in variables.items():
                variable[start:stop] = trial[name].values[: stop - start]
            start = stop
            print(f"\rsimulated {100 * start / samples:.0f} %", end="", file=sys.stderr)
    print(file=sys.stderr)


def print_progress(name, share):
    """Progress of a pass."""
    print(f"\r{name} {100 * share:.0f} %   ", end="" if share < 1 else "\n", file=sys.stderr)


def main():
    """Write the record unless it exists, in a process of its own, and identify it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=36_000_000)
    parser.add_argument("--method", default="pr-moesp")
    parser.add_argument("--basis", default="chebyshev")
    parser.add_argument("--folder", type=Path, help="folder of the record; a temporary folder by default")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.folder or Path(temporary)
        path = folder / f"record-{arguments.samples}.h5"
        if not path.exists():  # not in this process, whose memory is measured
            writer = multiprocessing.get_context("spawn").Process(target=write_record, args=(path, arguments.samples))
            writer.start()
            writer.join()
            if writer.exitcode:
                raise SystemExit("the record could not be written.")
        memory_before = peak_memory()
        start = time.perf_counter()
        estimate = identify_file(
            LongRecord(path),
            folder / "torques.nc",
            arguments.method,
            overwrite=True,
            basis=arguments.basis,
            progress=print_progress,
        )
        seconds = time.perf_counter() - start
        memory = peak_memory()
        written = estimate.torque.sizes["time"]
        estimate.torque.close()
    result = {
        "samples": arguments.samples,
        "hours": arguments.samples / RATE / 3600,
        "method": arguments.method,
        "basis": arguments.basis,
        "seconds": seconds,
        "mib": memory,
        "mib_before": memory_before,
        "torque_samples": written,
        "vaf": float(estimate.diagnostics["vaf"]),
        **{name: float(value) for name, value in estimate.stiffness.items()},
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
