"""Recordings of joints that change: what their parameters are functions of, and whether they change at all."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.prepared import prepare
from ankleloop.joint.time_varying_course import make_course
from ankleloop.methods.registry import find_method
from ankleloop.methods.riv_tv.riv_tv import RivTvOptions
from ankleloop.recordings.analysis import Analysis
from ankleloop.recordings.checks import Finding
from ankleloop.recordings.comparison import compare_unseen

if TYPE_CHECKING:
    import xarray as xr

LEVEL = 0.05  # of the test whether anything varies
COURSE = ("cycle_onsets", "schedule")  # options that say what parameters are functions of
DIMENSIONS = {
    "phase": ("with the phase of the cycle", "unseen cycles"),
    "time": ("with time", "the unseen half"),
    "schedule": ("with the scheduling variable", "the unseen half"),
}


def add_course(methods: Mapping[str, Mapping[str, Any]], mapping: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Give methods what the parameters of a recording are functions of."""
    course = {name: mapping[name] for name in COURSE if mapping.get(name) is not None}
    result: dict[str, Mapping[str, Any]] = {}
    for label, method in methods.items():
        options = method.get("options", {})
        takes = course.keys() <= find_method(method["method"]).options.model_fields.keys()
        free = all(options.get(name) is None for name in COURSE)
        result[label] = {**method, "options": {**options, **course}} if course and takes and free else method
    return result


def check_course(trial: xr.Dataset, mapping: Mapping[str, Any]) -> list[Finding]:
    """Check whether the onsets of cycles, or the scheduling variable, can be used with a recording."""
    onsets, schedule = (mapping.get(name) for name in COURSE)
    if onsets is None and schedule is None:
        return []
    name, verdict, options = "cycles" if schedule is None else "schedule", "ok", RivTvOptions.model_fields
    prepared = prepare(trial)
    try:
        grid = prepared.grid(options["identification_rate"].default, options["delay"].default)
        course = make_course(prepared, grid, onsets, schedule)
        if schedule is not None:
            low, high = course.limits
            text = f"{schedule} goes from {low:.4g} to {high:.4g} (2nd to 98th percentile)."
        else:
            durations = np.bincount(course.segment) * grid.factor / prepared.rate
            ends = dict.fromkeys([f"{durations.min():.3g}", f"{durations.max():.3g}"])
            text = f"{course.segments} whole cycles of {' to '.join(ends)} s can be identified."
    except DataError as error:
        verdict, text = "warning", str(error)
    return [Finding(name, verdict, text)]


def describe_variations(analysis: Analysis) -> dict[str, str]:
    """Whether the joint of a recording changes, in sentences, by the label of each method whose parameters may."""
    return {
        label: f"{_describe_test(analysis, label, estimate, curves)} {_compare_with_constant(analysis, label, curves)}"
        for label, estimate in analysis.estimates.items()
        if (curves := estimate.trajectories) is not None
    }


def _describe_test(analysis: Analysis, label: str, estimate: Estimate, trajectories: xr.Dataset) -> str:
    """The test whether a constant joint is refused, and whether the model is complete enough for it."""
    dimension = str(next(iter(trajectories.sizes)))
    words = DIMENSIONS[dimension][0]
    p = {name: float(value) for name, value in estimate.diagnostics["variation_p"].items()}
    probability = f"probability of {_show(p['all'])} (test at the level of {100 * LEVEL:g} %)."
    text = (
        f"No change of K, B or G {words} is shown: a constant joint gives as large a variation with a {probability} A "
        "change that is smaller than the bands may be there."
    )
    if p["all"] < LEVEL:
        text = f"K, B or G change {words}: in a constant joint so large a variation has a {probability}"
    alone = ", ".join(f"{name} {_show(p[name])}" for name in "KBG")
    text += f" Each of them alone, while the others may change: {alone}."
    if p["all"] < LEVEL and analysis.table.set_index("label").loc[label, "incomplete"]:
        text += (
            " But the model is not complete, or the record has a fault, and what a model leaves out may be taken for "
            "a change. So the test decides nothing here."
        )
    if dimension == "schedule":
        place = trajectories[dimension]
        unit = f" {place.attrs['units']}" if place.attrs.get("units") else ""
        text += (
            f" The trajectories reach from {float(place[0]):.3g} to {float(place[-1]):.3g}{unit}, the 2nd to the 98th "
            "percentile of the variable; samples beyond count as its ends."
        )
    return text


def _compare_with_constant(analysis: Analysis, label: str, trajectories: xr.Dataset) -> str:
    """VAF of unseen data beside that of a time-invariant fit."""
    data = DIMENSIONS[str(next(iter(trajectories.sizes)))][1]
    table = analysis.table.set_index("label")
    score = table.loc[label, "vaf_unseen"]
    if np.isnan(score):
        return f"There is no VAF of {data}: {table.loc[label, 'unseen_warnings'].removeprefix('there is none: ')}"
    text = f"Of the torque of {data} the trajectories explain {score:.1f} %"
    constant = next((name for name in analysis.unseen if analysis.estimates[name].method == "riv"), None)
    if constant is None:
        return f"{text}. To compare it with a time-invariant fit, name riv among the methods."
    text += f", the time-invariant fit ({constant}) {table.loc[constant, 'vaf_unseen']:.1f} %"
    try:
        gain = compare_unseen(analysis.unseen[label], analysis.unseen[constant])
    except DataError:
        return f"{text}; the difference cannot be judged: the unseen part is too short."
    verdict = "" if gain.distinct else ", so they cannot be told apart by it"
    return f"{text}: a difference of {gain.difference:.1f} points (95 %: {gain.low:.1f} … {gain.high:.1f}){verdict}."


def _show(p: float) -> str:
    return "less than 0.001" if p < 0.001 else f"{p:.2g}"
