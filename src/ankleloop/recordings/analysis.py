"""One recording from its checks to all its results: every valid method, fitted, and compared on unseen data."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import xarray as xr
from scipy import special

from ankleloop.assessment.residuals import ResidualTest, residual_test
from ankleloop.assessment.scores import evaluate, parameter_row
from ankleloop.errors import NUMERICAL_ERRORS, DataError
from ankleloop.joint.estimate import TRIM, Estimate
from ankleloop.joint.prepared import PreparedTrial, prepare
from ankleloop.joint.regressors import MEASURED, TORQUES
from ankleloop.methods.method import Method, Trial, Validity
from ankleloop.methods.registry import find_method, identify
from ankleloop.methods.riv.alternatives import compute_shifts, format_shifts
from ankleloop.methods.selection import check_selection
from ankleloop.recordings.checks import Check, check_trial
from ankleloop.recordings.validity import reason_against
from ankleloop.signals.sampling import match_times
from ankleloop.trials.trial import segment

BLOCK = 2.0  # s: longer than the squares of torques are correlated
FEWEST = 5  # blocks
DEFAULTS: Mapping[str, Any] = {"options": {}, "select": None, "criterion": None}

OTHER_DELAY = 0.01  # s

log = logging.getLogger(__name__)


class VafDifference(NamedTuple):
    """Difference of two VAFs on the same unseen data."""

    difference: float  # VAF of the first method less that of the second [points]
    low: float  # lower end of its 95 % interval
    high: float  # upper end of its 95 % interval


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
    # `assumptions`, with what 10 ms more of an assumed delay would do,
    # whether its model is `incomplete`, cross-validated and fitted VAF [%] with intervals, parameters
    # with the kind of their `intervals` (parameters of a method with a warning have none), tests of the residual. One
    # row without a method if the recording was refused.
    table: pd.DataFrame = field(repr=False)
    # By the label of the method the torques of the second half: measured, and predicted by the fit to the first half.
    unseen: dict[str, list[xr.Dataset]] = field(default_factory=dict, repr=False)

    @property
    def estimates(self) -> dict[str, Estimate]:
        """Estimate of the first trial by the label of the method."""
        return {label: estimates[0] for label, estimates in self.records.items()}


def analyse(trial: Trial | Sequence[Trial], methods: Mapping[str, Mapping[str, Any]]) -> Analysis:
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
        For each label the `method` (a name, or a `Method`), its `options`, and options to `select` by a `criterion`.

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
    parts: Any = trial if isinstance(trial, (list, tuple)) else [trial]
    trials = [prepare(part) for part in parts]
    methods = {
        label: {**DEFAULTS, **specification, "method": find_method(specification["method"])}
        for label, specification in methods.items()
    }
    for specification in methods.values():  # wrong options are refused before anything is fitted
        options, select, criterion = (specification[name] for name in DEFAULTS)
        entry = specification["method"]
        check_selection(f"method {entry.name!r}", entry.options, options, select, criterion)
    check = check_trial(trials, **largest_options(methods))
    if check.verdict == "refused":
        return refused_analysis(check)
    analysis, rows = Analysis(check, {}, {}, pd.DataFrame()), []
    for number, (label, specification) in enumerate(methods.items(), start=1):
        log.info("method %d of %d: %s", number, len(methods), label)
        method = specification["method"]
        row = {
            "verdict": check.verdict,
            "loop": check.loop,
            "label": label,
            "method": method.name,
            "valid": True,
        }
        rows.append(row)
        try:
            estimates, unseen, scores = _fit(trials, check, specification)
            test = _test_residual(trials, estimates, check.instrumental)
            assumptions = _list_assumptions(trials, specification, estimates[0])
            row |= (
                scores
                | _describe_estimate(check, trials[0], estimates[0], test, method.validity)
                | {"assumptions": assumptions}
            )
            analysis.records[label], analysis.residuals[label] = estimates, test
            if unseen:
                analysis.unseen[label] = unseen
        except NUMERICAL_ERRORS as error:
            row |= {"valid": False, "trusted": False, "warnings": describe_failure(error)}
    return replace(analysis, table=pd.DataFrame(rows))


def describe_failure(error: Exception) -> str:
    """Why something could not be computed; what is no fault of the data goes to the log with its trace."""
    if isinstance(error, DataError):
        return str(error)
    log.warning("failed", exc_info=error)
    return f"it failed numerically ({type(error).__name__}: {error})."


def refused_analysis(check: Check) -> Analysis:
    """Analysis of a recording that its check refuses."""
    row = {
        "verdict": "refused",
        "reasons": " ".join(check.reasons),
        "valid": False,
        "trusted": False,
    }
    return Analysis(check, {}, {}, pd.DataFrame([row]))


def largest_options(methods: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Largest order and number of block rows that any method may use: the movement has to excite as much."""
    used = {"order": [2], "block_rows": [15]}
    for specification in methods.values():
        for name, values in used.items():
            values += [
                specification["options"].get(name) or 0,
                *(specification["select"] or {}).get(name, ()),
            ]
    return {name: max(values) for name, values in used.items()}


def _fit(
    trials: list[PreparedTrial], check: Check, specification: Mapping[str, Any]
) -> tuple[list[Estimate], list[xr.Dataset], dict[str, Any]]:
    """Estimates of the whole, torques of one half that the fit to the other predicts, and the scores of both."""
    method, options, select = (
        specification["method"],
        specification["options"],
        specification["select"] or None,
    )
    if reason := reason_against(
        method, options, check.loop, check.reference, check.path_bias, merged=len(trials) > 1
    ):
        raise DataError(reason)
    first, second = _split_halves(trials)
    scores: dict[str, Any] = {"vaf_unseen": np.nan, "selected": ""}
    unseen = []
    chosen: dict[str, Any] = {}
    try:
        half = _identify(
            first, method, select=select, criterion=specification["criterion"], **options
        )[0]
        chosen = half.diagnostics["selection"]["chosen"] if select else {}
        scores["selected"] = ", ".join(f"{name} {value}" for name, value in chosen.items())
        scores["unseen_warnings"] = " ".join(half.fit_warnings)
        if half.trajectories is not None and "time" in half.trajectories.sizes:
            raise DataError(
                "the parameters are functions of time, and were fitted before the times of the other half."
            )
        # Cycles of the other half begin at onsets of the whole recording.
        predictions = [
            half.predict(part, cycle_onsets=options.get("cycle_onsets")) for part in second
        ]
        scores |= _score(second, predictions, {"net": "vaf_unseen"})
        torques = (prediction.torque for prediction in predictions)
        unseen = [
            torque.sel(time=slice(torque["time"][0] + TRIM, torque["time"][-1] - TRIM))
            for torque in torques
        ]
    except DataError as error:
        if select and not chosen:  # without a choice there are no options to fit the whole with
            raise
        scores["unseen_warnings"] = f"there is none: {error}"
    whole = _identify(trials, method, **options, **chosen)
    return (
        whole,
        unseen,
        scores | _score(trials, whole, {torque: f"vaf_{torque}" for torque in TORQUES}),
    )


def _split_halves(trials: list[PreparedTrial]) -> tuple[list[PreparedTrial], list[PreparedTrial]]:
    """Two halves of a trial, or of a list of trials."""
    if len(trials) > 1:
        middle = (len(trials) + 1) // 2
        return trials[:middle], trials[middle:]
    start, end = trials[0].time[[0, -1]]
    middle = 0.5 * (start + end)
    first, second = (
        segment(trials[0].trial, start, middle),
        segment(trials[0].trial, middle, end + 1.0),
    )
    return [prepare(first)], [prepare(second)]


def _identify(trials: list[PreparedTrial], method: Method, **options: Any) -> list[Estimate]:
    """One estimate for each trial; several trials are merged."""
    return (
        identify(trials, method, **options)
        if len(trials) > 1
        else [identify(trials[0], method, **options)]
    )


def _score(
    trials: list[PreparedTrial], estimates: list[Estimate], columns: Mapping[str, str]
) -> dict[str, float]:
    """VAFs against the measured torque: means over merged trials, or the VAF of a single trial with its interval."""
    pairs = zip(trials, estimates, strict=True)
    tables = [
        evaluate(*pair, against="measured", intervals=True).set_index("torque") for pair in pairs
    ]
    scores = {}
    for torque, column in columns.items():
        scores[column] = float(np.mean([table.loc[torque, "vaf"] for table in tables]))
        if len(tables) == 1:
            scores |= {
                f"{column}_{end}": float(tables[0].loc[torque, end]) for end in ("low", "high")
            }
    return scores


def _test_residual(
    trials: list[PreparedTrial], estimates: list[Estimate], instrumental: bool
) -> ResidualTest:
    """Test the residual of the longest trial.

    It is tested against the position, or unless the loop is open against what the reference explains of it.
    """
    trial, estimate = max(
        zip(trials, estimates, strict=True), key=lambda pair: pair[0].samples["time"].size
    )
    torque, time, delay = estimate.torque, estimate.torque["time"].values, estimate.reflex["delay"]
    residual, rate = (torque[MEASURED] - torque["net"]).values, torque.attrs["identification_rate"]
    if not instrumental:
        return residual_test(residual, trial.channel_at("position", time, rate), rate)
    regressors = trial.regressors(
        delay=delay, basis="rectifier", identification_rate=rate, reference="reference"
    )
    rows, common = match_times(regressors.time, time)
    return residual_test(residual[common], trial.predict_inputs(regressors)[rows, 0], rate)


def _describe_estimate(
    check: Check,
    trial: PreparedTrial,
    estimate: Estimate,
    test: ResidualTest,
    validity: Validity,
) -> dict[str, Any]:
    """Columns of the table about the estimate of the first trial."""
    warnings, diagnostics = estimate.fit_warnings, estimate.diagnostics
    # Where there is a warning, the covariance belongs to a solution that was not reached, or to another model.
    shown = replace(estimate, intervals={}) if warnings else estimate
    # Warnings about the data concern all methods alike, so they do not decide between them.
    about_data = diagnostics.get("data_warnings", ())
    cautions = validity.closed_caution if check.instrumental else validity.open_caution, *about_data
    return {
        **{
            f"residual_{name}": getattr(test, name)
            for name in ("white", "white_p", "related", "related_p")
        },
        **parameter_row(trial, shown),
        "warnings": " ".join(warnings),
        "trusted": not warnings,
        "caution": " ".join(filter(None, cautions)),
        # A test whether the joint changes takes what the model or an instrument leaves out for a change.
        "incomplete": bool(test.related or about_data or diagnostics.get("alternatives")),
    }


def _list_assumptions(
    trials: list[PreparedTrial], specification: Mapping[str, Any], estimate: Estimate
) -> str:
    """What the estimate of the first trial takes for granted, and what another delay or effect would do."""
    diagnostics = estimate.diagnostics
    texts = [*diagnostics.get("assumptions", ()), *diagnostics.get("missing", ())]
    takes_delay = "delay" in specification["method"].options.model_fields
    if takes_delay and "delay" not in estimate.intervals:
        options = specification["options"] | {"delay": estimate.reflex["delay"] + OTHER_DELAY}
        try:
            other = _identify(trials, specification["method"], **options)[0]
            shifts = compute_shifts(
                *({**part.stiffness, **part.reflex} for part in (estimate, other))
            )
            texts.append(
                f"A delay of {1000 * OTHER_DELAY:g} ms more would move {format_shifts(shifts)}."
            )
        except DataError as error:
            texts.append(
                f"What a delay of {1000 * OTHER_DELAY:g} ms more would do cannot be told: {error}"
            )
    for alternative in diagnostics.get("alternatives", ()):
        texts.append(
            f"With {alternative['effect']} in the model it would move {format_shifts(alternative['shifts'])}."
        )
    return " ".join(text[0].upper() + text[1:] for text in texts)


def compare_unseen(
    first: Sequence[xr.Dataset], second: Sequence[xr.Dataset]
) -> VafDifference | None:
    r"""Difference of the VAFs of two methods, with an interval that knows that both predict the same torque.

    With residuals e₁ and e₂ of the torque y, each less its mean, the difference is

    .. math:: d = 100 \, \frac{\sum e_2^2 - \sum e_1^2}{\sum y^2}, \qquad
              \psi_t = 100 \, \frac{e_{2,t}^2 - e_{1,t}^2}{\overline{y^2}} - d \, \frac{y_t^2}{\overline{y^2}}

    and the mean of ψ is asymptotically normal around zero. Its variance comes from means over blocks of two seconds,
    its interval from Student's distribution. What is hard to predict for both methods cancels in it. None
    if too little was scored at the same rate.
    """
    differences, weights, blocks = [], [], []
    for parts in zip(first, second, strict=True):
        a, b = xr.align(*parts, join="inner")
        rate, other_rate = (part.attrs["identification_rate"] for part in parts)
        count = round(a.sizes["time"] / (BLOCK * rate))
        if count and rate == other_rate:
            signals = (
                x.values for x in (a[MEASURED], a[MEASURED] - a["net"], b[MEASURED] - b["net"])
            )
            y, e_a, e_b = ((x - x.mean()) ** 2 for x in signals)
            difference = 100.0 * float(np.sum(e_b - e_a) / np.sum(y))
            influence = (100.0 * (e_b - e_a) - difference * y) / y.mean()
            blocks += [block.mean() for block in np.array_split(influence, count)]
            differences.append(difference)
            weights.append(count)
    if len(blocks) < FEWEST:
        return None
    mean = float(np.average(differences, weights=weights))
    # Differences of several trials scatter as well.
    scatter = np.repeat(np.array(differences) - mean, weights) + np.array(blocks)
    margin = special.stdtrit(len(blocks) - 1, 0.975) * np.sqrt(
        np.mean(scatter**2) / (len(blocks) - 1)
    )
    return VafDifference(mean, mean - float(margin), mean + float(margin))
