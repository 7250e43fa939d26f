"""Coverage of the intervals of `ankleloop.compare`: the share of simulated studies whose interval holds the truth.

A study has eight subjects, whose K varies by 20 % (standard deviation), in three conditions, with two short trials each
that are merged. The truth is the difference of the conditions over all subjects that there could be.

    python benchmarks/comparisons.py 600
"""

import sys

import numpy as np
import pandas as pd
from tools import format_table

from ankleloop import compare, identify_each, simulate

SUBJECTS, VARIATION = 8, 0.2
CONDITIONS = {
    "rest": 110.0,
    "10MVC": 150.0,
    "20MVC": 190.0,
}  # stiffness of the mean subject [N·m/rad]
DURATION = 20.0  # s, of a trial


def simulate_study(seed):
    """Pairs of trials of a study, each with its labels."""
    random = np.random.default_rng(seed)
    pairs = []
    for subject, factor in enumerate(1.0 + VARIATION * random.standard_normal(SUBJECTS)):
        for condition, stiffness in CONDITIONS.items():
            labels = {"subject": subject, "condition": condition}
            settings = {"stiffness": factor * stiffness, "duration": DURATION}
            seeds = random.integers(2**31, size=2)
            trials = [simulate(seed=int(number), **settings) for number in seeds]
            pairs.append([trial.assign_attrs(labels) for trial in trials])
    return pairs


def compare_study(seed):
    """Differences of K in a study, with the truth, in units and in per cent."""
    table = compare(identify_each(simulate_study(seed), "riv"))
    rows = table[(table["kind"] == "difference") & (table["parameter"] == "K")]
    first = rows["reference"].map(CONDITIONS)
    truth = rows["condition"].map(CONDITIONS) - first
    return rows.assign(study=seed, truth=truth, true_percent=100.0 * truth / first)


def compute_coverage(differences):
    """Coverage of the intervals of each difference [%]."""
    rows = []
    for (reference, condition), part in differences.groupby(["reference", "condition"], sort=False):
        in_units = part["truth"].between(part["low"], part["high"])
        in_percent = part["true_percent"].between(part["percent_low"], part["percent_high"])
        rows.append(
            {
                "difference": f"{condition} from {reference}",
                "studies": len(part),
                "in N·m/rad [%]": f"{100 * in_units.mean():.1f}",
                "in % of the reference [%]": f"{100 * in_percent.mean():.1f}",
                "subjects": f"{part['subjects'].mean():.2f}",
            }
        )
    return rows


if __name__ == "__main__":
    print(format_table(compute_coverage(pd.concat(map(compare_study, range(int(sys.argv[1])))))))
