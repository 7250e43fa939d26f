"""Coverage of the 95 % intervals of `riv`: the share of trials in which an interval holds what it is for.

Where the model is complete, an interval is for the truth: the settings of the study `efficiency` in config/beyond.yaml.
Where the model is incomplete, it is for what the same fit gives on an infinitely long record: a third-order reflex
fitted by second order, a reflex with a threshold fitted by a rectifier, a stiffness that drifts within the record. A
record a hundred times as long stands for the infinitely long one; it takes two gigabytes of memory.
"""

from concurrent.futures import ProcessPoolExecutor
from functools import partial

import pandas as pd
import yaml
from tools import ROOT

from ankleloop import identify, simulate
from ankleloop.assessment.scores import parameter_row
from ankleloop.joint.prepared import prepare
from ankleloop.simulation.settings import SimulationSettings
from ankleloop_workflow.tables.captions import format_point

TRUTHS = {
    "K": "stiffness",
    "B": "viscosity",
    "I": "inertia",
    "G": "reflex_gain",
    "omega_n": "omega_n",
    "zeta": "zeta",
}
INCOMPLETE = {
    "third-order reflex, fitted by second order": {"pole": 30.0},
    "reflex with a threshold of 0.3 rad/s, fitted by a rectifier": {"reflex_threshold": 0.3},
    "K drifting by 20 % within the record": {
        "variation": "time",
        "stiffness_table": (135.0, 165.0),
    },
}
LONG, LONG_SEED = 5_000.0, 1_000_000  # duration of the long record [s], and its seed


def read_points(study="efficiency"):
    """Simulation settings of each point of a study, by the caption of the point."""
    config = yaml.safe_load((ROOT / "config" / "beyond.yaml").read_text(encoding="utf-8"))[
        "studies"
    ][study]
    points = [config["simulation"] | point for point in config["points"]]
    points = [dict(SimulationSettings.parse("the study", **point)) for point in points]
    return {format_point(point): point for point in points}


def read_truths(points):
    """True parameters of each point."""
    return {
        name: {key: settings[value] for key, value in TRUTHS.items()}
        for name, settings in points.items()
    }


def estimate_truths(points):
    """Parameters that the same fit has on a long record, for each point."""
    truths = {}
    for name, settings in points.items():
        estimate = identify(simulate(seed=LONG_SEED, **settings, duration=LONG), "riv", delay=0.04)
        values = estimate.stiffness | estimate.reflex
        truths[name] = {key: values[key] for key in TRUTHS}
    return truths


def _estimate_parameters(seed, settings):
    trial = prepare(simulate(seed=seed, **settings))
    return parameter_row(trial, identify(trial, "riv", delay=0.04))


def estimate_points(points, trials):
    """Table of the parameters and intervals of all trials of all points, on all cores."""
    with ProcessPoolExecutor() as pool:
        tables = [
            pd.DataFrame(
                pool.map(
                    partial(_estimate_parameters, settings=settings), range(trials), chunksize=5
                )
            )
            for settings in points.values()
        ]
    return pd.concat(tables, keys=points, names=["point"]).reset_index("point")


def compute_coverage(estimates, truths):
    """Coverage of each parameter, and share of robust intervals, at each point [%]."""
    rows = {}
    for name, part in estimates.groupby("point", sort=False):
        held = {
            key: 100.0 * part[f"{key}_low"].le(truth).mul(part[f"{key}_high"].ge(truth)).mean()
            for key, truth in truths[name].items()
        }
        rows[name] = held | {"robust": 100.0 * part["intervals"].eq("robust").mean()}
    return pd.DataFrame.from_dict(rows, orient="index")
