"""Numbers of docs/explanation/time-varying.md and of riv-tv in docs/methods.md, from studies of config/beyond.yaml."""

from functools import cache

import pandas as pd
import yaml
from blocks import ROOT, block
from runs import RESULTS, make, markdown_table

from ankleloop.replication.time_varying import published_rows, setting_titles
from ankleloop.studies.study import read_studies

STUDIES = ("time-varying", "time-varying-modes", "square-wave", "open-loop-cycles")
SOURCES = (
    "ankleloop.simulation.simulate",
    "ankleloop.methods.riv_tv",
    "ankleloop.assessment.trajectory_scores",
    "ankleloop.replication.time_varying",
    "ankleloop.replication.time_varying_limits",
)
PARAMETERS = ("K", "B", "G")


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


def describe_range(values):
    """Smallest, largest and median of percentages."""
    return f"{values.min():.0f} to {values.max():.0f} % (median {values.median():.0f} %)"


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
        "joint and the perturbation are others, and what an error is divided by may be. So this shows whether the "
        "errors are of one size, not which method has the smaller ones."
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


@block("time-varying-bound", SOURCES, studies=("time-varying",))
def write_bound():
    table = read_measures("time-varying").dropna(subset="bound")
    columns = {
        "error [%]": ("root_error", ".1f"),
        "bound [%]": ("bound", ".1f"),
        "efficiency [%]": ("efficiency", ".0f"),
    }
    columns |= {"efficiency of the mean [%]": ("mean_efficiency", ".0f")}
    rows = [
        [setting, *(triple(part, name, spec) for name, spec in columns.values())]
        for setting, part in table.groupby("setting", sort=False)
    ]
    return (
        f"{markdown_table(['K / B / G', *columns], rows)}\n\nStudy `time-varying`, {trials_of(table)}: root mean "
        "square errors over places and trials, over the mean of the truth. The efficiency is the square of the bound "
        f"over that of the error: {describe_range(table['efficiency'])}. That of the mean over the cycle: "
        f"{describe_range(table['mean_efficiency'])}, with intervals on the page of the study."
    )
