"""One recording from its checks to all its results: every valid method, fitted and tested on unseen data."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from ankleloop.assessment.residuals import ResidualTest, residual_test
from ankleloop.assessment.scores import evaluate, parameter_row
from ankleloop.errors import NUMERICAL_ERRORS, DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.prepared import PreparedTrial, prepare
from ankleloop.joint.regressors import TORQUES
from ankleloop.methods.registry import find_method, identify
from ankleloop.methods.riv.alternatives import compute_shifts, format_shifts
from ankleloop.methods.selection import check_selection
from ankleloop.recordings.checks import Check, check_trial
from ankleloop.recordings.comparison import UnseenTorque, unseen_torque
from ankleloop.recordings.validity import caution, reason_against
from ankleloop.signals.sampling import match_times
from ankleloop.trials.trial import segment

OTHER_DELAY = 0.01  # s

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Analysis:
    """Results of one recording."""

    check: Check  # the checks of the recording
    # By the label of the method the estimates of the whole recording, one for each trial that was merged; none if the
    # recording was refused.
    records: dict[str, list[Estimate]] = field(repr=False)
    # By the label of the method the test of the residual of the longest trial.
    residuals: dict[str, ResidualTest] = field(repr=False)
    # One row for each method: whether it is `valid` here (else the reason in `warnings`), `warnings` of its estimate,
    # whether it can be `trusted` (valid, and without a warning), a `caution` where it is valid with one, its
    # `assumptions`, with what 10 ms more of an assumed delay would do, whether its model is `incomplete`, cross-
    # validated and fitted VAF [%] with intervals, parameters with the kind of their `intervals` (parameters of a
    # method with a warning have none), tests of the residual. One row without a method if the recording was refused.
    table: pd.DataFrame = field(repr=False)
    # By the label of the method what its fit to the first half leaves of the second.
    unseen: dict[str, list[UnseenTorque]] = field(default_factory=dict, repr=False)

    @property
    def estimates(self) -> dict[str, Estimate]:
        """Estimate of the first trial by the label of the method."""
        return {label: estimates[0] for label, estimates in self.records.items()}


def analyse(
    trial: xr.Dataset | PreparedTrial | Sequence[xr.Dataset | PreparedTrial],
    methods: Mapping[str, Mapping[str, Any]],
    *,
    reference: str = "reference",
) -> Analysis:
    """Check a recording, and fit every method that is valid for it.

    Each method is fitted to the first half and scored on the second, if the half is long enough; options to be selected
    are selected within the first half. Then it is fitted to the whole with the same options. The residual is tested
    within the pass band, for whiteness and for correlation with the position, or with the position that the reference
    explains where feedback is not excluded. A method that fails has the reason in its row; the others are not affected.

    Parameters
    ----------
    trial : xarray.Dataset or PreparedTrial, or list of those
        The recording. Several short trials are merged into one identification; their halves are halves of the list.
    methods : dict of str to dict
        For each label the `method`, its `options`, and options to `select` by a `criterion`.
    reference : str
        Variable that serves as reference.

    Returns
    -------
    Analysis

    Raises
    ------
    DataError
        If a trial is not valid.
    ValueError, TypeError
        For a method or an option that does not exist, or a value out of its range.

    Examples
    --------
    >>> from ankleloop.simulation.simulate import simulate
    >>> analysis = analyse(simulate(seed=1), {"riv": {"method": "riv"}, "PI-MOESP": {"method": "pi-moesp"}})
    >>> analysis.table[["label", "valid"]].values.tolist()
    [['riv', True], ['PI-MOESP', False]]
    """
    trials = [trial] if isinstance(trial, (xr.Dataset, PreparedTrial)) else list(trial)
    for specification in methods.values():  # wrong options are refused before anything is fitted
        method, options = find_method(specification["method"]), specification.get("options", {})
        select, criterion = specification.get("select"), specification.get("criterion")
        check_selection(f"method {method.name!r}", method.options, options, select, criterion)
    check = check_trial(trials, reference=reference, **largest_options(methods))
    if check.verdict == "refused":
        return refused_analysis(check)
    prepared = [prepare(part) for part in trials]
    analysis, rows = Analysis(check, {}, {}, pd.DataFrame()), []
    for number, (label, specification) in enumerate(methods.items(), start=1):
        log.info("method %d of %d: %s", number, len(methods), label)
        row = {"verdict": check.verdict, "loop": check.loop, "label": label, "method": specification["method"]}
        row["valid"] = True
        try:
            _refuse_invalid(check, specification, len(trials) > 1)
            estimates, unseen, scores = _fit(prepared, specification)
            test = _test_residual(prepared, estimates, check.instrumental, reference)
            row |= scores | _describe_estimates(prepared, specification, check, estimates, test)
            analysis.records[label], analysis.residuals[label] = estimates, test
            if unseen:
                analysis.unseen[label] = unseen
        except NUMERICAL_ERRORS as error:
            reason = str(error)
            if not isinstance(error, DataError):
                log.warning("%s failed", label, exc_info=True)
                reason = f"it failed numerically ({type(error).__name__}: {error})"
            row |= {"valid": False, "trusted": False, "warnings": reason}
        rows.append(row)
    return replace(analysis, table=pd.DataFrame(rows))


def refused_analysis(check: Check) -> Analysis:
    """Analysis of a recording that its check refuses."""
    return Analysis(check, {}, {}, pd.DataFrame([{"verdict": "refused", "reasons": " ".join(check.reasons)}]))


def largest_options(methods: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Largest order and number of block rows that any method may use: the movement has to excite as much."""
    values: dict[str, list[int]] = {"order": [2], "block_rows": [15]}
    for specification in methods.values():
        for name, candidates in values.items():
            used = [specification.get("options", {}).get(name), *(specification.get("select") or {}).get(name, ())]
            candidates += [value for value in used if value is not None]
    return {name: max(candidates) for name, candidates in values.items()}


def _describe_estimates(
    trials: list[PreparedTrial],
    specification: Mapping[str, Any],
    check: Check,
    estimates: list[Estimate],
    test: ResidualTest,
) -> dict[str, Any]:
    """Columns of the table about the estimates of a method; the parameters are those of the first trial."""
    estimate, warnings = estimates[0], estimates[0].fit_warnings
    row = {f"residual_{name}": getattr(test, name) for name in ("white", "white_p", "related", "related_p")}
    row |= parameter_row(trials[0], estimate)
    if warnings:  # the covariance belongs to a solution that was not reached, or to another model
        withheld = {f"{name}_{end}" for name in estimate.intervals for end in ("low", "high")} | {"intervals"}
        row = {name: value for name, value in row.items() if name not in withheld}
    # Warnings about the data concern all methods alike, so they do not decide between them.
    about_data = estimate.diagnostics.get("data_warnings", ())
    cautions = caution(specification["method"], check.loop, check.reference), *about_data
    return row | {
        "warnings": " ".join(warnings),
        "trusted": not warnings,
        "caution": " ".join(filter(None, cautions)),
        # A test whether the joint changes takes what the model or an instrument leaves out for a change.
        "incomplete": bool(test.related or about_data or estimate.diagnostics.get("alternatives")),
        "assumptions": " ".join(_describe_assumptions(trials, estimate, specification)),
    }


def _describe_assumptions(
    trials: list[PreparedTrial], estimate: Estimate, specification: Mapping[str, Any]
) -> list[str]:
    """What an estimate takes for granted, with what another delay would do, and what it lacks."""
    diagnostics, delay = estimate.diagnostics, estimate.reflex["delay"]
    texts = [*diagnostics.get("assumptions", ()), *diagnostics.get("missing", ())]
    others: dict[str, dict[str, Any]] = {}
    if "delay" not in estimate.intervals:
        others[f"A delay of {1000 * OTHER_DELAY:g} ms more"] = {"delay": delay + OTHER_DELAY}
    if any("polynomial" in text for text in texts):
        others["A rectifier in place of the polynomial"] = {"delay": delay, "basis": "rectifier"}
    values = {**estimate.stiffness, **estimate.reflex}
    for name, changes in others.items():
        try:
            other = _identify_all(trials, specification["method"], **specification.get("options", {}) | changes)[0]
            shifts = compute_shifts(values, {**other.stiffness, **other.reflex})
            texts.append(f"{name} would move {format_shifts(shifts)}.")
        except DataError as error:
            texts.append(f"What it would do cannot be told ({name}): {error}")
    for row in diagnostics.get("alternatives", ()):
        texts.append(f"With {row['effect']} in the model it would move {format_shifts(row['shifts'])}.")
    return [text[0].upper() + text[1:] for text in texts]


def _refuse_invalid(check: Check, specification: Mapping[str, Any], merged: bool) -> None:
    """Refuse a method that is not valid for this recording."""
    method, options = specification["method"], specification.get("options", {})
    if merged and not find_method(method).merges:
        raise DataError("it identifies one trial at a time, and does not merge them")
    reason = reason_against(method, options, loop=check.loop, reference=check.reference, path_bias=check.path_bias)
    if reason:
        raise DataError(reason)


def _fit(
    trials: list[PreparedTrial], specification: Mapping[str, Any]
) -> tuple[list[Estimate], list[UnseenTorque], dict[str, Any]]:
    """Estimates of the whole, what the fit to one half leaves of the other, and the scores of both."""
    method, options = specification["method"], specification.get("options", {})
    select = specification.get("select") or None
    first, second = _split_halves(trials)
    scores: dict[str, Any] = {"vaf_unseen": np.nan, "selected": ""}
    unseen: list[UnseenTorque] = []
    chosen: dict[str, Any] = {}
    try:
        half = _identify_all(first, method, select=select, criterion=specification.get("criterion"), **options)
        chosen = half[0].diagnostics["selection"]["chosen"] if select else {}
        scores["selected"] = ", ".join(f"{name} {value}" for name, value in chosen.items())
        scores["unseen_warnings"] = " ".join(half[0].fit_warnings)
        predictions = [(part, _predict(half[0], part, options)) for part in second]
        scores |= _score(predictions, {"net": "vaf_unseen"})
        unseen = [unseen_torque(*prediction) for prediction in predictions]
    except DataError as error:
        if select and not chosen:  # without a choice there are no options to fit the whole with
            raise
        scores["unseen_warnings"] = f"there is none: {error}"
    whole = _identify_all(trials, method, **options, **chosen)
    columns = {torque: f"vaf_{torque}" for torque in TORQUES}
    return whole, unseen, scores | _score(zip(trials, whole, strict=True), columns)


def _predict(estimate: Estimate, part: PreparedTrial, options: Mapping[str, Any]) -> Estimate:
    """Torques of a part that was not fitted; its cycles begin at onsets of the whole recording."""
    if estimate.trajectories is not None and "time" in estimate.trajectories.sizes:
        raise DataError("the parameters are functions of time, and were fitted before the times of the other half.")
    onsets = options.get("cycle_onsets")
    return estimate.predict(part) if onsets is None else estimate.predict(part, cycle_onsets=onsets)


def _split_halves(trials: list[PreparedTrial]) -> tuple[list[PreparedTrial], list[PreparedTrial]]:
    """Two halves of a trial, or of a list of trials."""
    if len(trials) > 1:
        middle = (len(trials) + 1) // 2
        return trials[:middle], trials[middle:]
    time, rate = trials[0].samples("time"), trials[0].rate
    halfway = 0.5 * (time[0] + time[-1])
    ends = (time[0], halfway), (halfway, time[-1] + 1.0 / rate)
    first, second = (prepare(segment(trials[0].trial, start, stop)) for start, stop in ends)
    return [first], [second]


def _identify_all(trials: list[PreparedTrial], method: str, **options: Any) -> list[Estimate]:
    """One estimate for each trial; several trials are merged."""
    return identify(trials, method, **options) if len(trials) > 1 else [identify(trials[0], method, **options)]


def _score(pairs: Iterable[tuple[PreparedTrial, Estimate]], columns: Mapping[str, str]) -> dict[str, float]:
    """VAFs against the measured torque: means over merged trials, or the VAF of a single trial with its interval."""
    tables = [
        evaluate(trial, estimate, against="measured", intervals=True).set_index("torque") for trial, estimate in pairs
    ]
    scores = {}
    for torque, column in columns.items():
        scores[column] = float(np.mean([table.loc[torque, "vaf"] for table in tables]))
        if len(tables) == 1:
            scores |= {f"{column}_{end}": float(tables[0].loc[torque, end]) for end in ("low", "high")}
    return scores


def _test_residual(
    trials: list[PreparedTrial], estimates: list[Estimate], instrumental: bool, reference: str
) -> ResidualTest:
    """Test the residual of the longest trial.

    It is tested against the position, or unless the loop is open against what the reference explains of it.
    """
    longest = int(np.argmax([part.samples("time").size for part in trials]))
    trial, estimate = trials[longest], estimates[longest]
    time, rate = estimate.torque["time"].values, estimate.torque.attrs["identification_rate"]
    residual = trial.channel_at("torque", time, rate) - estimate.torque["net"].values
    if not instrumental:
        return residual_test(residual, trial.channel_at("position", time, rate), rate)
    regressors = trial.regressors(
        delay=estimate.reflex["delay"], basis="rectifier", identification_rate=rate, reference=reference
    )
    predicted = trial.predict_inputs(regressors)[:, 0]
    rows, common = match_times(regressors.time, time)
    return residual_test(residual[common], predicted[rows], rate)
