"""Recordings of joints that change: what their parameters are functions of, and whether they change at all."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ankleloop.errors import DataError
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
    rows = {row.get("label"): row for row in analysis.table.to_dict("records")}
    texts = {}
    for label, estimate in analysis.estimates.items():
        if (curves := estimate.trajectories) is not None:
            place = curves[str(next(iter(curves.sizes)))]
            test = _describe_test(estimate.diagnostics["variation_p"], place, rows[label]["incomplete"])
            texts[label] = f"{test} {_compare_with_constant(analysis, rows, label, DIMENSIONS[str(place.name)][1])}"
    return texts


def _describe_test(probabilities: Mapping[str, float], place: xr.DataArray, incomplete: bool) -> str:
    """The test whether a constant joint is refused, and whether the model is complete enough for it."""
    words = DIMENSIONS[str(place.name)][0]
    p = {name: "less than 0.001" if p < 0.001 else f"{p:.2g}" for name, p in probabilities.items()}
    probability = f"probability of {p['all']} (test at the level of {100 * LEVEL:g} %)."
    text = (
        f"No change of K, B or G {words} is shown: a constant joint gives as large a variation with a {probability} A "
        "change that is smaller than the bands may be there."
    )
    if changes := probabilities["all"] < LEVEL:
        text = f"K, B or G change {words}: in a constant joint so large a variation has a {probability}"
    text += f" Each of them alone, while the others may change: {', '.join(f'{name} {p[name]}' for name in 'KBG')}."
    if changes and incomplete:
        text += (
            " But the model is not complete, or the record has a fault, and what a model leaves out may be taken for "
            "a change. So the test decides nothing here."
        )
    if place.name == "schedule":
        unit = f" {place.attrs['units']}" if place.attrs.get("units") else ""
        text += (
            f" The trajectories reach from {float(place[0]):.3g} to {float(place[-1]):.3g}{unit}, the 2nd to the 98th "
            "percentile of the variable; samples beyond count as its ends."
        )
    return text


def _compare_with_constant(analysis: Analysis, rows: Mapping[str, Mapping[str, Any]], label: str, data: str) -> str:
    """VAF of unseen data beside that of a time-invariant fit."""
    row, score = rows[label], rows[label]["vaf_unseen"]
    if np.isnan(score):
        return f"There is no VAF of {data}: {row['unseen_warnings'].removeprefix('there is none: ')}"
    text = f"Of the torque of {data} the trajectories explain {score:.1f} %"
    constant = next((name for name in analysis.unseen if rows[name]["method"] == "riv"), None)
    if constant is None:
        return f"{text}. To compare it with a time-invariant fit, name riv among the methods."
    text += f", the time-invariant fit ({constant}) {rows[constant]['vaf_unseen']:.1f} %"
    gain = compare_unseen(analysis.unseen[label], analysis.unseen[constant])
    if gain is None:
        return f"{text}; the difference cannot be judged: the unseen part is too short."
    verdict = "" if gain.low > 0 or gain.high < 0 else ", so they cannot be told apart by it"
    return f"{text}: a difference of {gain.difference:.1f} points (95 %: {gain.low:.1f} … {gain.high:.1f}){verdict}."
