"""Everyday faults of a laboratory: how often an estimate is wrong without a warning, or warns without a fault.

An estimate is wrong where K, B, I or G is off by more than 15 %, or by three half-widths of its interval.
"""

import itertools
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pandas as pd
from scipy import signal

from ankleloop import identify, new_trial, simulate

TRUTHS = {"K": 150.0, "B": 0.8, "I": 0.015, "G": 13.0}
CHANNELS = ("position", "torque", "reference")
METHODS = {
    "riv": {},
    "riv-tv": {"cycle_onsets": tuple(np.arange(0.0, 48.0))},
    "pr-moesp": {"basis": "rectifier"},
    "parallel-cascade": {},
}
CONDITIONS = [
    {"load": load, "snr_db": snr, "voluntary": voluntary, "closed_loop": closed}
    for load, (snr, voluntary), closed in itertools.product(
        ((1.1, 7.1, 250.0), (0.1, 10.0, 100.0)),
        ((None, 0.0), (10.0, 0.05), (10.0, 0.3), (3.0, 0.05), (10.0, 1.0)),
        (True, False),
    )
]


def change(trial, rate=1000.0, **functions):
    """A trial with channels that functions have changed."""
    values = {name: functions.get(name, lambda x: x)(trial[name].to_numpy()) for name in CHANNELS}
    return new_trial(values["position"], values["torque"], rate, values["reference"])


def delay_channel(x):
    return np.concatenate([np.full(5, x[0]), x[:-5]])


def pass_high(x):
    return signal.lfilter(*signal.butter(1, 0.5, "high", fs=1000.0), x - x.mean())


def rub(trial):
    velocity = np.gradient(trial["position"].to_numpy(), 1e-3)
    return change(trial, torque=lambda x: x + 2.0 * np.tanh(velocity / 0.02))


def fill(seed, kind):
    """Function that fills 49 gaps of 300 ms by the last value, or by straight lines."""
    starts = np.random.default_rng(seed).choice(np.arange(500, 49_400, 320), 49, replace=False)

    def fill_gaps(x):
        x = x.copy()
        for start in starts:
            end = x[start] if kind == "held" else x[start + 300]
            x[start : start + 300] = np.linspace(x[start], end, 300, endpoint=False)
        return x

    return fill_gaps


def add_noise(seed, hum=0.0, white=0.0):
    noise = hum * np.sin(0.1 * np.pi * np.arange(50_000)) + white * np.random.default_rng(seed).standard_normal(50_000)
    return change(simulate(seed=seed), position=lambda x: x + noise)


FAULTS = {
    "none": lambda seed: simulate(seed=seed),
    "open loop": lambda seed: simulate(seed=seed, closed_loop=False),
    "stiff load": lambda seed: simulate(seed=seed, load=(10.0, 300.0, 1e4)),
    "reflex at 80 ms": lambda seed: simulate(seed=seed, delay=0.08),
    "half the sampling rate": lambda seed: change(simulate(seed=seed), 500.0),
    "torque 5 ms late": lambda seed: change(simulate(seed=seed), torque=delay_channel),
    "torque without what is below 0.5 Hz": lambda seed: change(simulate(seed=seed), torque=pass_high),
    "torque that saturates at 10 N·m": lambda seed: change(
        simulate(seed=seed), torque=lambda x: 10.0 * np.tanh(x / 10.0)
    ),
    "friction of 2 N·m": lambda seed: rub(simulate(seed=seed)),
    "all signs turned round": lambda seed: change(simulate(seed=seed), **dict.fromkeys(CHANNELS, np.negative)),
    "hum of 6 mrad": lambda seed: add_noise(seed, hum=6e-3),
    "hum of 1.5 mrad": lambda seed: add_noise(seed, hum=1.5e-3),
    "white noise of 1.1 mrad": lambda seed: add_noise(seed, white=1.1e-3),
    "gaps held": lambda seed: change(simulate(seed=seed), **dict.fromkeys(CHANNELS[:2], fill(seed, "held"))),
    "gaps bridged": lambda seed: change(simulate(seed=seed), **dict.fromkeys(CHANNELS[:2], fill(seed, "line"))),
    "gaps held in the position": lambda seed: change(simulate(seed=seed), position=fill(seed, "held")),
    "gaps bridged in the torque": lambda seed: change(simulate(seed=seed), torque=fill(seed, "line")),
    "every tenth sample": lambda seed: change(simulate(seed=seed), 100.0, **dict.fromkeys(CHANNELS, lambda x: x[::10])),
    "every fifth sample": lambda seed: change(simulate(seed=seed), 200.0, **dict.fromkeys(CHANNELS, lambda x: x[::5])),
}


def is_wrong(estimate):
    values = {**estimate.stiffness, **estimate.reflex}
    for name, truth in TRUTHS.items():
        if name in values:
            low, high = estimate.intervals.get(name, (-np.inf, np.inf))
            error = abs(values[name] - truth)
            if error > 0.15 * truth or error > 1.5 * (high - low):
                return True
    return False


def judge(trial, method):
    """Whether an estimate warned, held or is wrong without a warning."""
    estimate = identify(trial, method, **METHODS[method])
    if estimate.diagnostics["warnings"]:
        return "warned"
    return "silently wrong" if is_wrong(estimate) else "held"


def judge_fault(fault, seed):
    trial = FAULTS[fault](seed)
    return [{"fault": fault, "method": method, "outcome": judge(trial, method)} for method in METHODS]


def judge_condition(condition, seed):
    """Whether a record without a fault is warned of although every parameter is within 15 %."""
    trial, rows = simulate(seed=seed, **CONDITIONS[condition]), []
    for method, options in METHODS.items():
        estimate = identify(trial, method, **options)
        values = {**estimate.stiffness, **estimate.reflex}
        near = all(abs(values[name] / truth - 1.0) < 0.15 for name, truth in TRUTHS.items() if name in values)
        rows.append({"method": method, "false warning": near and bool(estimate.diagnostics["warnings"])})
    return rows


def measure_faults(seeds, records):
    """Rates of warned, held and silently wrong estimates by fault and method, and of false warnings by method."""
    with ProcessPoolExecutor() as pool:
        jobs = list(itertools.product(FAULTS, seeds))
        rows = itertools.chain(*pool.map(judge_fault, *zip(*jobs, strict=True)))
        jobs = [(number % len(CONDITIONS), seeds[0] + 10_000 + number) for number in range(records)]
        healthy = pd.DataFrame(itertools.chain(*pool.map(judge_condition, *zip(*jobs, strict=True))))
    outcomes = pd.DataFrame(rows)
    shares = pd.crosstab([outcomes["fault"], outcomes["method"]], outcomes["outcome"])
    shares = shares.reindex(columns=["warned", "held", "silently wrong"], fill_value=0)
    cells = shares.astype(str).agg(" / ".join, axis=1).unstack("method")
    return cells.loc[list(FAULTS), list(METHODS)], healthy.groupby("method", sort=False)["false warning"].sum()
