"""Choice of order, basis and other options on data that the fit has not seen."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.prepared import PreparedTrial, prepare
from ankleloop.methods.method import NOMINAL_DELAY, Trial
from ankleloop.options import Options, check_choice, show_value
from ankleloop.signals.sampling import match_times
from ankleloop.trials.trial import segment

CRITERIA = ("instrumental", "cross-validation")
SETTLING = 1.0  # s at either end of a test part
SEGMENT = 2.0  # s over which losses are summed before their scatter is computed
TERMS = 5  # spline terms of the delayed velocity among the instruments
LAGS = 0.4  # s of these terms
STEP = 0.02  # s between lags
LEADS = 0.05  # s of the position, either way


# A half of a record to fit to, the other one to test on, and times of the latter with instruments at them.
Half = tuple[PreparedTrial, PreparedTrial, tuple[np.ndarray, np.ndarray] | None]


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
    record, reference = prepare(trial).trial, options.get("reference", "reference")
    has_reference = reference in record and reference != "position"
    criterion = criterion or ("instrumental" if has_reference else "cross-validation")
    if criterion == "instrumental" and not has_reference:
        raise DataError(
            f"the instrumental criterion needs a reference, and there is no {reference!r}: use 'cross-validation'."
        )
    delay, rate = options.get("delay"), options.get("identification_rate", 100.0)
    inputs = {"delay": NOMINAL_DELAY if delay is None else delay, "identification_rate": rate}
    halves = _halve(record, reference if has_reference else None, inputs)
    rows: list[dict[str, Any]] = []
    losses: dict[
        int, np.ndarray
    ] = {}  # by the number of the candidate, of those that could be fitted
    for number, values in enumerate(itertools.product(*candidates.values())):
        selected = dict(zip(candidates, values, strict=True))
        rows.append({**selected, "scores": {}, "warnings": []})
        bound = partial(fit, **options, **selected)
        try:
            sums, rows[-1]["warnings"] = _score(halves, bound, options.get("cycle_onsets"))
            rows[-1]["scores"] = {
                name: float(100.0 * (1.0 - r.sum() / y.sum())) for name, (r, y) in sums.items()
            }
            losses[number] = sums[criterion][0]
        except (DataError, np.linalg.LinAlgError, ArithmeticError) as error:
            rows[-1]["error"] = str(error)
    if not losses:
        raise DataError(
            f"no candidate could be fitted; the first one failed with: {rows[0]['error']}"
        )
    losses = {k: loss for k, loss in losses.items() if not rows[k]["warnings"]} or losses
    best = min(losses.values(), key=np.sum)
    excesses = {k: loss - best for k, loss in losses.items()}
    # The first one that is not worse than the best by more than one standard error.
    number = next(
        k for k, part in excesses.items() if part.sum() <= np.std(part, ddof=1) * np.sqrt(part.size)
    )
    chosen = {name: rows[number][name] for name in candidates}
    return {"criterion": criterion, "candidates": rows, "chosen": chosen}


def check_selection(
    owner: str,
    model: type[Options],
    options: Mapping[str, Any],
    select: Any,
    criterion: str | None = None,
) -> dict[str, list[Any]]:
    """Candidates by option; refuses what a method would refuse after other candidates were fitted."""
    select = {} if select is None else select
    check_choice(owner, "criterion", criterion, (*CRITERIA, None))
    kinds = (list, tuple, range, np.ndarray)
    listed = isinstance(select, Mapping) and all(
        isinstance(part, kinds) and len(part) for part in select.values()
    )
    if not listed or (criterion is not None and not select) or "identification_rate" in select:
        raise ValueError(
            "select must be a dict of options, each with a list of at least one value, and not of identification_rate "
            f"(residuals at different rates contain different bands of noise), got {show_value(select)}."
        )
    if both := sorted(set(options) & set(select)):
        raise TypeError(
            f"option {both[0]!r} is given, and to be selected as well: choose one of the two."
        )
    for combination in itertools.product(*select.values()):
        model.parse(
            f"select: {owner}" if select else owner,
            **options,
            **dict(zip(select, combination, strict=True)),
        )
    return {name: list(values) for name, values in select.items()}


def _halve(record: xr.Dataset, reference: str | None, inputs: Mapping[str, Any]) -> list[Half]:
    time, rate = record["time"].values, float(record.attrs["sampling_rate"])
    edges = np.linspace(time[0], time[-1] + 1.0 / rate, 3)
    duration, least = edges[2] - edges[0], 2.0 * (2.0 * SETTLING + SEGMENT)
    if duration < least:
        raise DataError(
            f"the record of {duration:.3g} s is too short: a selection needs {least:g} s. Record longer."
        )
    halves = [prepare(segment(record, low, high)) for low, high in itertools.pairwise(edges)]
    pairs = zip(halves[::-1], halves, strict=True)
    return [
        (fit, test, None if reference is None else _instruments(test, reference, inputs))
        for fit, test in pairs
    ]


def _instruments(
    test: PreparedTrial, reference: str, inputs: Mapping[str, Any]
) -> tuple[np.ndarray, np.ndarray]:
    """Times, and instruments at these times: leads and lags of the position that the reference explains."""
    regressors = test.regressors(**inputs, basis="spline", degree=TERMS, reference=reference)
    predicted, rate = test.predict_inputs(regressors), regressors.rate
    leads = round(LEADS * rate)
    # Shifts are circular; samples that wrap around lie at the ends, which are not scored.
    columns = [np.roll(predicted[:, 0], shift) for shift in range(-leads, leads + 1)]
    for lag in range(0, round(LAGS * rate) + 1, max(1, round(STEP * rate))):
        columns += [np.roll(term, lag) for term in predicted[:, 3:].T]
    return regressors.time, np.column_stack(columns)


def _project(
    instruments: tuple[np.ndarray, np.ndarray], time: np.ndarray, signals: np.ndarray
) -> np.ndarray:
    """Projection of signals on instruments, at the times that both have."""
    rows, common = match_times(instruments[0], time)
    columns = instruments[1][rows]
    basis = np.linalg.qr(columns - columns.mean(axis=0))[0]
    projection = np.zeros_like(signals)
    projection[:, common] = (signals[:, common] @ basis) @ basis.T
    return projection


def _score(
    halves: Sequence[Half],
    fit: Callable[[PreparedTrial], Estimate],
    cycle_onsets: str | Sequence[float] | None,
) -> tuple[dict[str, np.ndarray], list[str]]:
    """By criterion, squares of residual and torque, summed over segments, shape (2, segments); warnings of the fits."""
    sums: dict[str, list[list[np.ndarray]]] = {}
    warnings: list[str] = []
    for training, test, instruments in halves:
        estimate = fit(training)
        if estimate.trajectories is not None and "time" in estimate.trajectories.sizes:
            raise DataError(
                "its parameters change with time, and those of one half are not those of the other: set the options."
            )
        warnings += estimate.fit_warnings  # those about the data concern all candidates alike
        torque = estimate.predict(test, cycle_onsets=cycle_onsets).torque
        time = torque["time"].values
        scored = (time >= time[0] + SETTLING) & (time <= time[-1] - SETTLING)
        signals = np.stack([torque["measured"] - torque["net"], torque["measured"]])[:, scored]
        if not np.isfinite(signals).all():
            raise DataError("the prediction of unseen data is not finite.")
        signals -= signals.mean(axis=1, keepdims=True)
        explainable = {"cross-validation": signals}
        if instruments is not None:
            explainable["instrumental"] = _project(instruments, time[scored], signals)
        # Counted from the start of the half, so that all candidates have the same segments.
        start, stop = test.time[[0, -1]]
        segments = ((time[scored] - start) / SEGMENT).astype(int)
        count = int((stop - start) / SEGMENT) + 1
        for name, pair in explainable.items():
            sums.setdefault(name, []).append(
                [np.bincount(segments, signal**2, count) for signal in pair]
            )
    return {name: np.hstack(parts) for name, parts in sums.items()}, list(dict.fromkeys(warnings))
