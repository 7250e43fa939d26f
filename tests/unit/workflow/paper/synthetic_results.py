"""Synthetic results of all studies with chosen means, and the ledger that follows from them."""

import zlib
from collections.abc import Mapping
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

from ankleloop.simulation.settings import SimulationSettings
from ankleloop_workflow.paper.checks import StudyResults
from ankleloop_workflow.paper.ledger import read_claims, verify

PUBLISHED = Path(__file__).parents[4] / "data" / "published"
CLAIMS = read_claims(PUBLISHED / "claims.yaml")
FINDINGS = read_claims(PUBLISHED.parent / "findings.yaml")
TABLES = {name: pd.read_csv(PUBLISHED / f"{name}.csv") for name in ("table1", "table2")}
PAPER = {(n.method, n.torque): n.paper for n in TABLES["table1"].itertuples()}
LOOPS = [{"closed_loop": loop} for loop in (True, False)]
CLEAN = {"snr_db": None, "voluntary": 0.0}
POINTS = {
    "table1": [{"reflex_gain": 13.0}, {"reflex_gain": 2.0}],
    "table2": [{"voluntary": 0.31}],
    "figure4": [{"reflex_gain": float(gain), **CLEAN} for gain in range(10, 31)],
    "voluntary": [
        {"voluntary": level, **loop} for level, loop in product((0.0, 0.25, 0.5, 1.0), LOOPS)
    ],
    "projection": [{"voluntary": 0.05}, {"voluntary": 0.5}],
    "obstacles": [
        {"omitted_step": None},
        {"omitted_step": None, **CLEAN},
        {"omitted_step": None, "antialias_cutoff": 100.0},
        {"omitted_step": "scaling", **CLEAN},
        {"omitted_step": "scaling"},
    ],
    "real-time": [
        {"perturbation": name, "reflex_gain": 5.0, "voluntary": 0.5, **loop}
        for name, loop in product(("pulses", "prbs"), LOOPS)
    ],
    "choosing": [{"voluntary": 1.0}],
}
UNSEEN = ("unseen_cross_validation", "unseen_instrumental")
CASCADES = ("parallel-cascade-one-pass", "parallel-cascade")
METHODS = {
    "table1": ("pr-moesp", "pr-moesp-free-b", "eiv-moesp", *CASCADES),
    "table2": ("pr-moesp", "eiv-moesp", *CASCADES),
    "figure4": ("pr-moesp", *CASCADES),
    "voluntary": (
        "pr-moesp",
        "pr-moesp-instruments",
        "eiv-moesp",
        "pi-moesp",
        "po-moesp",
        *CASCADES,
        "riv",
    ),
    "projection": ("ordinary", "ordinary-rectifier"),
    "obstacles": ("pr-chebyshev", "pr-rectifier"),
    "real-time": ("real-time",),
    "choosing": ("pr-moesp", "riv"),
}
MEASUREMENTS = {
    "block_rows": (15, np.nan, np.nan),
    "pr-moesp_instrument_rows": (15, np.nan, np.nan),
    "eiv-moesp_instrument_rows": (135, np.nan, np.nan),
    **{
        f"{m}_{q}": (1.0, 0.9, 1.1)
        for m in ("pr-moesp", "eiv-moesp")
        for q in ("milliseconds", "megabytes")
    },
    "milliseconds_ratio": (1.2, 1.0, 1.4),
    "megabytes_ratio": (1.2, 1.0, 1.4),
}


def default_vaf(study, settings, method, torque):
    """VAFs with which every claim is reproduced, if only just."""
    if study == "table1" and settings["reflex_gain"] == 13.0:
        return PAPER.get((method.removesuffix("-free-b"), torque), 99.0)
    if study == "figure4":
        return {"pr-moesp": 97.0, "parallel-cascade": 99.0}.get(
            method, 100.0 - settings["reflex_gain"]
        )
    if study == "voluntary":
        return 50.0 if settings["closed_loop"] else 55.0
    if study == "choosing" and method == "pr-moesp":
        return 55.0 if torque == "unseen_instrumental" else 57.0
    return 56.0


def default_error(study, settings, method):
    """Errors of K [%] with which every claim is reproduced; none rests on a processing without a step."""
    if settings.get("omitted_step"):
        return 50.0
    if study == "real-time":
        return 0.0 if settings["perturbation"] == "pulses" and not settings["closed_loop"] else 5.01
    if study == "voluntary" and method in ("pi-moesp", "po-moesp", "parallel-cascade"):
        return -5.01 if settings["closed_loop"] else 4.99
    return 1.99


class Studies(Mapping):
    """Results of all studies with chosen means, each made when it is read.

    `vaf` and `error` return None where the default is meant.
    """

    def __init__(self, vaf=None, error=None, trials=6, spread=0.0, points=POINTS):
        self.vaf, self.error = vaf or (lambda *_: None), error or (lambda *_: None)
        self.trials, self.spread, self.points = trials, spread, points
        self.results = {}

    def __iter__(self):
        return iter(self.points)

    def __len__(self):
        return len(self.points)

    def __getitem__(self, study):
        if study not in self.results:
            self.results[study] = self.make(study, self.points[study])
        return self.results[study]

    def make(self, study, varied):
        points = {
            ",".join(f"{name}={value}" for name, value in part.items()): {
                **SimulationSettings.defaults(),
                **part,
            }
            for part in varied
        }
        parts = []
        for (point, values), method in product(points.items(), METHODS[study]):
            error = self.error(study, values, method)
            error = default_error(study, values, method) if error is None else error
            columns = {
                "point": point,
                "method": method,
                "passes": 27.0,
                "K": 150.0 + 1.5 * error + self.noise(study, point, method),
                "trial": range(self.trials),
            }
            for torque in ("net", "intrinsic", "reflex", *UNSEEN):
                mean = self.vaf(study, values, method, torque)
                mean = default_vaf(study, values, method, torque) if mean is None else mean
                vaf = mean + self.noise(study, point, method, torque)
                names = [f"vaf_{torque}_{against}" for against in ("measured", "true")]
                columns |= dict.fromkeys([torque] if torque in UNSEEN else names, vaf)
            parts.append(
                {name: np.broadcast_to(values, self.trials) for name, values in columns.items()}
            )
        table = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        return StudyResults(study, points, pd.DataFrame(table), {})

    def noise(self, *key):
        """Deviations of zero mean."""
        if not self.spread:
            return np.zeros(self.trials)
        noise = self.spread * np.random.default_rng(zlib.crc32(repr(key).encode())).standard_normal(
            self.trials
        )
        return noise - noise.mean()


def build_ledger(
    studies=None, measurements=(), claims=CLAIMS, findings=FINDINGS, tables=TABLES, **results
):
    quantities = MEASUREMENTS | dict(measurements)
    table = pd.DataFrame(
        [(name, *values) for name, values in quantities.items() if values],
        columns=["quantity", "value", "low", "high"],
    )
    published = {**tables, "claims": claims, "findings": findings}
    return verify(published, Studies(**results) if studies is None else studies, table).set_index(
        "id"
    )
