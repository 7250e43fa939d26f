"""An hour of estimates during a recording at 1 kHz, in simulated time."""

import time

import numpy as np
import psutil

from ankleloop import LiveEstimate, simulate

MOST_LOAD = 0.15  # of a core
MOST_GROWTH = 25e6  # bytes after ten minutes, of the history


def test_an_hour_takes_little_time_and_no_more_memory():
    live = LiveEstimate(1000.0, beside=False)
    seconds = 0.0
    sizes = []
    # The same five minutes: what a simulation leaves in the memory of a process varies.
    trial = simulate(seed=1, duration=300.0, voluntary=0.3)
    channels = np.stack([trial[name] for name in ("position", "torque", "reference")])
    for _ in range(12):
        start = time.process_time()
        for piece in np.split(channels, 15_000, axis=1):
            live.add(*piece)
        seconds += time.process_time() - start
        sizes.append(psutil.Process().memory_info().rss)
    assert live.history["failure"].eq("").sum() > 7150
    assert seconds / 3600.0 <= MOST_LOAD
    assert sizes[-1] - sizes[1] < MOST_GROWTH, sizes
