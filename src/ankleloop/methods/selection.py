"""Choice of order, basis and other options on data that the fit has not seen."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Literal, NamedTuple

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.prepared import PreparedTrial, prepare
from ankleloop.joint.regressors import MEASURED, MOTION
from ankleloop.methods.method import NOMINAL_DELAY, Trial
from ankleloop.options import Options, check_argument, show_value
from ankleloop.signals.decimation import usual_rate
from ankleloop.signals.responses import lag_matrix
from ankleloop.signals.sampling import match_times
from ankleloop.trials.trial import segment

Criterion = Literal["instrumental", "cross-validation", None]
SETTLING = 1.0  # s at either end of a test part
SEGMENT = 2.0  # s over which losses are summed before their scatter is computed
# Instruments: leads and lags of the position that the reference explains, lags of splines of its delayed velocity.
POSITION_LAGS = 0.05  # s, either way
SPLINE_TERMS = 5
SPLINE_LAGS = 0.4  # s
SPLINE_LAG_STEP = 0.02  # s


class Instruments(NamedTuple):
    """Instruments at some times of a trial."""

    time: np.ndarray  # shape (N,)
    columns: np.ndarray  # shape (N, instruments)


class Half(NamedTuple):
    """A half of a record to fit to, and the other one to test on."""

    training: PreparedTrial
    test: PreparedTrial
    instruments: Instruments | None  # of the test; None without a reference


def select_options(
    trial: Trial,
    fit: Callable[..., Estimate],
    candidates: Mapping[str, Sequence[Any]],
    *,
    criterion: str | None = None,
    **options: Any,
) -> dict[str, Any]:
    r"""Choose options by the residual in the half of the record that was not fitted.

    "cross-validation" counts the whole residual: the score is the net VAF. In closed loop that rewards a model for
    explaining torque by the movement which that very torque has caused, so with a reference only that part of the
    residual ε is counted which the reference explains,

    .. math:: 100 \left(1 - \frac{\| \Pi_Z \varepsilon \|^2}{\| \Pi_Z TQ \|^2}\right),

    with Π the projection on instruments Z: leads and lags of the position that the reference explains, and of spline
    functions of its velocity. With the true parameters only noise remains there.

    Candidates are given from the simplest to the most complex. The first one is chosen whose loss is within one
    standard error of the best one's; the error is that of their difference, over segments of two seconds. A candidate
    whose fits come with a warning is chosen only if all of them do.

    Parameters
    ----------
    trial : xarray.Dataset or PreparedTrial
    fit : callable
        ``fit(trial, **options)``, such as a method, gives an `Estimate` that can predict.
    candidates : dict of str to sequence
        Values of each option; all combinations are tried, the last option varying fastest.
    criterion : {"instrumental", "cross-validation"}, optional
        "instrumental" by default if the trial has the reference, and it is not the position.
    **options
        Further options of all fits. Those of them that say how unseen data are scored have the same defaults as in the
        methods: `reference`, `delay` and `identification_rate` (of the instruments), and `cycle_onsets`.

    Returns
    -------
    dict
        "criterion"; "candidates", each with its options, its `scores` [%] on the data that it was not fitted to, by
        every criterion that the record allows, and the `warnings` of its fits, or the `error` where it could not be
        fitted; and the "chosen" options.

    Raises
    ------
    DataError
        If the halves of the record are too short, or no candidate can be fitted.

    Examples
    --------
    >>> from ankleloop.methods.registry import METHODS
    >>> from ankleloop.simulation.simulate import simulate
    >>> fit = METHODS["pr-moesp"]
    >>> trial = simulate(seed=1, snr_db=None, voluntary=0.0)
    >>> select_options(trial, fit, {"basis": ["rectifier"], "order": [1, 2]})["chosen"]
    {'basis': 'rectifier', 'order': 2}
    """
    prepared = prepare(trial)
    record = prepared.trial
    reference = options.get("reference", "reference")
    has_reference = reference in record and reference != "position"
    if criterion is None:
        criterion = "instrumental" if has_reference else "cross-validation"
    if criterion == "instrumental" and not has_reference:
        raise DataError(
            f"the instrumental criterion needs a reference, and there is no {reference!r}: use 'cross-validation'."
        )
    delay = options.get("delay")
    inputs = {
        "delay": NOMINAL_DELAY if delay is None else delay,
        "identification_rate": options.get("identification_rate", usual_rate(prepared.rate)),
        "reference": reference if has_reference else None,
    }
    halves = _halve(record, inputs)
    rows: list[dict[str, Any]] = []
    errors: list[Exception] = []
    # By the number of the candidate, of those that could be fitted.
    losses: dict[int, np.ndarray] = {}
    for number, values in enumerate(itertools.product(*candidates.values())):
        selected = dict(zip(candidates, values, strict=True))
        row = {**selected, "scores": {}, "warnings": []}
        rows.append(row)
        fit_selected = partial(fit, **options, **selected)
        try:
            by_criterion, warnings = _score(halves, fit_selected, options.get("cycle_onsets"))
        except (DataError, np.linalg.LinAlgError, ArithmeticError) as error:
            row["error"] = str(error)
            errors.append(error)
        else:
            for name, part in by_criterion.items():
                residual, torque = part.sum(axis=1)
                row["scores"][name] = float(100.0 * (1.0 - residual / torque))  # explained [%]
            row["warnings"] = warnings
            losses[number] = by_criterion[criterion][0]
    if not losses:
        raise DataError(
            f"no candidate could be fitted; the first one failed with: {errors[0]}",
            getattr(errors[0], "remedy", {}),
        )
    without_warning = {k: loss for k, loss in losses.items() if not rows[k]["warnings"]}
    comparable = without_warning or losses
    best = min(comparable.values(), key=np.sum)
    first = next(k for k, loss in comparable.items() if _is_as_good(loss, best))
    chosen = {name: rows[first][name] for name in candidates}
    return {"criterion": criterion, "candidates": rows, "chosen": chosen}


def _is_as_good(loss: np.ndarray, best: np.ndarray) -> bool:
    """Whether a loss is larger than the best one by at most one standard error of their difference."""
    excess = loss - best
    error = np.std(excess, ddof=1) * np.sqrt(excess.size)
    return bool(excess.sum() <= error)


def check_selection(
    owner: str,
    model: type[Options],
    options: Mapping[str, Any],
    select: Any,
    criterion: str | None = None,
) -> dict[str, list[Any]]:
    """Candidates by option; refuses what a method would refuse after other candidates were fitted."""
    select = {} if select is None else select
    check_argument(Criterion, owner, "criterion", criterion)
    kinds = (list, tuple, range, np.ndarray)
    is_listed = isinstance(select, Mapping) and all(
        isinstance(part, kinds) and len(part) for part in select.values()
    )
    if not is_listed or (criterion is not None and not select) or "identification_rate" in select:
        raise ValueError(
            "select must be a dict of options, each with a list of at least one value, and not of identification_rate "
            f"(residuals at different rates contain different bands of noise), got {show_value(select)}."
        )
    both = sorted(set(options) & set(select))
    if both:
        raise TypeError(
            f"option {both[0]!r} is given, and to be selected as well: choose one of the two."
        )
    place = f"select: {owner}" if select else owner
    for combination in itertools.product(*select.values()):
        selected = dict(zip(select, combination, strict=True))
        model.parse(place, **options, **selected)
    return {name: list(values) for name, values in select.items()}


def _halve(record: xr.Dataset, inputs: Mapping[str, Any]) -> list[Half]:
    """Each half of a record to test on, and the other one to fit to."""
    time = record["time"].values
    end = time[-1] + 1.0 / float(record.attrs["sampling_rate"])
    duration = end - time[0]
    least = 2.0 * (2.0 * SETTLING + SEGMENT)
    if duration < least:
        raise DataError(
            f"the record of {duration:.3g} s is too short: a selection needs {least:g} s. Record longer."
        )
    edges = np.linspace(time[0], end, 3)
    first, second = (prepare(segment(record, low, high)) for low, high in itertools.pairwise(edges))
    halves = []
    for training, test in ((second, first), (first, second)):
        instruments = None if inputs["reference"] is None else _instruments(test, inputs)
        halves.append(Half(training, test, instruments))
    return halves


def _instruments(test: PreparedTrial, inputs: Mapping[str, Any]) -> Instruments:
    """Leads and lags of the position that the reference explains, and of splines of its velocity."""
    regressors = test.regressors(**inputs, basis="spline", degree=SPLINE_TERMS)
    predicted = test.predict_inputs(regressors)
    rate = regressors.rate
    leads = round(POSITION_LAGS * rate)
    longest = round(SPLINE_LAGS * rate)
    step = max(1, round(SPLINE_LAG_STEP * rate))
    # Both have the rows of the samples with `leads` before the end and `longest` after the start.
    position = lag_matrix(predicted[longest - leads :, 0], leads, leads)
    splines = [
        lag_matrix(term, 0, longest)[: len(position), ::step] for term in predicted[:, MOTION:].T
    ]
    time = regressors.time[longest : longest + len(position)]
    return Instruments(time, np.hstack([position, *splines]))


def _project(instruments: Instruments, time: np.ndarray, signals: np.ndarray) -> np.ndarray:
    """Projection of signals on instruments, at the times that both have."""
    rows, common = match_times(instruments.time, time)
    columns = instruments.columns[rows]
    basis = np.linalg.qr(columns - columns.mean(axis=0))[0]
    projection = np.zeros_like(signals)
    projection[:, common] = (signals[:, common] @ basis) @ basis.T
    return projection


def _score(
    halves: Sequence[Half],
    fit: Callable[[PreparedTrial], Estimate],
    cycle_onsets: str | Sequence[float] | None,
) -> tuple[dict[str, np.ndarray], list[str]]:
    """Losses of all tests by criterion, and warnings of the fits.

    Shapes: returns (2, segments): squares of the residual and of the torque, summed over segments.
    """
    tests = []
    warnings: list[str] = []
    for half in halves:
        estimate = fit(half.training)
        if estimate.trajectories is not None and "time" in estimate.trajectories.sizes:
            raise DataError(
                "its parameters change with time, and those of one half are not those of the other: set the options."
            )
        warnings += estimate.fit_warnings  # those about the data concern all candidates alike
        torque = estimate.predict(half.test, cycle_onsets=cycle_onsets).torque
        tests.append(_test(torque, half))
    losses = {name: np.hstack([test[name] for test in tests]) for name in tests[0]}
    return losses, list(dict.fromkeys(warnings))


def _test(torque: xr.Dataset, half: Half) -> dict[str, np.ndarray]:
    """Losses of predicted torques in a half by every criterion that it allows, shape (2, segments)."""
    time = torque["time"].values
    is_scored = (time >= time[0] + SETTLING) & (time <= time[-1] - SETTLING)
    time = time[is_scored]
    signals = np.stack([torque[MEASURED] - torque["net"], torque[MEASURED]])[:, is_scored]
    signals -= signals.mean(axis=1, keepdims=True)
    explainable = {"cross-validation": signals}
    if half.instruments is not None:
        explainable["instrumental"] = _project(half.instruments, time, signals)
    # Segments are counted from the start of the half, so that all candidates have the same.
    start, stop = half.test.time[[0, -1]]
    segments = ((time - start) / SEGMENT).astype(int)
    count = int((stop - start) / SEGMENT) + 1
    return {
        name: np.array([np.bincount(segments, signal**2, count) for signal in pair])
        for name, pair in explainable.items()
    }
