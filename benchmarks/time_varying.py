"""Errors and coverage of `riv-tv` on simulated joints that change in time, beside least squares.

Light load 0.1/10/100 and moderate load 1.1/7.1/250, cycles of 1.4 s, 10 dB; K 80-220, B 0.55-1.05, G 4-20. Errors are
root mean squares over the trajectory, over the mean of the truth.
"""

import pandas as pd

from ankleloop import identify, simulate
from ankleloop.assessment.scores import score_trajectories
from ankleloop.joint.prepared import prepare

CYCLE, FIRST_SEED = 1.4, 100_000
JOINT = {
    "variation": "cycle",
    "stiffness": 150.0,
    "stiffness_variation": 70.0 / 150.0,
    "stiffness_peak": 0.5,
}
JOINT |= {"viscosity": 0.8, "viscosity_variation": 0.25 / 0.8, "viscosity_peak": 0.4}
JOINT |= {"reflex_gain": 12.0, "gain_variation": 8.0 / 12.0, "gain_peak": 0.7}
LIGHT, MODERATE = (0.1, 10.0, 100.0), (1.1, 7.1, 250.0)
CASES = {
    "light, 30 %, 40 cycles": {"load": LIGHT, "voluntary": 0.3, "duration": 40 * CYCLE},
    "light, 100 %, 100 cycles": {"load": LIGHT, "voluntary": 1.0, "duration": 100 * CYCLE},
    "moderate, 30 %, 40 cycles": {"load": MODERATE, "voluntary": 0.3, "duration": 40 * CYCLE},
}
METHODS = {
    "riv-tv": {},
    "least squares": {
        "reference": "position",
        "weighting": "flat",
    },  # ensemble methods for open loop
    "short segments": {"interpolation": "constant"},
}


def measure_errors(trials):
    """Mean errors and coverage of each method in each case [%], as rows of a table."""
    rows = []
    for case, settings in CASES.items():
        scores = {method: [] for method in METHODS}
        for seed in range(FIRST_SEED, FIRST_SEED + trials):
            trial = prepare(simulate(seed=seed, **JOINT, **settings))
            for method, options in METHODS.items():
                estimate = identify(
                    trial, "riv-tv", cycle_onsets="phase", rest_position=0.0, **options
                )
                scores[method].append(score_trajectories(trial, estimate))
        for method, part in scores.items():
            mean = pd.DataFrame(part).mean()
            errors = " / ".join(f"{mean[f'{key}_nrmse']:.1f}" for key in "KBG")
            covered = " / ".join(f"{mean[f'{key}_covered']:.0f}" for key in "KBG")
            rows.append(
                {
                    "case": case,
                    "method": method,
                    "error K/B/G [%]": errors,
                    "held by bands [%]": covered,
                }
            )
    return rows
