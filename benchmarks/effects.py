"""What a real joint and a real recorder do: how often an estimate is wrong without a warning, by effect and size.

`make benchmark ARGS=faults` takes all; `python benchmarks/effects.py --help` says how to look at a few.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import chain

import numpy as np
import pandas as pd
from faults import LOADS, TRUTHS
from independent import KINDS, Plant, simulate_independently
from scipy import signal
from tools import format_table

from ankleloop import identify, new_trial

LIMIT = 0.15  # of K, B and G: an estimate that is farther off is wrong
METHODS = {
    "riv": {},
    "riv, spline": {"basis": "spline"},
    "riv-tv": {"cycle_onsets": tuple(np.arange(0.0, 299.0))},
}


# What a recorder makes of the channels, which are changed in place.
def add_crosstalk(channels, size):
    channels["torque"] += size * channels["reference"]


def add_gravity(channels, size):
    channels["torque"] += size * np.sin(channels["position"])


def add_footplate(channels, size):
    velocity = np.gradient(channels["position"], 1e-3)
    channels["torque"] += size * np.gradient(velocity, 1e-3)


def comply(channels, size):
    """What holds the foot is a spring."""
    channels["position"] += channels["torque"] / size


def saturate(channels, size):
    channels["position"] = size * np.tanh(channels["position"] / size)


def clip(channels, size):
    """Clip the torque, ahead of the noise of a converter."""
    clipped = channels["torque"].clip(-size, size)
    channels["torque"] = clipped + 0.02 * np.random.default_rng(1).standard_normal(clipped.size)


def change_gain(channels, size, *, channel):
    values = channels[channel]
    values[values.size // 2 :] *= size


def lose_samples(channels, size, *, channel):
    """All channels end at the same time; one of them has lost samples in the middle."""
    for name, values in channels.items():
        start = values.size // 2 if name == channel else values.size - size
        channels[name] = np.delete(values, np.s_[start : start + size])


def run_fast(channels, size):
    """The clock of the torque gains on the others."""
    samples = np.arange(channels["torque"].size)
    channels["torque"] = np.interp(samples * (1.0 - 1e-6 * size), samples, channels["torque"])


def pass_low(channels, size):
    for name, values in channels.items():
        channels[name] = signal.lfilter(*signal.butter(2, size, fs=1000.0), values)


def interpolate(channels, size):
    for name, values in channels.items():
        samples = np.arange(values.size)
        kept = samples[:: 1000 // size]
        channels[name] = np.interp(samples, kept, values[kept])


def misstate_rate(channels, size):
    """The rate is taken for so much of what it is."""
    channels["sampling_rate"] = 1000.0 * size


# Sizes, and the property of a `Plant` that has them, with others.
PLANTS = {
    "none": ((0.0,), "cubic", {}),
    "reaction against [N·m/rad]": ((40.0, 80.0), "reaction", {}),
    "reaction with [N·m/rad]": ((-40.0, -80.0), "reaction", {}),
    "long-latency reflex [N·m/rad]": ((20.0, 40.0), "reaction", {"latency": 0.09}),
    "cubic stiffness [N·m/rad³]": ((5e4, 1e5), "cubic", {}),
    "drag [N·m·s²/rad²]": ((0.4, 0.8), "drag", {}),
    "reflex of the antagonist [N·m·s/rad]": ((6.5, 13.0), "antagonist", {}),
    "reflex of both directions [N·m·s/rad]": ((-6.5, -13.0), "antagonist", {}),
    "K over the record, with G −60 %": ((-0.15, -0.3), "stiffness_change", {"gain_change": -0.6}),
    "short-range stiffness [N·m/rad]": ((50.0, 150.0), "short_range", {}),
    "stiffness that relaxes [N·m/rad]": ((50.0, 100.0), "relaxing", {}),
    "passive joint, K [N·m/rad]": ((150.0, 75.0), "stiffness", {"gain": 0.0}),
}
# Sizes, and what changes the channels by them.
RECORDERS = {
    "crosstalk of the command [N·m/rad]": ((25.0, 50.0), add_crosstalk),
    "position that saturates [rad]": ((0.04, 0.03), saturate),
    "torque that is clipped [N·m]": ((8.0, 6.0), clip),
    "gain of the torque from the middle": ((1.5, 2.0), partial(change_gain, channel="torque")),
    "gain of the position from the middle": ((1.5, 2.0), partial(change_gain, channel="position")),
    "samples lost in the torque": ((5, 20), partial(lose_samples, channel="torque")),
    "samples lost in the position": ((5, 20), partial(lose_samples, channel="position")),
    "series stiffness [N·m/rad]": ((2000.0, 1000.0), comply),
    "filters [Hz]": ((20.0, 10.0), pass_low),
    "footplate [kg·m²]": ((0.005, 0.015), add_footplate),
    "gravity [N·m/rad]": ((10.0, 30.0), add_gravity),
    "rate stated too low": ((0.9, 0.8), misstate_rate),
    "interpolation from [Hz]": ((500, 200), interpolate),
    "clocks [ppm]": ((50.0, 200.0), run_fast),
}
ROWS = PLANTS | RECORDERS


def compute_truths(plant, trial):
    """K, B and G on average over the record: the lines that fit torques over position and velocity, and I."""
    position = trial.position.to_numpy()
    velocity = np.gradient(position, 1.0 / trial.attrs["sampling_rate"])
    bend = plant.cubic * np.mean(position**4) / np.mean(position**2)
    drag = plant.drag * np.mean(np.abs(velocity) ** 3) / np.mean(velocity**2)
    return {
        "K": plant.stiffness * (1.0 + plant.stiffness_change / 2.0) + bend,
        "B": plant.viscosity + drag,
        "I": plant.inertia,
        "G": plant.gain * (1.0 + plant.gain_change / 2.0),
    }


def judge(plant, trial, methods):
    """For each method whether it warned, and the relative errors; those of a G that is zero over that of others."""
    rows = []
    for method in methods:
        estimate = identify(trial, method.split(",")[0], **METHODS[method])
        values = {**estimate.stiffness, **estimate.reflex}
        row = {"method": method, "warned": bool(estimate.diagnostics["warnings"])}
        for name, truth in compute_truths(plant, trial).items():
            row[name] = (values[name] - truth) / (truth or TRUTHS[name])
        row["near"] = max(abs(row[name]) for name in "KBG") <= LIMIT
        rows.append(row)
    return rows


def describe_load(load):
    return dict(zip(("load_inertia", "load_viscosity", "load_stiffness"), load, strict=True))


def judge_effect(effect, size, seed, methods):
    """Outcomes of an effect; loads and voluntary torque alternate."""
    settings = describe_load(LOADS[seed % 2])
    settings["latency"] = np.random.default_rng(seed).uniform(0.15, 0.18)
    if effect in PLANTS:
        _, name, others = PLANTS[effect]
        settings |= {name: size, **others}
    trial = simulate_independently(seed, voluntary=(0.05, 0.5)[seed // 2 % 2], **settings)
    plant = Plant(**settings)
    if effect in RECORDERS:
        channels = {name: trial[name].to_numpy() for name in trial}
        RECORDERS[effect][1](channels, size)
        trial = new_trial(**{"sampling_rate": 1000.0, **channels})
    return [{"effect": effect, "size": size, **row} for row in judge(plant, trial, methods)]


def judge_good(seed, methods):
    """Outcomes of a good record of any kind, duration and rate."""
    rng = np.random.default_rng(seed)
    settings = {
        "kind": rng.choice([*KINDS, "multisine"]),
        "duration": rng.choice([12.0, 20.0, 50.0, 120.0, 300.0]),
        "rate": int(rng.choice([200, 500, 1000, 2000, 5000, 10_000])),
        "voluntary": rng.choice([0.05, 0.5]),
        "snr_db": rng.choice([10.0, np.inf]),
    }
    load = describe_load(LOADS[seed % 2])
    trial = simulate_independently(seed, **settings, **load)
    return [{**settings, **row} for row in judge(Plant(), trial, methods)]


def count_outcomes(outcomes, by):
    """Numbers of records: warned / right / wrong without a warning; and medians of the errors [%]."""
    silent = ~outcomes["warned"]
    counts = pd.DataFrame(
        {
            "warned": outcomes["warned"],
            "right": silent & outcomes["near"],
            "wrong": silent & ~outcomes["near"],
        }
    )
    keys = [outcomes[name] for name in by]
    table = counts.groupby(keys, sort=False).sum()
    errors = 100 * outcomes[list("KBIG")].groupby(keys, sort=False).median()
    return table.join(errors.map("{:+.0f}".format)).reset_index()


def count_false_warnings(outcomes):
    """Numbers of good records by method: warned / right / wrong without a warning / warned although all was right."""
    table = count_outcomes(outcomes, ["method"]).drop(columns=list("KBIG"))
    false = outcomes["warned"] & outcomes["near"]
    return table.assign(false=false.groupby(outcomes["method"], sort=False).sum().to_numpy())


def measure_effects(seeds, records, effects=tuple(ROWS), methods=tuple(METHODS), jobs=2):
    """Outcomes of effects at their sizes, and of good records."""
    cases = [
        (effect, size, seed) for effect in effects for size in ROWS[effect][0] for seed in seeds
    ]
    with ProcessPoolExecutor(jobs) as pool:
        judged = pool.map(partial(judge_effect, methods=methods), *zip(*cases, strict=True))
        good = pool.map(partial(judge_good, methods=methods), range(records))
        return pd.DataFrame(chain.from_iterable(judged)), pd.DataFrame(chain.from_iterable(good))


def main():
    """Print the outcomes of some effects."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "effects", nargs="*", default=[""], help="parts of their names; default: all"
    )
    parser.add_argument("--methods", nargs="+", default=list(METHODS), choices=METHODS)
    parser.add_argument("--seeds", type=int, default=24)
    parser.add_argument("--good", type=int, default=0, help="good records")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    options = parser.parse_args()
    chosen = [effect for effect in ROWS if any(part in effect for part in options.effects)]
    outcomes, good = measure_effects(
        range(options.seeds), options.good, chosen, options.methods, options.jobs
    )
    print(format_table(count_outcomes(outcomes, ["effect", "size", "method"])))
    if options.good:
        print(format_table(count_false_warnings(good)))


if __name__ == "__main__":
    main()
