"""Everyday faults of a laboratory: how often an estimate is wrong without a warning, or warns without a fault.

An estimate is wrong where K, B, I or G is off by more than 15 %, or by three half-widths of its interval.
"""

import itertools
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np
import pandas as pd
from scipy import signal

from ankleloop import identify, new_trial, simulate

TRUTHS = {"K": 150.0, "B": 0.8, "I": 0.015, "G": 13.0}
METHODS = {
    "riv": {},
    "riv-tv": {"cycle_onsets": tuple(np.arange(0.0, 48.0))},
    "pr-moesp": {"basis": "rectifier"},
    "parallel-cascade": {},
}
LOADS = ((1.1, 7.1, 250.0), (0.1, 10.0, 100.0))
NOISES = (
    (None, 0.0),
    (10.0, 0.05),
    (10.0, 0.3),
    (3.0, 0.05),
    (10.0, 1.0),
)  # SNR [dB] and voluntary torque
CONDITIONS = list(itertools.product(LOADS, NOISES, (True, False)))


# What a fault makes of a channel, from its values, the position and the seed of the trial.
def delay(x, position, seed):
    return np.concatenate([np.full(5, x[0]), x[:-5]])


def pass_high(x, position, seed):
    return signal.lfilter(*signal.butter(1, 0.5, "high", fs=1000.0), x - x.mean())


def saturate(x, position, seed):
    return 10.0 * np.tanh(x / 10.0)


def rub(x, position, seed):
    return x + 2.0 * np.tanh(np.gradient(position, 1e-3) / 0.02)


def turn(x, position, seed):
    return -x


def hold(x, position, seed, *, bridged=False):
    """Fill 49 gaps of 300 ms by the last value, or by straight lines."""
    x = x.copy()
    for start in np.random.default_rng(seed).choice(np.arange(500, 49_400, 320), 49, replace=False):
        end = x[start + 300] if bridged else x[start]
        x[start : start + 300] = np.linspace(x[start], end, 300, endpoint=False)
    return x


bridge = partial(hold, bridged=True)


def hum(size):
    return lambda x, position, seed: x + size * np.sin(0.1 * np.pi * np.arange(x.size))


def add_white_noise(x, position, seed):
    return x + 1.1e-3 * np.random.default_rng(seed).standard_normal(x.size)


def take_every(step):
    return lambda x, position, seed: x[::step]


def on_all(function):
    return dict.fromkeys(("position", "torque", "reference"), function)


# Settings of the simulation, and which channels are changed by what.
FAULTS = {
    "none": ({}, {}),
    "open loop": ({"closed_loop": False}, {}),
    "stiff load": ({"load": (10.0, 300.0, 1e4)}, {}),
    "reflex at 80 ms": ({"delay": 0.08}, {}),
    "half the sampling rate": ({}, on_all(take_every(1))),
    "torque 5 ms late": ({}, {"torque": delay}),
    "torque without what is below 0.5 Hz": ({}, {"torque": pass_high}),
    "torque that saturates at 10 N·m": ({}, {"torque": saturate}),
    "friction of 2 N·m": ({}, {"torque": rub}),
    "all signs turned round": ({}, on_all(turn)),
    "hum of 6 mrad": ({}, {"position": hum(6e-3)}),
    "hum of 1.5 mrad": ({}, {"position": hum(1.5e-3)}),
    "white noise of 1.1 mrad": ({}, {"position": add_white_noise}),
    "gaps held": ({}, {"position": hold, "torque": hold}),
    "gaps bridged": ({}, {"position": bridge, "torque": bridge}),
    "gaps held in the position": ({}, {"position": hold}),
    "gaps bridged in the torque": ({}, {"torque": bridge}),
    "every tenth sample": ({}, on_all(take_every(10))),
    "every fifth sample": ({}, on_all(take_every(5))),
}
RATES = {
    "half the sampling rate": 500.0,
    "every tenth sample": 100.0,
    "every fifth sample": 200.0,
}  # Hz, else 1,000


def judge(trial):
    """For each method whether it warned, and the largest relative error; infinite where an interval misses by far."""
    rows = []
    for method, options in METHODS.items():
        estimate = identify(trial, method, **options)
        values, worst = {**estimate.stiffness, **estimate.reflex}, 0.0
        for name in values.keys() & TRUTHS.keys():
            low, high = estimate.intervals.get(name, (-np.inf, np.inf))
            error = abs(values[name] - TRUTHS[name])
            worst = max(worst, error / TRUTHS[name], np.inf if error > 1.5 * (high - low) else 0.0)
        rows.append(
            {"method": method, "warned": bool(estimate.diagnostics["warnings"]), "error": worst}
        )
    return rows


def make_faulty_trial(fault, seed):
    """A trial with a fault."""
    settings, functions = FAULTS[fault]
    trial = simulate(seed=seed, **settings)
    if functions:
        values = {name: trial[name].to_numpy() for name in on_all(None)}
        values |= {
            name: function(values[name], values["position"], seed)
            for name, function in functions.items()
        }
        trial = new_trial(
            values["position"], values["torque"], RATES.get(fault, 1000.0), values["reference"]
        )
    return trial


def make_good_trial(number, seed):
    """A trial without a fault, of one of the conditions in turn."""
    load, (snr_db, voluntary), closed = CONDITIONS[number % len(CONDITIONS)]
    return simulate(seed=seed, load=load, snr_db=snr_db, voluntary=voluntary, closed_loop=closed)


def judge_fault(fault, seed):
    return [{"fault": fault, **row} for row in judge(make_faulty_trial(fault, seed))]


def judge_condition(number, seed):
    return judge(make_good_trial(number, seed))


def measure_faults(seeds, records):
    """Warned / held / silently wrong estimates by fault and method, and false warnings by method."""
    with ProcessPoolExecutor() as pool:
        jobs = list(itertools.product(FAULTS, seeds))
        outcomes = pd.DataFrame(itertools.chain(*pool.map(judge_fault, *zip(*jobs, strict=True))))
        healthy = pool.map(
            judge_condition, range(records), range(seeds[0] + 10_000, seeds[0] + 10_000 + records)
        )
        healthy = pd.DataFrame(itertools.chain(*healthy))
    near = outcomes["error"] <= 0.15
    counts = {
        "warned": outcomes["warned"],
        "held": ~outcomes["warned"] & near,
        "wrong": ~outcomes["warned"] & ~near,
    }
    table = outcomes.assign(**counts).groupby(["fault", "method"])[list(counts)].sum()
    cells = (
        table.astype(str).agg(" / ".join, axis=1).unstack("method").loc[list(FAULTS), list(METHODS)]
    )
    false = healthy["warned"] & (healthy["error"] < 0.15)
    return cells, false.groupby(healthy["method"], sort=False).sum()
