"""What a real joint and a real recorder do: how often an estimate is wrong without a warning, by effect and size.

`make benchmark ARGS=faults` takes all; `python benchmarks/effects.py --help` says how to look at a few.
"""

import argparse
from itertools import chain
from multiprocessing import Pool

import numpy as np
import pandas as pd
from faults import LOADS, TRUTHS
from independent import KINDS, simulate_independently
from scipy import signal
from tools import format_table

from ankleloop import DataError, identify, new_trial

METHODS = {"riv": {}, "riv, spline": {"basis": "spline"}, "riv-tv": {}}
GOOD = "good record"
LATENCIES = {"long-latency reflex, at 90 ms [N·m/rad]": 900}  # samples at 10 kHz
# Settings that are drawn for each good record.
CHOICES = {
    "kind": [*KINDS, "multisine"],
    "duration": [12.0, 20.0, 50.0, 120.0, 300.0],
    "rate": [200, 500, 1000, 2000, 5000, 10_000],
    "snr_db": [10.0, np.inf],
}
# Sizes, and the property of the joint that has them; K and B are those at rest.
JOINTS = {
    GOOD: ((0.0,), "cubic"),
    "none": ((0.0,), "cubic"),
    "reaction against, at 150 to 180 ms [N·m/rad]": ((40.0, 80.0), "reaction"),
    "reaction with, at 150 to 180 ms [N·m/rad]": ((-40.0, -80.0), "reaction"),
    "long-latency reflex, at 90 ms [N·m/rad]": ((20.0, 40.0), "reaction"),
    "cubic stiffness [N·m/rad³]": ((5e4, 1e5), "cubic"),
    "drag [N·m·s²/rad²]": ((0.4, 0.8), "drag"),
    "reflex of the antagonist [N·m·s/rad]": ((6.5, 13.0), "antagonist"),
    "reflex of both directions [N·m·s/rad]": ((-6.5, -13.0), "antagonist"),
    "fall of K, twice as much of G": ((0.2, 0.4), "fatigue"),
    "threshold of the reflex [rad/s]": ((0.3, 1.0), "threshold"),
    "drift of the delay [ms]": ((20.0,), "delay_drift"),
    "jitter of the delay [ms]": ((8.0,), "delay_jitter"),
    "reflex in the middle third alone": ((1.0,), "middle"),
    "short-range stiffness [N·m/rad]": ((50.0, 150.0), "short_range"),
    "stiffness that relaxes [N·m/rad]": ((20.0, 50.0), "relaxing"),
    "passive joint, G [N·m·s/rad]": ((0.0, 0.5), "gain"),
    "inertia with a footplate [kg·m²]": ((0.02, 0.03), "inertia"),
    "stiffness with gravity [N·m/rad]": ((160.0, 180.0), "stiffness"),
    "rate taken for 1,000 Hz [Hz]": ((1111, 1250), "rate"),
}


# What a recorder makes of a channel, from its values, the size of the effect and the trial.
def cross_talk(x, size, trial):
    return x + size * trial.reference.to_numpy()


def comply(x, size, trial):
    return x + trial.torque.to_numpy() / size


def saturate(x, size, trial):
    return size * np.tanh(x / size)


def clip(x, size, trial):
    """The noise of a converter comes on top."""
    return x.clip(-size, size) + 0.02 * np.random.default_rng(1).standard_normal(x.size)


def amplify(x, size, trial):
    return x * np.repeat([1.0, size], x.size // 2)


def drift(x, size, trial):
    return x * np.linspace(1.0, size, x.size)


def lose_samples(x, size, trial):
    middle = x.size // 2
    return np.concatenate([x[:middle], np.roll(x[middle:], -size)])


def run_fast(x, size, trial):
    samples = np.arange(x.size)
    return np.interp(samples * (1.0 + 1e-6 * size), samples, x)


def pass_low(x, size, trial):
    return signal.lfilter(*signal.butter(2, size, fs=1000.0), x)


def interpolate(x, size, trial):
    samples = np.arange(x.size)
    return np.interp(samples, samples[::size], x[::size])


ALL = ["position", "torque", "reference"]
RECORDERS = {
    "crosstalk of the command [N·m/rad]": ((25.0, 50.0), cross_talk, ["torque"]),
    "position that saturates [rad]": ((0.04, 0.03), saturate, ["position"]),
    "torque that is clipped [N·m]": ((8.0, 6.0), clip, ["torque"]),
    "gain of the torque from the middle": ((1.5, 2.0), amplify, ["torque"]),
    "drift of the gain of the torque": ((1.3,), drift, ["torque"]),
    "gain of the position from the middle": ((1.5, 2.0), amplify, ["position"]),
    "samples lost in the torque": ((5, 20), lose_samples, ["torque"]),
    "samples lost in the position": ((5, 20), lose_samples, ["position"]),
    "series stiffness [N·m/rad]": ((2000.0, 1000.0), comply, ["position"]),
    "low-pass filters [Hz]": ((20.0, 10.0), pass_low, ALL),
    "interpolation from every n-th sample": ((2, 5), interpolate, ALL),
    "clock of the torque [ppm]": ((50.0, 200.0), run_fast, ["torque"]),
}
EFFECTS = JOINTS | RECORDERS


def draw_settings(effect, size, seed):
    """Settings of the simulation; loads and voluntary torque are taken in turn."""
    rng = np.random.default_rng(seed)
    settings = {"load": LOADS[seed % 2], "voluntary": (0.05, 0.5)[seed // 2 % 2]}
    if effect in JOINTS:
        settings["latency"] = LATENCIES.get(effect, rng.integers(1500, 1800))
        settings[JOINTS[effect][1]] = size
    if effect == GOOD:
        settings |= {name: rng.choice(values) for name, values in CHOICES.items()}
    return settings


def make_trial(effect, size, seed):
    """A trial with an effect, and its true parameters."""
    settings = draw_settings(effect, size, seed)
    trial = simulate_independently(seed, **settings)
    channels = {name: trial[name].to_numpy() for name in ALL}
    if effect in RECORDERS:
        _, function, names = RECORDERS[effect]
        channels |= {name: function(channels[name], size, trial) for name in names}
    if effect != GOOD:
        trial = new_trial(sampling_rate=1000.0, **channels)
    return trial, TRUTHS | {"G": settings.get("gain", TRUTHS["G"])}


REFUSED = dict.fromkeys(("warned", "right", "silently wrong", "warned for nothing"), False)


def judge(effect, size, methods, seed):
    """For each method whether it warned, was right or wrong (by 15 % of K, B or G), and the relative errors."""
    trial, truths = make_trial(effect, size, seed)
    rows = []
    for method in methods:
        try:
            estimate = identify(trial, method.split(",")[0], **METHODS[method])
        except DataError:  # a command that is too weak an instrument
            rows.append({"effect": effect, "size": size, "method": method, **REFUSED})
            continue
        values = estimate.values
        errors = {name: (values.get(name, np.nan) - truths[name]) / TRUTHS[name] for name in truths}
        near = np.nanmax([abs(errors[name]) for name in "KBG"]) <= 0.15
        warned = bool(estimate.diagnostics["warnings"])
        counts = {
            "warned": warned,
            "right": near and not warned,
            "silently wrong": not (near or warned),
            "warned for nothing": near and warned,
        }
        rows.append({"effect": effect, "size": size, "method": method, **counts, **errors})
    return rows


def measure_effects(parts=("",), methods=tuple(METHODS), seeds=24):
    """Outcomes by effect, size and method, and medians of the errors of the first [%]; parts are of names of effects.

    An outcome: records with a warning / right / silently wrong / with a warning although K, B and G are right. Records
    that are refused count nowhere.
    """
    cases = []
    for effect, (sizes, *_) in EFFECTS.items():
        if any(part in effect for part in parts):
            cases += [(effect, size, methods, seed) for size in sizes for seed in range(seeds)]
    with Pool() as pool:
        outcomes = pd.DataFrame(chain.from_iterable(pool.starmap(judge, cases)))
    groups = outcomes.groupby(["effect", "size", "method"], sort=False)
    counts = groups[["warned", "right", "silently wrong", "warned for nothing"]].sum()
    cells = counts.astype(str).agg(" / ".join, axis=1).unstack("method")[list(methods)]
    medians = 100.0 * groups[list(TRUTHS)].median().xs(methods[0], level="method")
    return format_table(cells.join(medians.map("{:+.0f}".format)).reset_index())


def main():
    """Print the outcomes of some effects."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", default=[""], help="of names of effects; else all")
    parser.add_argument("--methods", nargs="+", default=list(METHODS))
    print(measure_effects(**vars(parser.parse_args())))


if __name__ == "__main__":
    main()
