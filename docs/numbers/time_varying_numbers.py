"""Numbers of docs/explanation/time-varying.md and of riv-tv in docs/methods.md, from studies of config/beyond.yaml."""

from functools import cache

import numpy as np
import pandas as pd
import yaml
from blocks import ROOT, block
from runs import RESULTS, make, markdown_table

from ankleloop.assessment.trajectory_bound import trajectory_bound
from ankleloop.replication.time_varying import published_rows, setting_titles
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.studies.study import read_studies

STUDIES = ("time-varying", "time-varying-modes", "square-wave", "open-loop-cycles")
SOURCES = (
    "ankleloop.simulation.simulate",
    "ankleloop.methods.riv_tv",
    "ankleloop.assessment.trajectory_scores",
    "ankleloop.replication.time_varying",
)
PARAMETERS = ("K", "B", "G")
BOUNDS = 3  # trials whose bound is computed; it hardly depends on the perturbation


def read_points(name):
    """Simulation settings of each point of a study."""
    config = yaml.safe_load((ROOT / "config" / "config.yaml").read_text(encoding="utf-8"))
    points = read_studies({"studies": {name: config["studies"][name]}})[1][name].points
    return {
        point: {key: value for key, value in settings.items() if key in SimulationSettings.model_fields}
        for point, settings in points.items()
    }


@cache
def read_measures(name):
    """The table of a study, with the label of each method and what its setting is called."""
    make(f"results/tables/{name}.csv")
    config = yaml.safe_load((ROOT / "config" / "config.yaml").read_text(encoding="utf-8"))
    study = read_studies({"studies": {name: config["studies"][name]}})[1][name]
    table = pd.read_csv(RESULTS / "tables" / f"{name}.csv")
    titles = setting_titles(study.points, study.varied)
    return table.assign(setting=table["point"].map(titles), label=table["method"].map(study.labels))


def triple(part, column, spec=".1f", *, margin=False):
    """A measure of K, B and G, with half of its 95 % interval if it is wanted."""
    rows = part.set_index("parameter").reindex(PARAMETERS)
    margins = rows[f"{column}_margin"] if margin else [None] * len(rows)
    return " / ".join(
        "–" if pd.isna(value) else f"{value:{spec}}" + (f" ± {half:{spec}}" if margin else "")
        for value, half in zip(rows[column], margins, strict=True)
    )


def trials_of(table):
    return f"{table['trials'].iloc[0]} trials each"


def compare_errors(table):
    """Errors of every method, a row for each setting."""
    labels = list(dict.fromkeys(table["label"]))
    rows = [
        [setting, *(triple(part[part["label"] == label], "error") for label in labels)]
        for setting, part in table.groupby("setting", sort=False)
    ]
    return markdown_table(["error of K / B / G [%]", *labels], rows)


def bias_sentence(table, name, method):
    """Range of the mean error of K over the settings."""
    rows = table[(table["method"] == method) & (table["parameter"] == "K")]
    worst = rows.loc[rows["mean_error"].abs().idxmax()]
    return f"{name} {worst['mean_error']:+.1f} ± {worst['mean_error_margin']:.1f} % ({worst['setting']})"


@block("time-varying-errors", SOURCES, studies=("time-varying",))
def write_errors():
    table = read_measures("time-varying")
    biases = [
        bias_sentence(table, name, method)
        for name, method in (("riv-tv", "riv-tv"), ("least squares", "riv-tv-least-squares"))
    ]
    note = (
        f"Study `time-varying`, {trials_of(table)}: root mean square error over the cycle, over the mean of the truth. "
        "Loads are inertia/viscosity/stiffness [kg·m², N·m·s/rad, N·m/rad], voluntary torque its standard deviation "
        f"over that of the perturbation's torque. The largest mean error of K: {'; '.join(biases)}."
    )
    return f"{compare_errors(table)}\n\n{note}"


@block("time-varying-modes", SOURCES, studies=("time-varying-modes",))
def write_modes():
    table = read_measures("time-varying-modes")
    return f"{compare_errors(table)}\n\nStudy `time-varying-modes`, {trials_of(table)}."


@block("time-varying-square", SOURCES, studies=("square-wave",))
def write_square():
    table = read_measures("square-wave")
    rows = []
    for row in table[table["parameter"] == "K"].itertuples():
        rise = "–" if pd.isna(row.rise) else f"{1000 * row.rise:.0f}"
        errors = [f"{value:.1f}" for value in (row.bias, row.random, row.total, row.covered)]
        rows.append([row.label, f"{row.vaf_net:.2f}", *errors[:3], rise, errors[3]])
    header = ["K between 100 and 200 N·m/rad", "VAF [%]", "bias [%]", "random [%]", "total [%]", "rise [ms]"]
    note = (
        f"Study `square-wave`, {trials_of(table)}: moderate load, voluntary torque 5 %, 40 cycles of 1.4 s. VAF is "
        "that of the true net torque; errors are over the mean of K."
    )
    return f"{markdown_table([*header, 'held by the band [%]'], rows)}\n\n{note}"


@block("time-varying-open", (*SOURCES, "data/published/time_varying.csv"), studies=("open-loop-cycles",))
def write_open():
    table = read_measures("open-loop-cycles")
    rows = [
        [label, triple(part, "error"), f"{part['vaf_net'].iloc[0]:.2f}"]
        for label, part in table.groupby("label", sort=False)
    ]
    others = published_rows(pd.read_csv(ROOT / "data" / "published" / "time_varying.csv"), "open-loop-cycles")
    published = "; ".join(f"{row.measure} {row.published}" for row in others.itertuples())
    return (
        f"{markdown_table(['15 dB', 'error of K / B / G [%]', 'net VAF [%]'], rows)}\n\nStudy `open-loop-cycles`, "
        f"{trials_of(table)}. Published for this length and this noise ({others['source'].iloc[0]}): {published}; the "
        "joint is another one."
    )


@block("time-varying-coverage", SOURCES, studies=STUDIES)
def write_coverage():
    rows = []
    for name in STUDIES:
        table = read_measures(name)
        labels = ("riv-tv", "splines-12", "splines-40")
        for (setting, label), part in table[table["method"].isin(labels)].groupby(["setting", "label"], sort=False):
            title = setting if label == "riv-tv" else f"{setting}, {label}"
            rows.append([f"`{name}`", title, triple(part, "covered", ".0f", margin=True)])
    return (
        f"{markdown_table(['study', 'setting', 'held by the bands of K / B / G [%]'], rows)}\n\nShare of the places at "
        "which the 95 % band holds the truth, means over trials with half of their 95 % intervals."
    )


@block("time-varying-bound", (*SOURCES, "ankleloop.assessment.trajectory_bound"), studies=("time-varying",))
def write_bound():
    table = read_measures("time-varying")
    points = read_points("time-varying")
    rows, ratios = [], []
    for (point, setting), part in table[table["method"] == "riv-tv"].groupby(["point", "setting"], sort=False):
        bounds = [trajectory_bound(seed=seed, **points[point]) for seed in range(BOUNDS)]
        means = [points[point][name] for name in ("stiffness", "viscosity", "reflex_gain")]
        squares = [np.mean([(bound[name] ** 2).mean() for bound in bounds]) for name in PARAMETERS]
        deviations = 100.0 * np.sqrt(squares) / means
        errors = part.set_index("parameter")["error"].reindex(PARAMETERS).to_numpy()
        ratios.append(errors / deviations)
        cells = (errors, deviations, ratios[-1])
        rows.append(
            [setting, *(" / ".join(f"{value:.{n}f}" for value in c) for c, n in zip(cells, (1, 1, 2), strict=True))]
        )
    header = ["K / B / G", "error [%]", "bound [%]", "error over bound"]
    return (
        f"{markdown_table(header, rows)}\n\nStudy `time-varying`, and the bound of {BOUNDS} trials of each setting. "
        f"The error is {np.min(ratios):.2f} to {np.max(ratios):.2f} times the bound (median {np.median(ratios):.2f})."
    )
