"""Estimates during the recording: errors and coverage, when there is enough, changes that are found, false alarms.

Two loads and a voluntary torque of 5 and 30 % in turn, 10 dB, windows of 20 s. `python benchmarks/live.py` prints all
tables in about an hour; its arguments are names of `KINDS`.
"""

import itertools
import sys

import numpy as np
import pandas as pd
from faults import LOADS, TRUTHS

from ankleloop import LiveEstimate, simulate

CONDITIONS = list(itertools.product(LOADS, (0.05, 0.3)))
LABELS = ["load_inertia", "voluntary"]
STEP_TIME = 30.0  # s
FOUND = (-np.inf, 0.0, 10.0, np.inf)  # limits of the time after it [s]
GOALS = {"K within 5 %": ("K", 0.05), "K within 10 %": ("K", 0.1), "G within 20 %": ("G", 0.2)}
STEP = {"variation": "time", "stiffness_table": [150.0] * 30 + [195.0] * 10}
# Seeds and settings of records: of 600 windows in each condition that do not overlap, of a joint that stays as it is,
# and of one whose K rises by 30 % at 30 s.
KINDS = {
    "windows": (range(810_000, 810_120), {"duration": 400.0, "every": 10.0}),
    "constant": (range(820_000, 820_060), {"duration": 120.0}),
    "step": (range(830_000, 830_200), {"duration": 40.0, **STEP}),
}


def follow(seed, every=0.5, **settings):
    """History of a record, with what is known at each time: since when K and G have changed, or are narrow enough."""
    load, voluntary = CONDITIONS[seed % len(CONDITIONS)]
    trial = simulate(seed=seed, load=load, voluntary=voluntary, **settings)
    channels = np.stack([trial[name] for name in ("position", "torque", "reference")])
    known = []
    with LiveEstimate(1000.0, every=every, beside=False) as live:
        for piece in np.split(channels, round(settings["duration"] / every), axis=1):
            live.add(*piece)
            enough = {
                goal: live.enough_since({name: share}) for goal, (name, share) in GOALS.items()
            }
            known.append({**live.change["since"], **enough})
    labels = {name: trial.attrs[name] for name in LABELS}
    return live.history.join(pd.DataFrame(known), rsuffix="_since").assign(seed=seed, **labels)


def follow_all(kind):
    """Histories of all records of a kind, with errors [%], and whether intervals hold the truth [%]."""
    seeds, settings = KINDS[kind]
    rows = pd.concat([follow(seed, **settings) for seed in seeds])
    for name, truth in TRUTHS.items():
        rows[f"{name}_error"] = 100.0 * (rows[name] / truth - 1.0)
        rows[f"{name}_held"] = (
            100.0 * rows[f"{name}_low"].le(truth) * rows[f"{name}_high"].ge(truth)
        )
    return rows


def summarise_windows(rows):
    """Mean errors with their standard errors, and coverage, of windows that do not overlap."""
    groups = rows[rows["time"] % 20.0 < 0.1].groupby(LABELS)
    yield groups[[f"{name}_error" for name in TRUTHS]].agg(["mean", "sem"])
    yield groups[[f"{name}_held" for name in TRUTHS]].agg(["mean", "count"])


def summarise_enough(rows):
    """Coverage at the moment when there is first enough, before any step."""
    early = rows[rows["time"] <= STEP_TIME]
    for goal, (name, _) in GOALS.items():
        first = early[early[goal].notna()].groupby([*LABELS, "seed"]).first()
        table = first.groupby(LABELS)[["time", f"{name}_held"]].agg(["mean", "count"])
        yield table.rename_axis(columns=[goal, ""])


def summarise_changes(rows):
    """Records with a change that is found before the step, within 10 s of it, or later."""
    for name in ("K", "G"):
        found = rows[rows[f"{name}_since"].notna()].groupby([*LABELS, "seed"])["time"].min()
        after = pd.cut(found - STEP_TIME, FOUND).groupby(LABELS)
        yield after.value_counts().unstack().rename_axis(columns=f"{name} found [s]")


def main():
    """Print the tables of kinds of records."""
    for kind in sys.argv[1:] or KINDS:
        rows = follow_all(kind)
        print(f"{kind}: {rows['seed'].nunique()} records, seeds from {rows['seed'].min()}")
        summaries = [summarise_windows]
        if kind != "windows":
            summaries = [summarise_enough, summarise_changes]
        for table in itertools.chain(*(summarise(rows) for summarise in summaries)):
            print(f"{table.round(2).to_string()}\n", flush=True)


if __name__ == "__main__":
    main()
