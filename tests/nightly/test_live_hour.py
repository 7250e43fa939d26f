"""An hour of estimates during a recording at 1 kHz, in simulated time."""

import sys
import time
from pathlib import Path

import numpy as np
import pytest

from ankleloop import LiveEstimate, simulate

MOST_LOAD = 0.15  # of a core
MOST_GROWTH = 40.0  # MiB, after the first record: of the history, and by which the memory varies


def memory():
    """Memory of this process [MiB]."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(float(line.split()[1]) for line in lines if line.startswith("VmRSS")) / 1024


@pytest.mark.skipif(sys.platform != "linux", reason="memory is read from /proc")
def test_an_hour_takes_little_time_and_no_more_memory():
    live = LiveEstimate(1000.0, beside=False)
    seconds = 0.0
    sizes = []
    for seed in range(12):
        trial = simulate(seed=seed, duration=300.0, voluntary=0.3)
        channels = [trial[name].to_numpy() for name in ("position", "torque", "reference")]
        start = time.process_time()
        for piece in np.split(np.stack(channels), 15_000, axis=1):
            live.add(*piece)
        seconds += time.process_time() - start
        sizes.append(memory())
    history = live.history
    assert len(history) == 7200
    assert history["failure"][20:].eq("").all()
    assert seconds / 3600.0 <= MOST_LOAD
    assert sizes[-1] - sizes[0] < MOST_GROWTH, sizes
