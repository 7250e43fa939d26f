"""Numbers of docs/methods.md on riv: convergence on recordings, and coverage of its intervals."""

import os
import subprocess
import sys
from collections import Counter
from functools import cache
from itertools import product

import pandas as pd
from blocks import ROOT, block
from runs import EXAMPLE, RESULTS, markdown_table, read_recordings

from ankleloop import identify, segment
from ankleloop.joint.prepared import prepare
from ankleloop.quantities import QUANTITIES

SIMULATION, RIV = "ankleloop.simulation.simulate", "ankleloop.methods.riv"
BASES = ({"basis": "rectifier"}, *({"basis": "spline", "degree": degree} for degree in (6, 8, 12)))
PARTS = (60.0, 30.0, 10.0)  # s
TRIALS = 1000


@block("riv-convergence", (RIV, "ankleloop.records.readers", EXAMPLE))
def write_convergence():
    """Ends of the search over bases, orders, weightings and parts of the published recordings."""
    recordings, rows = read_recordings(), []
    for length in PARTS:
        parts = [
            prepare(segment(recording, start, start + length))
            for recording in recordings.values()
            for start in range(0, 60, round(length))
        ]
        for order in (2, 3):
            ends = Counter(
                _describe_end(identify(part, "riv", reference="position", order=order, weighting=weighting, **basis))
                for part, weighting, basis in product(parts, ("noise", "flat"), BASES)
            )
            rows.append([f"{length:g} s", order, *(ends[end] for end in ENDS)])
    note = "Ends of the search on the three published recordings and parts of them, over bases and weightings:"
    return f"{note}\n\n" + markdown_table(["length", "order", *ENDS], rows)


ENDS = ("converged", "converged, without the third pole", "too few poles shown", "other")


def _describe_end(estimate):
    text = " ".join(estimate.diagnostics["warnings"])
    if estimate.diagnostics["converged"]:
        return ENDS[1] if "left the band" in text else ENDS[0]
    return ENDS[2] if "left the band" in text else ENDS[3]


@cache
def _measure_coverage():
    """Write the tables of `make coverage` anew."""
    arguments = ["--trials", str(TRIALS), "--cores", str(os.cpu_count())]
    subprocess.run(
        [sys.executable, ROOT / "benchmarks" / "coverage.py", *arguments], check=True, stdout=subprocess.DEVNULL
    )


def _write_coverage(name):
    _measure_coverage()
    table = pd.read_csv(RESULTS / "tables" / f"{name}.csv")
    parameters = list(dict.fromkeys(table["parameter"]))
    rows = [
        [point, *(f"{value:.1f}" for value in part["covered"]), f"{part['robust'].iloc[0]:.0f}"]
        for point, part in table.groupby("point", sort=False)
    ]
    header = ["setting", *(QUANTITIES[parameter].symbol for parameter in parameters), "robust"]
    return f"{markdown_table(header, rows)}\n\nAll in %; {table['n'].max()} trials of 50 s in each setting."


@block("riv-coverage", (RIV, SIMULATION, "benchmarks/coverage.py"), studies=("efficiency",))
def write_coverage():
    return _write_coverage("coverage")


@block("riv-coverage-incomplete", (RIV, SIMULATION, "benchmarks/coverage.py"))
def write_coverage_incomplete():
    return _write_coverage("coverage-incomplete")
