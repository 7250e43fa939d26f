"""One recording from its checks to all its results: every valid method, fitted and tested on unseen data."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from ankleloop.assessment.residuals import ResidualTest, residual_test
from ankleloop.assessment.scores import evaluate, parameter_row
from ankleloop.errors import DataError
from ankleloop.joint.estimate import TORQUES, Estimate
from ankleloop.joint.prepared import PreparedTrial, prepare
from ankleloop.methods.registry import find_method, identify
from ankleloop.recordings.checks import Check, check_merged_trials, check_trial
from ankleloop.records.trial import segment

__all__ = ["Analysis", "analyse"]


@dataclass(frozen=True)
class Analysis:
    """Results of one recording.

    Parameters
    ----------
    check : Check
        The checks of the recording.
    records : dict of str to list of Estimate
        By the label of the method the estimates of the whole recording, one for each trial that was merged; none if the
        recording was refused.
    residuals : dict of str to ResidualTest
        By the label of the method the test of the residual of the longest trial.
    table : pandas.DataFrame
        One row for each method: whether it is valid here, cross-validated and fitted VAF [%] with intervals, parameters
        with intervals, tests of the residual, warnings; one row without a method if the recording was refused.
    """

    check: Check
    records: dict[str, list[Estimate]] = field(repr=False)
    residuals: dict[str, ResidualTest] = field(repr=False)
    table: pd.DataFrame = field(repr=False)

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

    Each method is fitted to the first half and scored on the second; options to be selected are selected within the
    first half. Then it is fitted to the whole with the same options. The residual is tested within the pass band, for
    whiteness and for correlation with the position, or in closed loop with the position that the reference explains.

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

    Examples
    --------
    >>> from ankleloop.simulation.simulate import simulate
    >>> analysis = analyse(simulate(seed=1), {"riv": {"method": "riv"}, "PI-MOESP": {"method": "pi-moesp"}})
    >>> analysis.table[["label", "valid"]].values.tolist()
    [['riv', True], ['PI-MOESP', False]]
    """
    trials = [trial] if isinstance(trial, (xr.Dataset, PreparedTrial)) else list(trial)
    merged = len(trials) > 1
    options: dict[str, Any] = {"reference": reference, **_largest_options(methods)}
    check = check_merged_trials(trials, **options) if merged else check_trial(trials[0], **options)
    if check.verdict == "refused":
        return Analysis(check, {}, {}, pd.DataFrame([{"verdict": "refused", "reasons": " ".join(check.reasons)}]))
    prepared = [prepare(part) for part in trials]
    longest = int(np.argmax([part.samples("time").size for part in prepared]))
    records, residuals, rows = {}, {}, []
    for label, specification in methods.items():
        row = {"verdict": check.verdict, "loop": check.loop, "label": label, "method": specification["method"]}
        reason = _reason_against(check, specification, merged)
        if reason is None:
            try:
                estimates, scores = _fit(prepared, specification)
                test = _test_residual(prepared[longest], estimates[longest], check.loop, reference)
                row |= {"valid": True, **scores, **_test_columns(test), **parameter_row(prepared[0], estimates[0])}
                records[label], residuals[label] = estimates, test
            except DataError as error:
                reason = str(error)
        rows.append(row if reason is None else row | {"valid": False, "warnings": reason})
    return Analysis(check, records, residuals, pd.DataFrame(rows))


def _largest_options(methods: Mapping[str, Mapping[str, Any]]) -> dict[str, int]:
    """Largest order and number of block rows that any method may use: the movement has to excite as much."""
    values: dict[str, list[int]] = {"order": [2], "block_rows": [15]}
    for specification in methods.values():
        for name, candidates in values.items():
            used = [specification.get("options", {}).get(name), *(specification.get("select") or {}).get(name, ())]
            candidates += [value for value in used if value is not None]
    return {name: max(candidates) for name, candidates in values.items()}


def _reason_against(check: Check, specification: Mapping[str, Any], merged: bool) -> str | None:
    """Why a method is not valid for this recording; None if it is valid."""
    method, options = specification["method"], specification.get("options", {})
    if merged and not find_method(method).merges:
        return "identifies one trial at a time: it does not merge them"
    if method not in check.methods:
        return f"not valid in a loop that is {check.loop}"
    required = check.methods[method]
    position = options.get("reference") == "position"
    if check.loop == "undecided" and required.get("reference") == "position" and not position:
        return "needs a reference: with reference='position' it is valid if the loop is open"
    if "input_matrices" in required and options.get("input_matrices") != required["input_matrices"]:
        return "least squares for B and D is biased in closed loop: input_matrices='instruments'"
    if check.loop == "closed" and position:
        return "the position is no reference in closed loop"
    return None


def _fit(trials: list[PreparedTrial], specification: Mapping[str, Any]) -> tuple[list[Estimate], dict[str, Any]]:
    """Estimates of the whole, and VAFs of the whole and of the half that was not fitted."""
    method, options, select = (
        specification["method"],
        specification.get("options", {}),
        specification.get("select") or None,
    )
    first, second = _split_halves(trials)
    half = _identify_all(first, method, select=select, criterion=specification.get("criterion"), **options)
    chosen = half[0].diagnostics["selection"]["chosen"] if select else {}
    whole = _identify_all(trials, method, **options, **chosen)
    scores: dict[str, Any] = {"selected": ", ".join(f"{name} {value}" for name, value in chosen.items())}
    try:
        scores |= _score([(part, half[0].predict(part)) for part in second], {"net": "vaf_unseen"})
    except DataError as error:
        scores |= {"vaf_unseen": np.nan, "unseen_error": str(error)}
    columns = {torque: f"vaf_{torque}" for torque in TORQUES}
    return whole, scores | _score(zip(trials, whole, strict=True), columns)


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


def _test_residual(trial: PreparedTrial, estimate: Estimate, loop: str, reference: str) -> ResidualTest:
    """Test the residual against the position, or in closed loop against the part that the reference explains."""
    time, rate = estimate.torque["time"].values, estimate.torque.attrs["identification_rate"]
    residual = trial.channel_at("torque", time, rate) - estimate.torque["net"].values
    if loop != "closed":
        return residual_test(residual, trial.channel_at("position", time, rate), rate)
    regressors = trial.regressors(
        delay=estimate.reflex["delay"], basis="rectifier", identification_rate=rate, reference=reference
    )
    predicted = trial.predict_inputs(regressors)[:, 0]
    rows = np.searchsorted(regressors.time, time - 1e-6)
    inside = rows < regressors.time.size
    return residual_test(residual[inside], predicted[rows[inside]], rate)


def _test_columns(test: ResidualTest) -> dict[str, bool | float]:
    return {f"residual_{name}": getattr(test, name) for name in ("white", "white_p", "related", "related_p")}
