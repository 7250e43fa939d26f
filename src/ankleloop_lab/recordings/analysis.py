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
from ankleloop.joint.prepared import PreparedTrial, prepare, prepare_trials
from ankleloop.joint.regressors import MEASURED, TORQUES, split_torques
from ankleloop.joint.time_varying_course import Onsets, split_onsets
from ankleloop.methods.method import Method, Trial, Validity
from ankleloop.methods.registry import find_method, identify
from ankleloop.methods.riv.alternatives import compute_shifts, format_shifts
from ankleloop.methods.selection import check_selection
from ankleloop.signals.sampling import match_times
from ankleloop.trials.trial import segment
from ankleloop_lab.recordings.checks import Check, check_trial
from ankleloop_lab.recordings.validity import reason_against

BLOCK_LENGTH = 2.0  # s: longer than the squares of torques are correlated
FEWEST_BLOCKS = 5

Specification = Mapping[str, Any]  # of a method: its name, options, and options to select

METHOD_DEFAULTS: Specification = {"options": {}, "select": None, "criterion": None}
MORE_DELAY = 0.01  # s

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
    # By the label of the method the estimate of the whole recording; none if the recording was refused.
    estimates: dict[str, Estimate] = field(repr=False)
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
    # Values of the options that a refusal or the warnings of the methods ask for.
    remedy: dict[str, Any] = field(default_factory=dict, repr=False)


def analyse(trial: Trial | Sequence[Trial], methods: Mapping[str, Specification]) -> Analysis:
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
    trials = prepare_trials(trial)
    methods = {
        label: {**METHOD_DEFAULTS, **specification, "method": find_method(specification["method"])}
        for label, specification in methods.items()
    }
    for specification in methods.values():  # wrong options are refused before anything is fitted
        method = specification["method"]
        chosen = (specification[name] for name in METHOD_DEFAULTS)
        check_selection(f"method {method.name!r}", method.options, *chosen)
    check = check_trial(trials, **largest_options(methods))
    if check.verdict == "refused":
        return refused_analysis(check)
    analysis = Analysis(check, {}, {}, pd.DataFrame())
    rows = []
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
            estimate, unseen, scores = _fit(trials, check, specification)
            test = _test_residual(trials, estimate, check.instrumental)
            assumptions = _list_assumptions(trials, specification, estimate)
            described = _describe_estimate(check, trials, estimate, test, method.validity)
            row |= {**scores, **described, "assumptions": assumptions}
            analysis.estimates[label] = estimate
            analysis.residuals[label] = test
            analysis.remedy.update(estimate.diagnostics.get("remedy", {}))
            if unseen:
                analysis.unseen[label] = unseen
        except NUMERICAL_ERRORS as error:
            row |= {"valid": False, "trusted": False, "warnings": describe_failure(error)}
            analysis.remedy.update(getattr(error, "remedy", {}))
    return replace(analysis, table=pd.DataFrame(rows))


def mean_levels(trials: Sequence[PreparedTrial]) -> dict[str, float]:
    """Means of torque [N·m] and position [rad] over all samples: where a joint was held, its parameters depend on."""
    return {
        f"mean_{name}": float(np.mean(np.concatenate([trial.samples[name] for trial in trials])))
        for name in ("torque", "position")
    }


def describe_failure(error: Exception) -> str:
    """Why something could not be computed; what is no fault of the data goes to the log with its trace."""
    if isinstance(error, DataError):
        return str(error)
    log.warning("failed", exc_info=error)
    return f"it failed numerically ({type(error).__name__}: {error})."


def refused_analysis(check: Check) -> Analysis:
    """Analysis of a recording that its check refuses."""
    reasons = " ".join(check.reasons)
    row = {"verdict": "refused", "reasons": reasons, "valid": False, "trusted": False}
    return Analysis(check, {}, {}, pd.DataFrame([row]), remedy=check.remedy)


def largest_options(methods: Mapping[str, Specification]) -> dict[str, Any]:
    """Largest order and number of block rows that any method may use: the movement has to excite as much."""
    largest = {"order": 2, "block_rows": 15}
    for specification in methods.values():
        candidates = specification["select"] or {}
        for name, value in largest.items():
            fixed = specification["options"].get(name) or 0
            largest[name] = max(value, fixed, *candidates.get(name, ()))
    return largest


def _fit(
    trials: list[PreparedTrial], check: Check, specification: Specification
) -> tuple[Estimate, list[xr.Dataset], dict[str, Any]]:
    """Estimate of the whole, torques of one half that the fit to the other predicts, and the scores of both."""
    method = specification["method"]
    options = specification["options"]
    selection = {"select": specification["select"] or None, "criterion": specification["criterion"]}
    reason = reason_against(
        method,
        options,
        loop=check.loop,
        reference=check.reference,
        path_bias=check.path_bias,
        merged=len(trials) > 1,
    )
    if reason:
        raise DataError(reason)
    first, second = _split_halves(trials)
    first_onsets, second_onsets = _split_onsets(
        options.get("cycle_onsets"), len(trials), len(first)
    )
    first_options = options
    if first_onsets is not None:
        first_options = {**options, "cycle_onsets": first_onsets}
    scores: dict[str, Any] = {"vaf_unseen": np.nan, "selected": ""}
    unseen = []
    chosen: dict[str, Any] = {}
    try:
        half = _identify(first, method, **selection, **first_options)
        if selection["select"]:
            chosen = half.diagnostics["selection"]["chosen"]
        scores["selected"] = ", ".join(f"{name} {value}" for name, value in chosen.items())
        scores["unseen_warnings"] = " ".join(half.fit_warnings)
        if half.trajectories is not None and "time" in half.trajectories.sizes:
            raise DataError(
                "the parameters are functions of time, and were fitted before the times of the other half."
            )
        prediction = half.predict(second, cycle_onsets=second_onsets)
        scores |= _score(second, prediction, {"net": "vaf_unseen"})
        for torque in split_torques(prediction.torque):
            start, end = torque["time"][[0, -1]]
            unseen.append(torque.sel(time=slice(start + TRIM, end - TRIM)))
    except DataError as error:
        # Without a choice there are no options to fit the whole with.
        if selection["select"] and not chosen:
            raise
        scores["unseen_warnings"] = f"there is none: {error}"
    whole = _identify(trials, method, **options, **chosen)
    scores |= _score(trials, whole, {torque: f"vaf_{torque}" for torque in TORQUES})
    return whole, unseen, scores


def _split_halves(trials: list[PreparedTrial]) -> tuple[list[PreparedTrial], list[PreparedTrial]]:
    """Two halves of a trial, or of a list of trials."""
    if len(trials) > 1:
        middle = (len(trials) + 1) // 2
        return trials[:middle], trials[middle:]
    trial = trials[0].trial
    start, end = trials[0].time[[0, -1]]
    half = 0.5 * (start + end)
    return [prepare(segment(trial, start, half))], [prepare(segment(trial, half, end + 1.0))]


def _split_onsets(onsets: Onsets, count: int, first: int) -> tuple[Onsets, Onsets]:
    """Onsets of cycles of both halves of a list of trials; halves of a trial have those of the whole."""
    if onsets is None or isinstance(onsets, str) or count == 1:
        return onsets, onsets
    each = split_onsets(onsets, count)
    return each[:first], each[first:]


def _identify(trials: list[PreparedTrial], method: Method, **options: Any) -> Estimate:
    """Estimate of a trial, or of several that are merged."""
    return identify(trials if len(trials) > 1 else trials[0], method, **options)


def _score(
    trials: list[PreparedTrial], estimate: Estimate, columns: Mapping[str, str]
) -> dict[str, float]:
    """VAFs against the measured torque with their intervals."""
    table = evaluate(trials, estimate, against="measured", intervals=True).set_index("torque")
    scores: dict[str, float] = {}
    for torque, column in columns.items():
        vaf, low, high = map(float, table.loc[torque, ["vaf", "low", "high"]])
        scores |= {column: vaf, f"{column}_low": low, f"{column}_high": high}
    return scores


def _test_residual(
    trials: list[PreparedTrial], estimate: Estimate, instrumental: bool
) -> ResidualTest:
    """Test the residual of the longest trial.

    It is tested against the position, or unless the loop is open against what the reference explains of it.
    """
    longest = int(np.argmax([trial.time.size for trial in trials]))
    trial = trials[longest]
    torque = split_torques(estimate.torque)[longest]
    time = torque["time"].values
    rate = torque.attrs["identification_rate"]
    residual = (torque[MEASURED] - torque["net"]).values
    if not instrumental:
        return residual_test(residual, trial.channel_at("position", time, rate), rate)
    regressors = trial.regressors(
        delay=estimate.reflex.get("delay", 0.0),  # an apparatus has none
        basis="rectifier",
        identification_rate=rate,
        reference="reference",
    )
    rows, common = match_times(regressors.time, time)
    return residual_test(residual[common], trial.predict_inputs(regressors)[rows, 0], rate)


def _describe_estimate(
    check: Check,
    trials: list[PreparedTrial],
    estimate: Estimate,
    test: ResidualTest,
    validity: Validity,
) -> dict[str, Any]:
    """Columns of the table about an estimate."""
    warnings = estimate.fit_warnings
    diagnostics = estimate.diagnostics
    # Where there is a warning, the covariance belongs to a solution that was not reached, or to another model.
    shown = replace(estimate, intervals={}) if warnings else estimate
    # Warnings about the data concern all methods alike, so they do not decide between them.
    about_data = diagnostics.get("data_warnings", ())
    caution = validity.closed_caution if check.instrumental else validity.open_caution
    return {
        "residual_white": test.white,
        "residual_white_p": test.white_p,
        "residual_related": test.related,
        "residual_related_p": test.related_p,
        **parameter_row(trials, shown),
        **mean_levels(trials),
        "warnings": " ".join(warnings),
        "trusted": estimate.trusted,
        "remarks": " ".join(estimate.remarks),
        "caution": " ".join(filter(None, [caution, *about_data])),
        # A test whether the joint changes takes what the model or an instrument leaves out for a change.
        "incomplete": bool(test.related or about_data or estimate.alternatives),
    }


def _list_assumptions(
    trials: list[PreparedTrial], specification: Specification, estimate: Estimate
) -> str:
    """What an estimate takes for granted, and what another delay or effect would do."""
    diagnostics = estimate.diagnostics
    texts = [*diagnostics.get("assumptions", ()), *diagnostics.get("missing", ())]
    method = specification["method"]
    if "delay" in method.options.model_fields and "delay" not in estimate.intervals:
        options = specification["options"] | {"delay": estimate.reflex["delay"] + MORE_DELAY}
        change = f"a delay of {1000 * MORE_DELAY:g} ms more would"
        try:
            other = _identify(trials, method, **options)
            shifts = compute_shifts(estimate.values, other.values)
            texts.append(f"{change} move {format_shifts(shifts)}.")
        except DataError as error:
            texts.append(f"what {change} do cannot be told: {error}")
    for alternative in estimate.alternatives:
        moved = format_shifts(alternative["shifts"])
        texts.append(f"with {alternative['effect']} in the model it would move {moved}.")
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
    differences = []  # one for each block
    blocks = []
    for parts in zip(first, second, strict=True):
        own, other = xr.align(*parts, join="inner")
        rate, other_rate = (part.attrs["identification_rate"] for part in parts)
        count = round(own.sizes["time"] / (BLOCK_LENGTH * rate))
        if not count or rate != other_rate:
            continue
        torque = _square(own[MEASURED])
        gain = _square(other[MEASURED] - other["net"]) - _square(own[MEASURED] - own["net"])
        difference = 100.0 * float(np.sum(gain) / np.sum(torque))
        influence = (100.0 * gain - difference * torque) / torque.mean()
        blocks += [block.mean() for block in np.array_split(influence, count)]
        differences += [difference] * count
    freedom = len(blocks) - 1
    if len(blocks) < FEWEST_BLOCKS:
        return None
    mean = float(np.mean(differences))
    # Differences of several trials scatter as well.
    scatter = np.array(differences) - mean + np.array(blocks)
    error = np.sqrt(np.mean(scatter**2) / freedom)
    margin = float(special.stdtrit(freedom, 0.975) * error)
    return VafDifference(mean, mean - margin, mean + margin)


def _square(signal: xr.DataArray) -> np.ndarray:
    """Square of a signal less its mean."""
    values = signal.values
    return (values - values.mean()) ** 2
