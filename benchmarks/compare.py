"""Results of two versions of the library: every number of their tables, and the estimates of all methods on recordings.

`python benchmarks/compare.py OTHER`, where OTHER is a work tree of another commit; both have run `make beyond`. Numbers
that differ by more than a millionth of them, and by more than a thousandth of their standard error, are listed. The
recordings are those of ANKLELOOP_RECORDINGS.
"""

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
from tools import ROOT

RELATIVE, OF_ERROR = 1e-6, 1e-3
KEYS = ["study", "point", "method", "trial"]
WORST = 8  # columns that are listed of a table
RECORDINGS = {
    "ankle_df.csv.gz": {"position": "position_rad", "torque": "torque_nm", "torque_sign": -1, "sampling_rate": 1000.0},
    "ankle_pf.mat": {"torque_sign": -1},
    "ankle_df3.h5": {"torque_sign": -1},
}
OPTIONS = {
    "pr-moesp": {"reference": "position"},
    "riv": {"reference": "position", "weighting": "flat"},
    "riv-tv": {"reference": "position", "weighting": "flat"},
}


def estimate_errors(table, column):
    """Standard error of each number of a column: of its interval, of its mean, or of all trials of its point."""
    if f"{column}_high" in table:
        return (table[f"{column}_high"] - table[f"{column}_low"]) / 3.92
    if "trial" in table and column not in KEYS:
        return table.groupby(["point", "method"])[column].transform("std")
    name = column.removesuffix("_mean")
    if f"{name}_std" in table and column != name:
        return table[f"{name}_std"] / np.sqrt(table[f"{name}_count"])
    if column in ("mean", "bias", "rmse", "sd") and "sd" in table:
        return table["sd"] / np.sqrt(table["n"])
    return pd.Series(0.0, table.index)


def compare_tables(before, after):
    """Largest difference of each column over its tolerance, and the rows that are beyond it."""
    worst = {}
    for column in before.columns.intersection(after.columns):
        old, new = before[column], after[column]
        if not pd.api.types.is_numeric_dtype(old) or old.dtype == bool or "time" in column:
            different = old.astype(object).fillna("") != new.astype(object).fillna("")
            if different.any():
                worst[column] = np.inf, int(different.sum())
            continue
        tolerance = np.maximum(RELATIVE * old.abs(), OF_ERROR * estimate_errors(before, column).fillna(0.0)) + 1e-12
        excess = (new - old).abs() / tolerance
        excess[old.isna() != new.isna()] = np.inf
        if excess.max() > 1.0:
            worst[column] = float(excess.max()), int((excess > 1.0).sum())
    return worst


def print_estimates():
    """Print the parameters of all methods on all recordings, with the standard errors that are known."""
    import ankleloop

    rows = {}
    for name, reading in RECORDINGS.items():
        trial = ankleloop.read_trial(Path(os.environ["ANKLELOOP_RECORDINGS"]) / name, **reading)
        for method in ankleloop.METHODS:
            try:
                estimate = ankleloop.identify(trial, method, **OPTIONS.get(method, {}))
            except ankleloop.DataError as error:
                rows[f"{name} {method}"] = {"refused": str(error)}
                continue
            values = {**estimate.stiffness, **estimate.reflex}
            values["vaf"] = float(ankleloop.evaluate(trial, estimate).vaf.iloc[0])
            errors = {key: (high - low) / 3.92 for key, (low, high) in estimate.intervals.items()}
            warnings = list(estimate.diagnostics.get("warnings", []))
            rows[f"{name} {method}"] = {"values": values, "errors": errors, "warnings": warnings}
    print(json.dumps(rows))


def read_estimates(tree):
    environment = {**os.environ, "PYTHONPATH": str(tree / "src"), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, __file__, "--estimates", str(tree)]
    return json.loads(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)


def compare_estimates(before, after):
    """List the parameters of recordings that differ by more than the tolerance."""
    for key, old in before.items():
        new = after[key]
        if "refused" in old or "refused" in new:
            print(f"{key}: {'the same refusal' if old == new else f'{old} -> {new}'}")
            continue
        lines = [] if old["warnings"] == new["warnings"] else [f"warnings {old['warnings']} -> {new['warnings']}"]
        for name, value in old["values"].items():
            tolerance = max(RELATIVE * abs(value), OF_ERROR * old["errors"].get(name, 0.0))
            excess = abs(new["values"].get(name, np.inf) - value) / tolerance if value else 0.0
            lines += [f"{name} {value:.8g} -> {new['values'].get(name)} ({excess:.2g} tolerances)"] * (excess > 1.0)
        print(f"{key}: {'; '.join(lines) or 'equal'}")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("other", type=Path)
    parser.add_argument("--estimates", action="store_true")
    arguments = parser.parse_args()
    if arguments.estimates:
        print_estimates()
        return
    for path in sorted((arguments.other / "results" / "tables").glob("*.csv")):
        present = ROOT / "results" / "tables" / path.name
        if not present.exists():
            print(f"{path.stem}: missing")
            continue
        old, new = pd.read_csv(path, low_memory=False), pd.read_csv(present, low_memory=False)
        if len(old) != len(new):
            print(f"{path.stem}: {len(old)} rows -> {len(new)}")
            continue
        worst = sorted(compare_tables(old, new).items(), key=lambda item: -item[1][0])
        texts = [f"{column} ×{excess:.2g} in {count} of {len(old)}" for column, (excess, count) in worst[:WORST]]
        print(f"{path.stem}: {'; '.join(texts) or 'equal'}")
    ledgers = [pd.read_csv(tree / "results" / "verification.csv").set_index("id") for tree in (arguments.other, ROOT)]
    verdicts = pd.concat([ledger["verdict"] for ledger in ledgers], axis=1, keys=["before", "after"])
    changed = verdicts[verdicts["before"] != verdicts["after"]]
    print("verdicts equal" if changed.empty else changed.to_string())
    if "ANKLELOOP_RECORDINGS" in os.environ:
        compare_estimates(read_estimates(arguments.other), read_estimates(ROOT))


if __name__ == "__main__":
    main()
