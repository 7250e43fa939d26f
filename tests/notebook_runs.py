"""Small studies that every notebook of simulated trials either shows right, or refuses before the first job."""

import numpy as np
import pandas as pd
from study_jobs import NOTEBOOKS, run_jobs, run_notebook

from ankleloop_lab.checking import ConfigError
from ankleloop_workflow.config.notebooks import list_figures
from ankleloop_workflow.config.run import read_run

CASCADE = {"method": "parallel-cascade", "label": "Kaskade – by $m$ & by $n$ | ζ ≤ 1"}
RIV = {"method": "riv", "options": {"delay": None}, "label": "größe by {x}"}
REAL_TIME = {"method": "real-time", "options": {"settling": 8.0}}
SELECTED = {"order": [2]}
METHODS = {
    "one": {"riv": RIV},
    "paper": {
        "pr-moesp": {"method": "pr-moesp", "label": "<b>PR-MOESP</b>"},
        "eiv-moesp": {"method": "eiv-moesp"},
        "parallel-cascade-one-pass": {"method": "parallel-cascade", "options": {"max_passes": 1}},
        "parallel-cascade": CASCADE,
    },
    "table 1": {name: {"method": name} for name in ("pr-moesp", "eiv-moesp", "parallel-cascade")},
    "one pass": {"c": CASCADE | {"options": {"max_passes": 1}}},
    "passes": {"c": CASCADE, "d": {"method": "parallel-cascade", "options": {"max_passes": 2}}},
    "real-time": {"r": REAL_TIME},
    "moesp": {"m": {"method": "moesp", "label": "by hand"}},
    "several": {"riv": RIV, "r": REAL_TIME},
    "selected": {
        "riv": {"method": "riv", "select": SELECTED},
        "m": {"method": "pr-moesp", "select": SELECTED},
    },
    "varying": {"v": {"method": "riv-tv", "label": "by time"}, "riv": {"method": "riv"}},
}
POINTS = {
    "none": {},
    "a number": {"voluntary": [0.1, 0.5]},
    "a truth": {"stiffness": [100.0, 150.0]},
    "words": {"perturbation": ["prbs", "pulses"]},
    "a flag": {"perturbation_locked": [False, True]},
    "the loop": {"closed_loop": [True, False]},
    "null": {"snr_db": [10.0, None]},
    "lengths": {"duration": [8.0, 12.0]},  # the first is too short for the real-time algorithm
    "an option": {"basis": ["rectifier", "chebyshev"]},
    "two numbers": {"reflex_gain": [5.0, 13.0], "voluntary": [0.1, 0.5]},
    "number and loop": {"voluntary": [0.1, 0.5], "closed_loop": [True, False]},
    "number and word": {"voluntary": [0.1, 0.5], "perturbation": ["prbs", "pulses"]},
    "setting and option": {"voluntary": [0.1, 0.5], "basis": ["rectifier", "chebyshev"]},
    "together": [{"load": [1.1, 7.1, 250.0]}, {"load": [0.22, 1.42, 50.0]}],
}
VARYING = {"variation": "time", "stiffness_variation": 0.3}
# Columns that tell the rows of a table apart, beside those of the points.
KEYS = ["point", "recording", "condition", "gain", "load", "voluntary", "perturbation", "method"]
KEYS += ["omitted_step", "torque", "against", "quantity", "parameter"]
# Likewise for what figures draw.
PLACES = ["quantity", "panel", "row", "series", "method", "condition", "parameter", "place"]
PLACES += ["x", "y"]


NAMES = [name for name, notebook in NOTEBOOKS.items() if notebook.kind == "simulation"]


def read_accepted(points, methods, **settings):
    """The study under each notebook that accepts it; the others refuse it by its name and theirs."""
    simulation = {"duration": 12.0, **(VARYING if methods == "varying" else {})}
    settings |= {"points": POINTS[points], "methods": METHODS[methods], "simulation": simulation}
    settings |= {"kind": "simulation", "seed": 1, "trials": 2}
    accepted = {}
    for name in NAMES:
        config = {"studies": {"s": settings | {"notebook": name}}}
        try:
            accepted[name] = read_run(config, [])[1]["s"]
        except ConfigError as error:
            reasons = [
                "s → points → basis=chebyshev",  # which some methods do not have
                f"s → notebook: {name} needs ",
                "s → sweep: no setting and no option differs",
            ]
            if not any(reason in str(error) for reason in reasons):
                raise
    return accepted


def check_notebooks(folder, points, methods, names=(), **settings):
    """Simulate and identify a study, and check what notebooks show and write: by default all that accept it."""
    accepted = read_accepted(points, methods, **settings)
    results = run_jobs(next(iter(accepted.values())), folder / "results")
    trials = pd.read_parquet(results.table)
    for name in names or accepted:
        study = accepted[name]
        place = folder / name
        place.mkdir()
        assert run_notebook(study, results, place)
        check_figures(study, place)
        check_table(study, trials, pd.read_csv(place / "s.csv"))


def check_figures(study, folder):
    """Those that the list names, in which nothing is drawn twice at one place."""
    figures = {path.stem.removeprefix("s-") for path in folder.glob("s-*.png")}
    assert figures == set(list_figures(study, NOTEBOOKS[study.settings.notebook]))
    for figure in figures:
        drawn = pd.read_csv(folder / f"s-{figure}.csv")
        assert drawn["value"].notna().any()
        assert not drawn.duplicated(drawn.columns.intersection(PLACES)).any()


def check_table(study, trials, table):
    """A row for each point and method, none twice, with the means of the trials; nan where no trial has a value."""
    table = table.rename(columns={"gain": "point.reflex_gain"})
    table = table.replace({"method": {label: name for name, label in study.labels.items()}})
    columns = table.columns.intersection([*trials.filter(like="point"), *KEYS])
    assert not table.duplicated(columns).any()
    keys = [name for name in columns if name in trials]
    if not keys:  # pairs of points
        return
    trials = trials.astype({"point": str, "method": str})
    places = trials[keys].drop_duplicates().merge(table[keys], how="outer", indicator=True)
    assert places["_merge"].eq("both").all()
    if "condition" in table:  # points in words
        return
    expected = trials.groupby(keys, dropna=False).mean(numeric_only=True).drop(columns="trial")
    expected = expected.reset_index().melt(keys, var_name="quantity", value_name="expected")
    shown = list_means(table, keys).merge(expected, on=[*keys, "quantity"])
    np.testing.assert_allclose(shown["mean"].astype(float), shown["expected"], rtol=1e-9)


def list_means(table, keys):
    """Means of a table that has a row, or a column, for each quantity: `quantity`, `mean` and the keys."""
    if "mean" not in table:
        named = table.filter(regex="_mean$").rename(columns=lambda name: name[:-5])
        if named.empty:
            named = table.drop(columns=keys)
        return table[keys].join(named).melt(keys, var_name="quantity", value_name="mean")
    if "against" in table:
        against = table["against"].astype(str).str.lower()
        return table.assign(quantity="vaf_" + table["torque"] + "_" + against)
    return table.rename(columns={"parameter": "quantity"})
