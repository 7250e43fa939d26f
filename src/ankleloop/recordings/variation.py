"""Recordings of joints that change: what their parameters are functions of, and whether they change at all."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
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


@dataclass(frozen=True)
class Variation:
    """Whether the joint of a recording changes, by one method."""

    label: str  # label of the method
    varies: bool  # whether a constant joint is refused at the level of the test, by a model that is complete
    test: str  # the test, in sentences
    unseen: str  # the VAF of unseen data beside that of a time-invariant fit, in sentences


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
    name = "cycles" if onsets is not None else "schedule"
    options = RivTvOptions.model_fields
    prepared = prepare(trial)
    try:
        grid = prepared.grid(options["identification_rate"].default, options["delay"].default)
        course = make_course(prepared, grid, onsets, schedule)
    except DataError as error:
        return [Finding(name, "warning", str(error))]
    if schedule is not None:
        low, high = course.limits
        return [Finding(name, "ok", f"{schedule} goes from {low:.4g} to {high:.4g} (2nd to 98th percentile).")]
    durations = np.bincount(course.segment) * grid.factor / prepared.rate
    shortest, longest = f"{durations.min():.3g}", f"{durations.max():.3g}"
    text = f"{shortest} s" if shortest == longest else f"{shortest} to {longest} s"
    return [Finding(name, "ok", f"{course.segments} whole cycles of {text} can be identified.")]


def describe_variations(analysis: Analysis) -> list[Variation]:
    """Whether the joint of a recording changes, by each method whose parameters may."""
    varying = {label: estimate for label, estimate in analysis.estimates.items() if estimate.trajectories is not None}
    return [_describe(analysis, label, estimate) for label, estimate in varying.items()]


def _describe(analysis: Analysis, label: str, estimate: Estimate) -> Variation:
    if estimate.trajectories is None:
        raise ValueError(f"{label} has no trajectories.")
    dimension = str(next(iter(estimate.trajectories.sizes)))
    words, data = DIMENSIONS[dimension]
    p = {name: float(value) for name, value in estimate.diagnostics["variation_p"].items()}
    refused = p["all"] < LEVEL
    complete = not analysis.table.set_index("label").loc[label, "incomplete"]
    level = f"test at the level of {100 * LEVEL:g} %"
    if refused:
        test = f"K, B or G change {words}: in a constant joint so large a variation has a probability of "
        test += f"{_show(p['all'])} ({level})."
    else:
        test = f"No change of K, B or G {words} is shown: a constant joint gives as large a variation with a "
        test += f"probability of {_show(p['all'])} ({level}). A change that is smaller than the bands may be there."
    alone = ", ".join(f"{name} {_show(p[name])}" for name in "KBG")
    test += f" Each of them alone, while the others may change: {alone}."
    if refused and not complete:
        test += (
            " But the model is not complete, or the record has a fault, and what a model leaves out may be taken for "
        )
        test += "a change. So the test decides nothing here."
    if dimension == "schedule":
        place = estimate.trajectories[dimension]
        unit = f" {place.attrs['units']}" if place.attrs.get("units") else ""
        test += f" The trajectories reach from {float(place[0]):.3g} to {float(place[-1]):.3g}{unit}, the 2nd to the "
        test += "98th percentile of the variable; samples beyond count as its ends."
    return Variation(label, refused and complete, test, _compare_with_constant(analysis, label, data))


def _compare_with_constant(analysis: Analysis, label: str, data: str) -> str:
    """VAF of unseen data beside that of a time-invariant fit."""
    table = analysis.table.set_index("label")
    score = table.loc[label].get("vaf_unseen")
    if score is None or score != score:
        reason = str(table.loc[label].get("unseen_warnings") or "").removeprefix("there is none: ")
        return f"There is no VAF of {data}: {reason or 'it could not be computed.'}"
    text = f"Of the torque of {data} the trajectories explain {score:.1f} %"
    constants = [name for name in analysis.unseen if analysis.estimates[name].method == "riv"]
    if not constants:
        return f"{text}. To compare it with a time-invariant fit, name riv among the methods."
    constant = constants[0]
    text += f", the time-invariant fit ({constant}) {table.loc[constant, 'vaf_unseen']:.1f} %"
    try:
        gain = compare_unseen(analysis.unseen[label], analysis.unseen[constant])
    except DataError:
        return f"{text}; the difference cannot be judged: the unseen part is too short."
    verdict = "" if gain.distinct else ", so they cannot be told apart by it"
    return f"{text}: a difference of {gain.difference:.1f} points (95 %: {gain.low:.1f} … {gain.high:.1f}){verdict}."


def _show(p: float) -> str:
    return "less than 0.001" if p < 0.001 else f"{p:.2g}"
