"""How right `ensemble` is, and how often its intervals hold, beside least squares of the means and `riv`.

`make benchmark ARGS=ensembles` writes the tables; `python benchmarks/ensembles.py --count 40` shows some rows.
"""

import argparse
import time
from dataclasses import replace

import numpy as np
import pandas as pd
from scipy import special
from tools import format_table
from windows import BEFORE, LIGHT, STIFF, TRUTH, Ensemble, simulate_ensemble, simulate_record

from ankleloop import DataError, identify

FEW = {"nominal": 30, "up": 15}
ROWS = {
    "light, 0.5": Ensemble(),
    "light, 3": Ensemble(voluntary=3.0),
    "stiff, 0.5": Ensemble(load=STIFF),
    "stiff, 3": Ensemble(load=STIFF, voluntary=3.0),
    "light, 3, 15/30": Ensemble(voluntary=3.0, trials=FEW),
    "light, 1.5, moving": Ensemble(voluntary=1.5, moving=True),
    "light, 1.5, K ± 10 % between trials": Ensemble(voluntary=1.5, stiffness_scatter=0.1),
    "light, 3, pulse of 150 ms": Ensemble(voluntary=3.0, command="pulse"),
}
SEQUENCES = {str(number): 10 for number in range(4)}
# What the model lacks, or what an experiment does wrong.
FAULTS = {
    "threshold of the reflex, 0.1 rad/s": Ensemble(voluntary=1.5, threshold=0.1),
    "reaction of 2 N·m from 130 ms on": Ensemble(voluntary=1.5, reaction=2.0),
    "short-range stiffness, 150 N·m/rad in 5 mrad": Ensemble(voluntary=1.5, short_range=150.0),
    "perturbed trials differ by 1 N·m before": Ensemble(voluntary=1.5, difference=1.0),
    "onsets wrong by 10 ms": Ensemble(voluntary=1.5, jitter=0.01),
    "no reflex": Ensemble(voluntary=1.5, gain=0.0),
    "K rises by 40 % in 0.25 s": Ensemble(stiffness_slope=1.6),
    "K ± 30 % between trials": Ensemble(voluntary=1.5, stiffness_scatter=0.3),
    "sequences of each trial's own": Ensemble(
        voluntary=1.5, command="own sequences", trials={"nominal": 40, "own": 40}, after=0.65
    ),
}
SIZES = {
    "10/20": {"nominal": 20, "up": 10},
    "20/50": {"nominal": 50, "up": 20},
    "40/100": {"nominal": 100, "up": 40},
    "80/100": {"nominal": 100, "up": 80},
    "160/200": {"nominal": 200, "up": 160},
    "4 sequences × 10, no nominal": SEQUENCES,
    "2 sequences × 10, no nominal": {"0": 10, "1": 10},
}
NAMES = ("K", "B", "I", "G")
MOMENT = 0.1  # s from the onset, at which K is given
MEASURED = (*NAMES, "omega_n", "zeta", "delay")


def fit_least_squares(windows, duration):
    """K, B and I of perturbed less nominal means over a time from the onset, and whether the usual interval has K."""
    perturbed, nominal = (
        [part for part in windows if (part.attrs["condition"] == "nominal") is is_nominal]
        for is_nominal in (False, True)
    )
    if not nominal:
        return {}
    first = round(BEFORE * 1000)
    means = []
    for name in ("position", "torque"):
        mean, other = (
            np.mean([part[name].values for part in parts], axis=0) for parts in (perturbed, nominal)
        )
        means.append(mean - other - np.mean((mean - other)[first - 50 : first]))
    smooth = np.exp(-0.5 * (np.arange(-9, 10) / 3.0) ** 2)  # 50 Hz
    position, torque = (np.convolve(mean, smooth / smooth.sum(), "same") for mean in means)
    columns = [position, np.gradient(position, 1e-3)]
    columns.append(np.gradient(columns[1], 1e-3))
    rows = slice(first, first + round(duration * 1000))
    matrix = np.array(columns).T[rows]
    target = torque[rows]
    values, square, *_ = np.linalg.lstsq(matrix, target, rcond=None)
    freedom = target.size - 3
    variance = square.item() / freedom * np.linalg.inv(matrix.T @ matrix)[0, 0]
    margin = special.stdtrit(freedom, 0.975) * np.sqrt(variance)
    return {
        f"K {duration}": values[0],
        f"B {duration}": values[1],
        f"covered {duration}": abs(values[0] - TRUTH["K"]) <= margin,
    }


def find_truth(settings):
    """True parameters of an ensemble, K at the usual moment."""
    stiffness = TRUTH["K"] * (1.0 + MOMENT * settings.stiffness_slope)
    return {**TRUTH, "K": stiffness, "G": settings.gain}


def measure_one(settings, seed, **options):
    """Estimates, coverage and warnings of an ensemble, as a row."""
    windows = simulate_ensemble(settings, seed)
    truth = find_truth(settings)
    row = {"refused": False, "converged": False}
    row |= {f"true {name}": truth[name] for name in MEASURED}
    row |= fit_least_squares(windows, 0.1) | fit_least_squares(windows, 0.06)
    start = time.process_time()
    try:
        estimate = identify(windows, "ensemble", **options)
    except DataError:
        return row | {"refused": True}
    row["seconds"] = time.process_time() - start
    diagnostics = estimate.diagnostics
    row |= {
        name: diagnostics[name] for name in ("converged", "strength", "movement_p", "balance_p")
    }
    row |= {
        "score": diagnostics["reflex_score"],
        "warned": bool(estimate.warnings),
        "passive": "omega_n" not in estimate.values,
    }
    for name, value in estimate.values.items():
        row[name] = value
        if name in estimate.intervals:
            low, high = estimate.intervals[name]
            row[f"{name} width"] = 0.5 * (high - low)
            row[f"{name} covered"] = bool(low <= truth.get(name, np.nan) <= high)
    return row


def measure_rows(rows, count, seed=1000, **options):
    """A row for each ensemble of each kind."""
    parts = []
    for kind, settings in rows.items():
        window = window_of(settings)
        ensembles = [
            measure_one(settings, seed + number, window=window, **options)
            for number in range(count)
        ]
        parts.append(pd.DataFrame(ensembles).assign(kind=kind))
        print(kind, summarise(parts[-1]), flush=True)
    return pd.concat(parts, ignore_index=True)


def summarise(table):
    """Bias, spread and coverage of the converged estimates of a kind [%]."""
    good = table[table["converged"].astype(bool)]
    cells = {"converged": f"{len(good)} of {len(table)}", "refused": int(table["refused"].sum())}
    if "warned" in table and not table["refused"].all():
        cells["warned"] = f"{table['warned'].dropna().astype(bool).mean():.2f}"
    for name in MEASURED if len(good) else ():
        if name not in good:
            continue
        errors = 100.0 * (good[name] - good[f"true {name}"]) / TRUTH[name]
        text = f"{errors.mean():+.1f} ± {errors.std():.1f}"
        if f"{name} covered" in good:
            text += f" {good[f'{name} covered'].dropna().mean():.2f}"
        cells[name] = text
    if len(good):
        error = 100.0 * (good["G"] - good["true G"]).median() / TRUTH["G"]
        cells["median of G"] = f"{error:+.1f}"
        cells["score"] = f"{good['score'].median():.1f}"
        low = good["score"] < 4.0
        cells["low scores warned"] = f"{good['warned'][low].sum()} of {low.sum()}"
        cells["incomplete"] = f"{(good['movement_p'] <= 0.01).mean():.2f}"
        cells["seconds"] = f"{good['seconds'].median():.2f}"
        cells["passive"] = int(good["passive"].sum())
        cells["strength"] = f"{good['strength'].min():.1f} … {good['strength'].max():.0f}"
    for duration in (0.1, 0.06):
        if f"K {duration}" not in table:
            continue
        k = 100.0 * (table[f"K {duration}"] / TRUTH["K"] - 1.0)
        b = 100.0 * (table[f"B {duration}"] / TRUTH["B"] - 1.0)
        covered = table[f"covered {duration}"].mean()
        cells[f"LS {duration}"] = (
            f"{k.mean():+.0f} ± {k.std():.0f} ({covered:.2f}) / {b.mean():+.0f}"
        )
    return cells


def format_summaries(table, columns):
    """Summaries of each kind as Markdown."""
    rows = []
    for kind, part in table.groupby("kind", sort=False):
        cells = summarise(part)
        rows.append({"ensemble": kind, **{name: cells.get(key, "–") for name, key in columns}})
    return format_table(rows)


def measure_widths(count, seed=3000):
    """Median half widths of the intervals of K and G [%] by the number of trials."""
    rows = []
    for name, trials in SIZES.items():
        row = {"perturbed/nominal": name}
        for load, values in (("light", LIGHT), ("stiff", STIFF)):
            settings = Ensemble(load=values, voluntary=1.5, trials=trials)
            if "0" in trials:
                settings = replace(settings, command="sequences", after=0.65)
            ensembles = [
                measure_one(settings, seed + number, window=window_of(settings))
                for number in range(count)
            ]
            table = pd.DataFrame(ensembles).reindex(columns=["K width", "G width", "converged"])
            widths = [100.0 * table[f"{key} width"].median() / TRUTH[key] for key in ("K", "G")]
            row[f"{load}: K / G [%]"] = " / ".join(f"{width:.1f}" for width in widths)
            row[f"{load}: converged"] = f"{int(table['converged'].sum())} of {count}"
        rows.append(row)
        print(row, flush=True)
    return rows


def window_of(settings):
    """Window of an ensemble: sequences are used until 0.43 s."""
    return (-0.1, 0.43) if settings.command.endswith("sequences") else None


def measure_records(count, seed=5000):
    """Errors and coverage of `riv` on whole records of 300 s, and of `ensemble` on their windows [%]."""
    rows = []
    for name in ("light, 0.5", "light, 3", "stiff, 3"):
        parts = {"riv": [], "ensemble": []}
        for number in range(count):
            trial, onsets, conditions = simulate_record(ROWS[name], seed + number)
            marks = {"onsets": onsets, "condition": conditions}
            for method, options in (("riv", {}), ("ensemble", marks)):
                estimate = identify(trial, method, **options)
                low, high = estimate.intervals.get("K", (np.nan, np.nan))
                values = {key: 100.0 * (estimate[key] / TRUTH[key] - 1.0) for key in NAMES}
                parts[method].append({**values, "covered": low <= TRUTH["K"] <= high})
        for method, estimates in parts.items():
            table = pd.DataFrame(estimates)
            row = {"record": name, "method": f"`{method}`"}
            for key in NAMES:
                row[key] = f"{table[key].mean():+.1f} ± {table[key].std():.1f}"
            rows.append({**row, "K held": f"{int(table['covered'].sum())} of {count}"})
            print(rows[-1], flush=True)
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--rows", nargs="*")
    parser.add_argument("--save")
    arguments = parser.parse_args()
    kinds = {**ROWS, **FAULTS}
    chosen = {name: kinds[name] for name in arguments.rows or ROWS}
    table = measure_rows(chosen, arguments.count, arguments.seed)
    if arguments.save:
        table.to_csv(arguments.save, index=False)


if __name__ == "__main__":
    main()
