"""Coverage of the 95 % intervals of `riv`: the share of trials in which an interval holds the truth.

Run by `make coverage`. The settings are those of the study `efficiency` in config/config.yaml; 1,000 trials of five
settings take about eight minutes on two cores. No trial is written to disk. Writes results/tables/coverage.csv and
coverage.md.
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

from ankleloop.assessment.scores import parameter_row
from ankleloop.joint.prepared import prepare
from ankleloop.methods.registry import identify
from ankleloop.replication.captions import format_point
from ankleloop.replication.tables import compare_with_bound, write_table
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.simulation.simulate import simulate

CONFIG = Path(__file__).resolve().parents[1] / "config" / "config.yaml"
TRUTHS = {"K": "stiffness", "B": "viscosity", "I": "inertia", "G": "reflex_gain", "omega_n": "omega_n", "zeta": "zeta"}


def read_points(path=CONFIG, study="efficiency"):
    """Simulation settings of each point of a study, by the caption of the point."""
    settings = yaml.safe_load(path.read_text(encoding="utf-8"))["studies"][study]
    points = [SimulationSettings.parse("the study", **settings["simulation"], **point) for point in settings["points"]]
    return {format_point(dict(point)): dict(point) for point in points}


def estimate_parameters(seed, settings):
    """Parameters of a simulated trial and their intervals."""
    trial = prepare(simulate(seed=seed, **settings))
    return parameter_row(trial, identify(trial, "riv"))


def estimate_points(points, trials, cores):
    """Table of the estimates of all trials of all points."""
    tables = []
    with multiprocessing.Pool(cores) as pool:
        for number, (name, settings) in enumerate(points.items(), start=1):
            rows = []
            results = pool.imap(partial(estimate_parameters, settings=settings), range(trials), chunksize=5)
            for count, row in enumerate(results, start=1):
                rows.append(row)
                if count % 100 == 0:
                    print(f"setting {number} of {len(points)}: {count} of {trials} trials", flush=True)
            tables.append(pd.DataFrame(rows).assign(point=name, method="riv"))
    return pd.concat(tables)


def compute_coverage(estimates, points):
    """Coverage of each parameter [%] at each point, as a long and as a wide table."""
    truths = {name: {key: settings[value] for key, value in TRUTHS.items()} for name, settings in points.items()}
    bounds = {(name, "riv"): {} for name in points}
    table = compare_with_bound(estimates, truths, bounds).drop(columns=["method", "bound", "ratio"])
    wide = table.pivot_table("covered", "point", "parameter", sort=False).map("{:.1f}".format).reset_index()
    return table, wide


def main():
    """Simulate and identify the trials, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trials", type=int, default=1000)
    parser.add_argument("--cores", type=int, default=2)
    parser.add_argument("--folder", type=Path, default=CONFIG.parents[1] / "results" / "tables")
    arguments = parser.parse_args()
    points = read_points()
    table, wide = compute_coverage(estimate_points(points, arguments.trials, arguments.cores), points)
    arguments.folder.mkdir(parents=True, exist_ok=True)
    caption = f"95 % intervals of `riv` that hold the truth [%]; {arguments.trials} trials in each setting."
    write_table(table, arguments.folder / "coverage", wide, caption)
    print(wide.to_string(index=False), caption, sep="\n")


if __name__ == "__main__":
    main()
