"""Coverage of the 95 % intervals of `riv`: the share of trials in which an interval holds what it is for.

Two tables, of which `benchmarks/measured.py` makes a page. Where the model is complete, an interval is for the truth:
the settings of the study `efficiency` in config/config.yaml. Where the model is incomplete, it is for what the same
fit gives on an infinitely long record: a third-order reflex fitted by second order, a reflex with a threshold fitted
by a rectifier, a stiffness that drifts within the record. A record a hundred times as long stands for the infinitely
long one; it takes two gigabytes of memory. No trial is written to disk.
"""

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
from ankleloop.paper.captions import format_point
from ankleloop.paper.tables import compare_with_bound
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.simulation.simulate import simulate

CONFIG = Path(__file__).resolve().parents[1] / "config" / "config.yaml"
TRUTHS = {"K": "stiffness", "B": "viscosity", "I": "inertia", "G": "reflex_gain", "omega_n": "omega_n", "zeta": "zeta"}
INCOMPLETE = {
    "third-order reflex, fitted by second order": {"pole": 30.0},
    "reflex with a threshold of 0.3 rad/s, fitted by a rectifier": {"reflex_threshold": 0.3},
    "K drifting by 20 % within the record": {"stiffness_drift": 0.2},
}
LONG, LONG_SEED = 100, 1_000_000  # records as long as so many trials, and their seed


def read_points(path=CONFIG, study="efficiency"):
    """Simulation settings of each point of a study, by the caption of the point."""
    settings = yaml.safe_load(path.read_text(encoding="utf-8"))["studies"][study]
    points = [SimulationSettings.parse("the study", **settings["simulation"], **point) for point in settings["points"]]
    return {format_point(dict(point)): dict(point) for point in points}


def read_truths(points):
    """True parameters of each point."""
    return {name: {key: settings[value] for key, value in TRUTHS.items()} for name, settings in points.items()}


def estimate_truths(points):
    """Parameters that the same fit has on a long record, for each point."""
    truths = {}
    for name, settings in points.items():
        duration = LONG * SimulationSettings.parse("the long record", **settings).duration
        estimate = identify(simulate(seed=LONG_SEED, **settings | {"duration": duration}), "riv", delay=0.04)
        values = estimate.stiffness | estimate.reflex
        truths[name] = {key: values[key] for key in TRUTHS}
        text = ", ".join(f"{key} = {value:.4g}" for key, value in truths[name].items())
        print(f"{name}: {text} on {duration:g} s", flush=True)
    return truths


def estimate_parameters(seed, settings):
    """Parameters of a simulated trial and their intervals."""
    trial = prepare(simulate(seed=seed, **settings))
    return parameter_row(trial, identify(trial, "riv", delay=0.04))


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


def compute_coverage(estimates, truths):
    """Coverage of each parameter and share of robust intervals [%] at each point, as a long and as a wide table."""
    bounds = {(name, "riv"): {} for name in truths}
    table = compare_with_bound(estimates, truths, bounds).drop(columns=["method", "bound", "ratio"])
    robust = (estimates["intervals"] == "robust").groupby(estimates["point"], sort=False).mean()
    table["robust"] = 100.0 * table["point"].map(robust)
    wide = table.pivot_table("covered", "point", "parameter", sort=False).map("{:.1f}".format)
    wide["robust"] = (100.0 * robust).map("{:.0f}".format)
    return table, wide.reset_index()
