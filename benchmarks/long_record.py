"""Identify a record that does not fit into memory: time and peak memory against its length.

python benchmarks/long_record.py --samples 36000000
"""

import argparse
import resource
import sys
import tempfile
import time
from pathlib import Path

import h5py
import numpy as np

from ankleloop.methods.long_records import LongRecord, identify_file
from ankleloop.simulation import simulate_trials

RATE = 100.0  # Hz
PIECE = 1000.0  # s: the record is made of simulated trials of this length, end to end
KEPT = ("position", "torque", "reference")


def make_record(path, samples):
    """Write a record of so many samples, a piece at a time."""
    pieces = -(-samples // round(PIECE * RATE))
    trials = simulate_trials(
        range(pieces),
        duration=PIECE,
        recording_rate=RATE,
        integration_rate=1000.0,
        antialias_cutoff=40.0,
        noise_rate=RATE,
        reflex_gain=13.0,
    )
    with h5py.File(path, "w") as file:
        file.attrs["sampling_rate"] = RATE
        variables = {name: file.create_dataset(name, (samples,), float, chunks=(100_000,)) for name in KEPT}
        at = 0
        for trial in trials:
            stop = min(at + trial.sizes["time"], samples)
            for name, variable in variables.items():
                variable[at:stop] = trial[name].values[: stop - at]
            at = stop
            print(f"\rsimulated {100 * at / samples:.0f} %", end="", file=sys.stderr)
    print(file=sys.stderr)


def report(name, share):
    """Progress of a pass."""
    print(f"\r{name} {100 * share:.0f} %   ", end="" if share < 1 else "\n", file=sys.stderr)


def main():
    """Make the record if it is not there, and identify it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=36_000_000)
    parser.add_argument("--method", default="pr-moesp")
    parser.add_argument("--basis", default="chebyshev")
    parser.add_argument("--folder", type=Path, help="where to keep the record; a temporary folder by default")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = given.folder or Path(temporary)
        path = folder / f"record-{given.samples}.h5"
        if not path.exists():
            make_record(path, given.samples)
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        start = time.perf_counter()
        estimate = identify_file(
            LongRecord(path), folder / "torques.nc", given.method, basis=given.basis, progress=report
        )
        seconds = time.perf_counter() - start
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        written = estimate.torque.sizes["time"]
        estimate.torque.close()
    values = {name: float(np.round(value, 4)) for name, value in estimate.stiffness.items()}
    print(
        f"{given.samples:,} samples at {RATE:g} Hz ({given.samples / RATE / 3600:.3g} h), {given.method}, {given.basis}"
    )
    print(f"{seconds:.1f} s, {1e6 * seconds / given.samples:.2f} µs a sample; peak memory {peak / 1024:.0f} MiB")
    print(f"({before / 1024:.0f} MiB before the identification); {written:,} samples of three torques written")
    print(f"{values}, net VAF {estimate.diagnostics['vaf']:.2f} %, compression {estimate.diagnostics['compression']}")


if __name__ == "__main__":
    main()
