"""Estimates during the recording: errors and coverage of windows, when there is enough, changes that are found.

Two loads and a voluntary torque of 5 and 30 % in turn, 10 dB, windows of 20 s. `python benchmarks/live.py` prints all
tables in about an hour; its arguments are names of `KINDS`.
"""

import itertools
import sys

import numpy as np
import pandas as pd
from faults import LOADS, TRUTHS
from tools import format_table

from ankleloop import LiveEstimate, simulate

CONDITIONS = list(itertools.product(LOADS, (0.05, 0.3)))
STEP_TIME = 40.0  # s
GOALS = (("K", 0.05), ("K", 0.1), ("G", 0.2))
RISE, FALL = (
    {"duration": 60.0, "variation": "time", "stiffness_table": [150.0] * 40 + [stiffness] * 20}
    for stiffness in (195.0, 105.0)
)
# Seeds and settings of records: of 600 windows in each condition that do not overlap, of a joint that stays as it is,
# and of one whose K changes by 30 % at 40 s.
KINDS = {
    "windows": (range(810_000, 810_120), {"duration": 400.0, "every": 10.0}),
    "constant": (range(820_000, 820_060), {"duration": 120.0}),
    "rise": (range(830_000, 830_100), RISE),
    "fall": (range(840_000, 840_100), FALL),
}


def follow(seed, every=0.5, **settings):
    """History of a record, and since when K and G have changed by what is known at each time."""
    load, voluntary = CONDITIONS[seed % len(CONDITIONS)]
    trial = simulate(seed=seed, load=load, voluntary=voluntary, **settings)
    channels = trial[["position", "torque", "reference"]].to_array().to_numpy()
    live = LiveEstimate(1000.0, every=every, beside=False)
    changes = []
    for piece in np.split(channels, round(settings["duration"] / every), axis=1):
        live.add(*piece)
        changes.append(live.change["since"])
    since = pd.DataFrame(changes, index=range(len(changes)))
    labels = {"seed": seed, "load": f"{load[0]:g}", "voluntary": f"{100 * voluntary:.0f} %"}
    return live.history.join(since, rsuffix="_since").assign(**labels)


def follow_all(kind):
    """Histories of all records of a kind, with the errors of the parameters [%] and whether their intervals hold."""
    seeds, settings = KINDS[kind]
    rows = pd.concat([follow(seed, **settings) for seed in seeds])
    for name, truth in TRUTHS.items():
        rows[f"{name}_error"] = 100.0 * (rows[name] / truth - 1.0)
        rows[f"{name}_held"] = rows[f"{name}_low"].le(truth) & rows[f"{name}_high"].ge(truth)
    return rows


def summarise_windows(rows):
    """Mean error with its standard error, and coverage, of windows that do not overlap."""
    for condition, part in rows[rows["time"] % 20.0 < 0.1].groupby(["load", "voluntary"]):
        row = {"load, voluntary": ", ".join(condition), "windows": len(part)}
        for name in TRUTHS:
            error = part[f"{name}_error"]
            row[f"{name} [%]"] = f"{error.mean():+.2f} ± {error.sem():.2f}"
            row[f"{name} held [%]"] = f"{100.0 * part[f'{name}_held'].mean():.1f}"
        yield row


def summarise_enough(rows):
    """Coverage at the moment when there is first enough, until the step."""
    early = rows[rows["time"] <= STEP_TIME]
    for (name, share), (condition, part) in itertools.product(
        GOALS, early.groupby(["load", "voluntary"])
    ):
        margin = np.maximum(part[f"{name}_high"] - part[name], part[name] - part[f"{name}_low"])
        first = part[margin <= share * part[name]].groupby("seed").first()
        yield {
            "goal": f"{name} ± {100 * share:g} %",
            "load, voluntary": ", ".join(condition),
            "records": f"{len(first)} of {part['seed'].nunique()}",
            "after [s]": f"{first['time'].median():.1f}",
            "held [%]": f"{100.0 * first[f'{name}_held'].mean():.1f}",
        }


def summarise_changes(rows):
    """Share of records with a change that is found: before the step, and within 10 s of it."""
    for condition, part in rows.groupby(["load", "voluntary"]):
        row = {"load, voluntary": ", ".join(condition), "records": part["seed"].nunique()}
        for name in "KG":
            found = part[part[f"{name}_since"].notna()].groupby("seed")["time"].min() - STEP_TIME
            row |= {
                f"{name} before": np.sum(found <= 0.0),
                f"{name} within 10 s": np.sum((found > 0.0) & (found <= 10.0)),
                f"{name} later": np.sum(found > 10.0),
                f"{name} after [s]": f"{found[found > 0.0].median():.1f}",
            }
        yield row


def main():
    """Print the tables of kinds of records."""
    for kind in sys.argv[1:] or KINDS:
        rows = follow_all(kind)
        print(f"{kind}: seeds from {KINDS[kind][0][0]}")
        summaries = [summarise_windows]
        if kind != "windows":
            summaries = [summarise_enough, summarise_changes]
        for summarise in summaries:
            print(format_table(summarise(rows)), end="\n\n", flush=True)


if __name__ == "__main__":
    main()
