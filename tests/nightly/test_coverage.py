"""The 95 % intervals of `riv` hold the truth in 95 % of the trials, as far as their number can tell."""

import sys
from pathlib import Path

import pytest
from scipy import stats

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
from interval_coverage import compute_coverage, estimate_points, read_points, read_truths

TRIALS = 200
POINTS = read_points()


@pytest.mark.parametrize("name", POINTS)
def test_intervals_hold_the_truth(name):
    points = {name: POINTS[name]}
    estimates = estimate_points(points, TRIALS)
    table = compute_coverage(estimates, read_truths(points))
    low, high = stats.binom.interval(0.999, TRIALS, 0.95)
    held = table.loc[name].drop("robust") * TRIALS / 100
    assert held[(held < low) | (held > high)].empty, held.to_dict()
