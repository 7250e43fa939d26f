"""Do 95 % intervals hold the truth in 95 of 100 trials? Trials are simulated, identified and forgotten.

Run by `make coverage`. The settings are those of the study `efficiency` in config/config.yaml; 1,000 trials of five
settings take about eight minutes on two cores. Writes results/tables/coverage.csv and coverage.md.
"""

import argparse
import multiprocessing
import os
from functools import partial
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pandas as pd
import yaml

from ankleloop.assessment.scores import parameters
from ankleloop.methods.registry import identify
from ankleloop.replication.captions import setting
from ankleloop.replication.tables import efficiency, write_table
from ankleloop.simulation import Simulation, simulate

CONFIG = Path(__file__).resolve().parents[1] / "config" / "config.yaml"
TRUTHS = {"K": "stiffness", "B": "viscosity", "I": "inertia", "G": "reflex_gain", "omega_n": "omega_n", "zeta": "zeta"}


def settings_of(study):
    """Parameters of each point of a study, by what it is called."""
    shared = {name: value for name, value in study["simulation"].items() if value is not None}
    points = [Simulation.from_flat(**shared, **point) for point in study["points"]]
    return {setting(point.flat()): point.flat() for point in points}


def one(seed, given):
    """Estimates of one trial with their intervals."""
    trial = simulate(seed=seed, **given)
    return parameters(trial, identify(trial, "riv"))


def main():
    """Run the study and print its table."""
    command = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    command.add_argument("--trials", type=int, default=1000)
    command.add_argument("--cores", type=int, default=2)
    asked = command.parse_args()
    points = settings_of(yaml.safe_load(CONFIG.read_text(encoding="utf-8"))["studies"]["efficiency"])
    found = []
    with multiprocessing.Pool(asked.cores) as pool:
        for number, (name, given) in enumerate(points.items(), start=1):
            rows = []
            for done, row in enumerate(pool.imap(partial(one, given=given), range(asked.trials), chunksize=5), start=1):
                rows.append(row)
                if done % 100 == 0:
                    print(f"setting {number} of {len(points)}: {done} of {asked.trials} trials", flush=True)
            found.append(pd.concat(rows).assign(point=name, method="riv"))
    truths = {name: {key: given[of] for key, of in TRUTHS.items()} for name, given in points.items()}
    nothing = {(name, "riv"): {} for name in points}
    table = efficiency(pd.concat(found), truths, nothing).drop(columns=["method", "bound", "ratio"])
    wide = table.pivot_table("covered", "point", "parameter", sort=False).map("{:.1f}".format).reset_index()
    stem = CONFIG.parents[1] / "results" / "tables" / "coverage"
    stem.parent.mkdir(parents=True, exist_ok=True)
    caption = f"95 % intervals of `riv` that hold the truth [%]; {asked.trials} trials in each setting."
    write_table(table, stem, wide, caption)
    print(wide.to_string(index=False), caption, sep="\n")


if __name__ == "__main__":
    main()
