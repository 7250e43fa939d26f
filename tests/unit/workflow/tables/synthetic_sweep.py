"""Tables of trials as sweeps give them, from formulas: for tests of summaries and pictures."""

import itertools

import numpy as np
import pandas as pd

from ankleloop.quantities import point_column
from ankleloop.simulation.settings import SimulationSettings
from ankleloop_workflow.config.settings import SweepSettings

LABELS = {"riv": "Refined instrumental variables", "moesp": "PR-MOESP"}
SETTINGS = SimulationSettings.defaults()
NUMBERS = ["vaf_net_true", "vaf_intrinsic_true", "vaf_reflex_true", "K", "G"]


def grid(**values):
    """All combinations of values."""
    return [
        dict(zip(values, combination, strict=True))
        for combination in itertools.product(*values.values())
    ]


def sweep_options(**options):
    """Fields of SweepSettings, as the notebook gets them."""
    return SweepSettings(**options).model_dump()


def make_trials(points, *, trials=3, fail=lambda row: False, warn=lambda row: False, seed=1):
    """One row for each point, method and trial."""
    rng = np.random.default_rng(seed)
    rows = []
    for values, (rank, method), trial in itertools.product(
        points, enumerate(LABELS), range(trials)
    ):
        gain, noise = values.get("reflex_gain", 13.0), values.get("voluntary", 0.05)
        row = {
            "study": "s",
            "point": ",".join(f"{name}={value}" for name, value in sorted(values.items())),
            **{point_column(name): value for name, value in values.items()},
        }
        row |= {"method": method, "trial": trial}
        loss = noise * (1.0 + rank) + 0.1 * rng.random()
        row |= {
            "vaf_net_true": 99.0 - loss,
            "vaf_intrinsic_true": 98.0 - 2 * loss,
            "vaf_reflex_true": 97.0 - 4 * loss,
        }
        row |= {
            "K": 150.0 - 5 * loss,
            "G": gain * (1 - 0.1 * loss),
            "failure": None,
            "warnings": "",
        }
        if fail(row):
            row |= {**dict.fromkeys(NUMBERS, np.nan), "failure": "no pole"}
        elif warn(row):
            row["warnings"] = "a pole is near 1"
        rows.append(row)
    return pd.DataFrame(rows)


def write_trials(path, table):
    """Write a table of trials as the workflow does: text as categories."""
    texts = table.select_dtypes(include=["object", "str"]).columns
    categories = {
        name: table[name].astype("category")
        for name in texts
        if name in ("study", "point", "method")
    }
    table.assign(**categories).to_parquet(path)
    return path
