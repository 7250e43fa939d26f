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
    name, options, prepared = "cycles" if schedule is None else "schedule", RivTvOptions.defaults(), prepare(trial)
    try:
        grid = prepared.grid(options["identification_rate"], options["delay"])
        course = make_course(prepared, grid, onsets, schedule)
    except DataError as error:
        return [Finding(name, "warning", str(error))]
    if schedule is not None:
        low, high = course.limits
        return [Finding(name, "ok", f"{schedule} goes from {low:.4g} to {high:.4g} (2nd to 98th percentile).")]
    durations = np.bincount(course.segment) * grid.factor / prepared.rate
    ends = dict.fromkeys([f"{durations.min():.3g}", f"{durations.max():.3g}"])
    return [Finding(name, "ok", f"{course.segments} whole cycles of {' to '.join(ends)} s can be identified.")]


def describe_variations(analysis: Analysis) -> dict[str, str]:
    """Whether the joint of a recording changes, in sentences, by the label of each method whose parameters may."""
    rows = {row.get("label"): row for row in analysis.table.to_dict("records")}
    texts = {}
    for label, estimate in analysis.estimates.items():
        if estimate.trajectories is not None:
            words, data = DIMENSIONS[str(next(iter(estimate.trajectories.sizes)))]
            test = _describe_test(estimate.diagnostics["variation_p"], words, rows[label]["incomplete"])
            texts[label] = f"{test} {_compare_with_constant(analysis, rows, label, data)}"
    return texts


def _describe_test(probabilities: Mapping[str, float], words: str, incomplete: bool) -> str:
    """The test whether a constant joint is refused, and whether the model is complete enough for it."""
    p = {name: "less than 0.001" if p < 0.001 else f"{p:.2g}" for name, p in probabilities.items()}
    changes = probabilities["all"] < LEVEL
    text = f"K, B or G change {words}" if changes else f"No change of K, B or G {words} is shown"
    text += f": a constant joint gives as large a variation with a probability of {p['all']} (level {100 * LEVEL:g} %)."
    text += f" Each of them alone, while the others may change: {', '.join(f'{name} {p[name]}' for name in 'KBG')}."
    if not changes:
        text += " A change that is smaller than the bands may be there."
    elif incomplete:
        text += (
            " But the model is not complete, or the record has a fault, and what a model leaves out may be taken for "
            "a change. So the test decides nothing here."
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
    return f"{text}: a difference of {gain.difference:.1f} points (95 %: {gain.low:.1f} … {gain.high:.1f})."
