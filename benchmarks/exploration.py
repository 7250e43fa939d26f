"""Processor time of a change in notebooks/explore.ipynb: the median of some changes, and the share of each step."""

import argparse
import time

import numpy as np

from ankleloop.exploration.controls import METHOD_CONTROLS, SIMULATION_CONTROLS, default_values
from ankleloop.exploration.experiment import Experiment
from ankleloop.exploration.picture import Picture


def draw_changes(count, seed):
    """Values after each change of one number; changes that leave the loop stable."""
    rng = np.random.default_rng(seed)
    numbers = [(0, control) for control in SIMULATION_CONTROLS if control.kind in ("number", "integer")]
    numbers += [(1, control) for control in METHOD_CONTROLS if control.kind in ("number", "integer")]
    for number in range(count):
        settings, methods = default_values()
        place, control = numbers[number % len(numbers)]
        ends = np.array([0.7, 1.4]) * control.default
        value = float(rng.uniform(*np.clip(ends, control.low, control.high)))
        value = round(value) if control.kind == "integer" else value
        if place == 0:
            settings[control.name] = value
        else:
            methods[0]["options"][control.name] = value
        yield settings, methods


def time_change(experiment, picture, values):
    """Processor time of each step of a change [s]."""
    result = experiment.run(*values)
    start = time.process_time()
    picture.update(result)
    picture.png()
    return {**result.seconds, "picture": time.process_time() - start}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--changes", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    experiment, picture = Experiment(), Picture()
    for values in draw_changes(3, arguments.seed + 1):  # compiled functions are loaded, caches filled
        time_change(experiment, picture, values)
    times = [time_change(experiment, picture, values) for values in draw_changes(arguments.changes, arguments.seed)]
    total = np.median([sum(steps.values()) for steps in times])
    print(f"A change: {1e3 * total:.0f} ms of processor time (median of {arguments.changes})")
    for step in times[0]:
        share = np.median([steps[step] / sum(steps.values()) for steps in times])
        print(f"  {step}: {1e3 * np.median([steps[step] for steps in times]):.0f} ms, {100 * share:.0f} %")


if __name__ == "__main__":
    main()
