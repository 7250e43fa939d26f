"""Errors, bias and coverage of `riv-tv` on simulated joints that change in time, beside least squares and the bound.

Light load 0.1/10/100 and moderate load 1.1/7.1/250, cycles of 1.4 s, 10 dB; K 80-220, B 0.55-1.05, G 4-20. Errors are
root mean squares over the trajectory, over the mean of the truth. A record of n cycles has n cycles in all. Efficiency
is the Cramér-Rao bound of splines without penalties over the mean square error; penalties may beat it, but not that of
the means over the trajectory. No trial is written to disk. Writes results/benchmarks/time-varying.csv with a row for
each trial and method, and prints the means.
"""

import argparse
import os
import time
import tracemalloc
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pandas as pd
from tools import ROOT, format_table

from ankleloop.assessment.cramer_rao import trajectory_bound
from ankleloop.assessment.scores import TRAJECTORY_TRUTHS, score_rows, score_trajectories
from ankleloop.errors import DataError
from ankleloop.joint.prepared import prepare
from ankleloop.methods.registry import identify
from ankleloop.simulation.simulate import simulate

CYCLE = 1.4  # s
BOUNDS = 5  # trials of a case whose bound is computed; it hardly depends on the perturbation
CYCLES = (20, 40, 100, 200, 400)  # of records whose memory is measured
LIGHT, MODERATE = (0.1, 10.0, 100.0), (1.1, 7.1, 250.0)
JOINT = {
    "stiffness": 150.0,
    "stiffness_variation": 70.0 / 150.0,
    "stiffness_peak": 0.5,
    "viscosity": 0.8,
    "viscosity_variation": 0.25 / 0.8,
    "viscosity_peak": 0.4,
    "reflex_gain": 12.0,
    "gain_variation": 8.0 / 12.0,
    "gain_peak": 0.7,
}
CONSTANT = {f"{name}_variation": 0.0 for name in ("stiffness", "viscosity", "gain")}
SQUARE = {**CONSTANT, "stiffness_variation": 1.0 / 3.0, "variation_shape": "square"}


def case(load, voluntary, cycles=40, variation="cycle", **settings):
    """Settings of the simulation, and what the parameters are functions of."""
    return {
        **JOINT,
        "load": load,
        "voluntary": voluntary,
        "variation": variation,
        "duration": round(cycles * CYCLE, 6) if variation == "cycle" else 120.0,
        **settings,
    }


CASES = {
    "light, 5 %, 40 cycles": case(LIGHT, 0.05),
    "light, 30 %, 20 cycles": case(LIGHT, 0.3, 20),
    "light, 30 %, 40 cycles": case(LIGHT, 0.3),
    "light, 30 %, 100 cycles": case(LIGHT, 0.3, 100),
    "light, 100 %, 100 cycles": case(LIGHT, 1.0, 100),
    "moderate, 5 %, 40 cycles": case(MODERATE, 0.05),
    "moderate, 30 %, 40 cycles": case(MODERATE, 0.3),
    "moderate, 30 %, 100 cycles": case(MODERATE, 0.3, 100),
    "light, 30 %, slow change over 120 s": case(LIGHT, 0.3, variation="time"),
    "light, 30 %, scheduling variable, 120 s": case(LIGHT, 0.3, variation="schedule"),
    "light, 30 %, 40 cycles, durations ± 6 %": case(LIGHT, 0.3, cycle_jitter=0.06),
    "light, 30 %, 40 cycles, locked torque": case(LIGHT, 0.3, locked_torque=1.0),
    "light, 30 %, 40 cycles, movement of 0.2 rad": case(LIGHT, 0.3, movement=0.2),
    "square wave, moderate, 5 %, 40 cycles": case(MODERATE, 0.05, **SQUARE),
    "constant, light, 30 %, 40 cycles": case(LIGHT, 0.3, **CONSTANT),
    "open loop, 15 dB, 10 + 4 cycles": case(LIGHT, 0.0, 14, closed_loop=False, snr_db=15.0),
}
METHODS = {
    "riv-tv": {},
    "least squares": {"reference": "position", "weighting": "flat"},  # ensemble methods for open loop
    "weighted least squares": {"reference": "position"},
    "short segments": {"interpolation": "constant"},
}


def course_options(settings):
    """Options of the method that say what the parameters are functions of."""
    variation = settings["variation"]
    return {"cycle": {"cycle_onsets": "phase"}, "schedule": {"schedule": "schedule"}, "time": {}}[variation]


def agreement(trial, trajectories):
    """Share of the bands that hold the constant parameters of `riv` [%]."""
    estimate = identify(trial, "riv")
    values = estimate.stiffness | estimate.reflex
    inside = [
        (trajectories[f"{name}_low"].values <= values[name]) & (values[name] <= trajectories[f"{name}_high"].values)
        for name in TRAJECTORY_TRUTHS
    ]
    return 100.0 * float(np.mean(inside))


def run_trial(settings, seed, methods):
    """Rows of all methods on one trial."""
    trial, rows = simulate(seed=seed, **settings), []
    for method in methods:
        options = {**course_options(settings), "rest_position": 0.0, **METHODS[method]}
        if not settings.get("closed_loop", True):
            options["reference"] = "position"
        prepared = prepare(trial)
        start = time.process_time()
        try:
            estimate = identify(prepared, "riv-tv", **options)
        except DataError as error:
            rows.append({"method": method, "seed": seed, "failure": str(error)})
            continue
        seconds = time.process_time() - start
        constant = all(settings[name] == 0.0 for name in CONSTANT)
        scores = {f"{torque} vaf": value for torque, kind, value in score_rows(prepared, estimate) if kind == "true"}
        rows.append(
            {
                "method": method,
                "seed": seed,
                **score_trajectories(prepared, estimate),
                **scores,
                "omega_n": estimate.reflex["omega_n"],
                "zeta": estimate.reflex["zeta"],
                "p": estimate.diagnostics["variation_p"]["all"],
                "rounds": estimate.diagnostics["rounds"],
                "converged": estimate.diagnostics["converged"],
                "strength": estimate.diagnostics["instrument_strength"],
                "seconds": seconds,
                "agrees with riv": agreement(prepared, estimate.trajectories) if constant else np.nan,
            }
        )
    return rows


def measure_memory(cycles, seed=0):
    """Largest memory that an identification allocates beside its trial [MB]."""
    prepared = prepare(simulate(seed=seed, **case(LIGHT, 0.3, cycles)))
    identify(prepared, "riv-tv", cycle_onsets="phase")  # caches of the trial and compiled kernels
    tracemalloc.start()
    identify(prepared, "riv-tv", cycle_onsets="phase")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 1e6


def bound_errors(settings, seeds):
    """Mean squares of the Cramér-Rao bound, over phase and of the means, in the unit of errors squared [%²]."""
    bounds = [trajectory_bound(seed=seed, **settings) for seed in seeds]
    values = {}
    for name in TRAJECTORY_TRUTHS:
        unit = 100.0 / settings[{"K": "stiffness", "B": "viscosity", "G": "reflex_gain"}[name]]
        values[name] = np.mean([unit**2 * float((bound[name] ** 2).mean()) for bound in bounds])
        values[f"{name}_mean"] = np.mean([unit**2 * float(bound[f"{name}_mean"] ** 2) for bound in bounds])
    return values


def summarise(table, bound):
    """Rows with the means of a case by each method, and half of the 95 % intervals of the errors.

    `over least squares` is the ratio of mean errors on the same trials; efficiencies are bounds of variances over mean
    squares of the errors, of the trajectories and of their means.
    """
    means, rows = table.groupby("method", sort=False).mean(numeric_only=True), []
    for method, part in table.groupby("method", sort=False):
        row = {"case": part["case"].iloc[0], "method": method, "trials": len(part)}
        for name in TRAJECTORY_TRUTHS:
            error, mean = part[f"{name}_nrmse"], means.loc[method]
            row[f"error of {name} [%]"] = f"{error.mean():.2f} ± {1.96 * error.std() / np.sqrt(len(part)):.2f}"
            row[f"bias of {name} [%]"] = f"{mean[f'{name}_bias']:.2f}"
            row[f"{name} held by bands [%]"] = f"{mean[f'{name}_covered']:.0f}"
            if "least squares" in means.index:
                row[f"{name} over least squares"] = f"{error.mean() / means.loc['least squares', f'{name}_nrmse']:.2f}"
            whole, average = np.mean(error**2), np.mean(part[f"{name}_bias"] ** 2)
            efficiencies = f"{100 * bound[name] / whole:.0f}, {100 * bound[f'{name}_mean'] / average:.0f}"
            row[f"efficiency of {name} [%]"] = efficiencies
        shown = ("intrinsic vaf", "reflex vaf", "rounds", "converged", "seconds", "agrees with riv")
        row |= {name: f"{means.loc[method, name]:.3g}" for name in shown}
        rows.append(row | {"p < 0.05 [%]": f"{100 * (part['p'] < 0.05).mean():.1f}"})
    return rows


def main():
    """Simulate and identify all trials, and print the means."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--first-seed", type=int, default=100_000)
    parser.add_argument("--cases", nargs="*", default=list(CASES), help="parts of the names of the cases")
    parser.add_argument("--methods", nargs="*", default=list(METHODS), choices=list(METHODS))
    parser.add_argument("--output", type=Path, default=ROOT / "results" / "benchmarks" / "time-varying.csv")
    parser.add_argument("--memory", action="store_true", help="memory of an identification over cycles, alone")
    arguments = parser.parse_args()
    if arguments.memory:
        for cycles in CYCLES:
            memory = measure_memory(cycles)
            print(f"{cycles:4d} cycles: {memory:6.1f} MB, {memory / cycles:.3f} MB for each cycle", flush=True)
        return
    tables, summary = [], []
    for name, settings in CASES.items():
        if not any(part in name for part in arguments.cases):
            continue
        rows = []
        for seed in range(arguments.first_seed, arguments.first_seed + arguments.trials):
            rows += run_trial(settings, seed, arguments.methods)
        tables.append(pd.DataFrame(rows).assign(case=name))
        seeds = range(arguments.first_seed, arguments.first_seed + min(arguments.trials, BOUNDS))
        summary += summarise(tables[-1], bound_errors(settings, seeds))
        print(f"{name} …", flush=True)
    print(format_table(summary))
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    pd.concat(tables).to_csv(arguments.output, index=False)


if __name__ == "__main__":
    main()
