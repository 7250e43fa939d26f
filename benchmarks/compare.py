"""Results of two versions of the library: every number of their tables, and the estimates of all methods on recordings.

`python benchmarks/compare.py OTHER`, where OTHER is a work tree of another commit; both have run `make beyond`. Numbers
that differ by more than a millionth of them, and by more than a thousandth of their standard error, are counted. The
recordings are those of ANKLELOOP_RECORDINGS.
"""

import argparse
import io
import os
import re
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
    "ankle_df.csv.gz": {
        "position": "position_rad",
        "torque": "torque_nm",
        "torque_sign": -1,
        "sampling_rate": 1000.0,
    },
    "ankle_pf.mat": {"torque_sign": -1},
    "ankle_df3.h5": {"torque_sign": -1},
}
OPTIONS = {"pr-moesp": {"reference": "position"}}
OPTIONS["riv"] = OPTIONS["riv-tv"] = {"reference": "position", "weighting": "flat"}


def estimate_errors(table, column):
    """Standard error of each number of a column: of its interval, of its mean or deviation, or of all its trials."""
    errors = pd.Series(np.nan, table.index)
    if f"{column}_high" in table:
        errors = (table[f"{column}_high"] - table[f"{column}_low"]) / 3.92
    if "trial" in table and column not in KEYS:
        return errors.fillna(table.groupby(["point", "method"])[column].transform("std"))
    name = re.sub("_(mean|std|bias)$", "", column)
    if name != column and f"{name}_std" in table:
        deviation, count = table[f"{name}_std"], table[f"{name}_count"]
    elif column in ("mean", "bias", "rmse", "sd") and "sd" in table:
        deviation, count = table["sd"], table["n"]
    else:
        return errors
    return deviation / np.sqrt(2 * (count - 1) if column.endswith(("_std", "sd")) else count)


def compare_tables(name, before, after):
    """Print the columns that differ most, by their largest difference over its tolerance, and in how many rows."""
    if len(before) != len(after):
        print(f"{name}: {len(before)} rows -> {len(after)}")
        return
    # Columns with the values of a point had bare names; those of the interval of a renamed estimate another ending.
    names = {column: f"point.{column}" for column in before if f"point.{column}" in after}
    names |= {
        column: column.replace("_estimated", "") for column in before if "_estimated" in column
    }
    before = before.rename(columns=names)
    missing = before.columns.difference(after.columns)
    if len(missing):
        print(f"{name}: there is no column {', '.join(missing)} any more")
    worst = {}
    for column in before.columns.intersection(after.columns):
        old, new = before[column], after[column]
        if not pd.api.types.is_numeric_dtype(old) or old.dtype == bool or "time" in column:
            excess = pd.Series(
                np.where(
                    old.astype(object).fillna("") != new.astype(object).fillna(""), np.inf, 0.0
                )
            )
        else:
            error = estimate_errors(before, column).fillna(0.0)
            excess = (new - old).abs() / (
                np.maximum(RELATIVE * old.abs(), OF_ERROR * error) + 1e-12
            )
            excess[old.isna() != new.isna()] = np.inf
        if excess.max() > 1.0:
            worst[column] = excess.max(), (excess > 1.0).sum()
    columns = sorted(worst.items(), key=lambda item: -item[1][0])[:WORST]
    texts = [
        f"{column} ×{excess:.2g} in {count} of {len(before)}" for column, (excess, count) in columns
    ]
    print(f"{name}: {'; '.join(texts) or 'equal'}")


def tabulate_estimates():
    """Parameters of all methods on all recordings, with the intervals that are known, and what is said of them."""
    import ankleloop

    rows = []
    for name, reading in RECORDINGS.items():
        trial = ankleloop.read_trial(Path(os.environ["ANKLELOOP_RECORDINGS"]) / name, **reading)
        for method in ankleloop.METHODS:
            key = {"recording": name, "method": method}
            try:
                estimate = ankleloop.identify(trial, method, **OPTIONS.get(method, {}))
            except ankleloop.DataError as error:
                rows.append({**key, "text": str(error)})
                continue
            values = {**estimate.stiffness, **estimate.reflex}
            values["vaf"] = float(ankleloop.evaluate(trial, estimate).vaf.iloc[0])
            rows.append({**key, "text": "; ".join(estimate.diagnostics.get("warnings", []))})
            for parameter, value in values.items():
                low, high = estimate.intervals.get(parameter, (value, value))
                rows.append(
                    {
                        **key,
                        "parameter": parameter,
                        "value": value,
                        "value_low": low,
                        "value_high": high,
                    }
                )
    # The order of the methods is not a result.
    return pd.DataFrame(rows).sort_values(["recording", "method", "parameter"])


def read_estimates(tree):
    environment = {**os.environ, "PYTHONPATH": str(tree / "src"), "OMP_NUM_THREADS": "1"}
    command = [sys.executable, __file__, "--estimates", str(tree)]
    output = subprocess.run(
        command, env=environment, check=True, capture_output=True, text=True
    ).stdout
    return pd.read_csv(io.StringIO(output))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("other", type=Path)
    parser.add_argument("--estimates", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.estimates:
        tabulate_estimates().to_csv(sys.stdout, index=False)
        return
    for path in sorted((arguments.other / "results" / "tables").glob("*.csv")):
        present = ROOT / "results" / "tables" / path.name
        if present.exists():
            compare_tables(
                path.stem, *(pd.read_csv(file, low_memory=False) for file in (path, present))
            )
        else:
            print(f"{path.stem}: missing")
    ledgers = [
        pd.read_csv(tree / "results" / "verification.csv").set_index("id")
        for tree in (arguments.other, ROOT)
    ]
    verdicts = pd.concat(
        [ledger["verdict"] for ledger in ledgers], axis=1, keys=["before", "after"]
    )
    changed = verdicts[verdicts["before"] != verdicts["after"]]
    print("verdicts equal" if changed.empty else changed.to_string())
    if "ANKLELOOP_RECORDINGS" in os.environ:
        compare_tables("recordings", read_estimates(arguments.other), read_estimates(ROOT))


if __name__ == "__main__":
    main()
