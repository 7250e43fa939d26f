"""Choice of order, basis and other options on data that the fit has not seen."""

import itertools
from dataclasses import dataclass

import numpy as np

from ankleloop.errors import DataError
from ankleloop.joint.regressors import build_regressors, decimated, predicted_inputs
from ankleloop.records.trial import segment

__all__ = ["CRITERIA", "Selection", "select_options"]

CRITERIA = ("instrumental", "cross-validation")
SETTLING = 1.0  # s at either end of the judged part
BLOCK = 2.0  # s over which losses are summed before their scatter is judged
TERMS = 5  # spline terms of the delayed velocity among the instruments
LAGS = 0.4  # s of them
STEP = 0.02  # s between lags
LEADS = 0.05  # s of the position, either way


@dataclass(frozen=True)
class Selection:
    """What was tried, and what was chosen.

    Parameters
    ----------
    criterion : {"instrumental", "cross-validation"}
        How candidates were judged.
    candidates : list of dict
        Options of each candidate and its `scores` [%] on the data that it was not fitted to, by every criterion that
        the record allows; or the `error` where it could not be fitted.
    chosen : dict
        Options of the chosen one.
    """

    criterion: str
    candidates: list
    chosen: dict

    @property
    def diagnostics(self):
        """The choice and its curve."""
        return {"criterion": self.criterion, "candidates": self.candidates, "chosen": self.chosen}


def select_options(
    trial,
    fit,
    candidates,
    *,
    criterion=None,
    reference="reference",
    delay=0.04,
    identification_rate=100.0,
    folds=2,
):
    r"""Choose options by what is left unexplained in parts of the record that were not fitted.

    Each fold is predicted by the fit to the others. "cross-validation" counts the whole residual: the score is the net
    VAF. In closed loop that rewards a model for explaining torque by the movement which that very torque has caused, so
    with a reference only that part of the residual ε is counted which the reference explains,

    .. math:: 100 \left(1 - \frac{\| \Pi_Z \varepsilon \|^2}{\| \Pi_Z TQ \|^2}\right),

    with Π the projection on instruments Z: leads and lags of the position that the reference explains, and of spline
    functions of its velocity. The true parameters leave nothing there but noise.

    Candidates are given from the simplest to the most complex. The first one is chosen whose loss is within one
    standard error of the best one's; the error is that of their difference, over blocks of two seconds.

    Parameters
    ----------
    trial : xarray.Dataset
        The trial.
    fit : callable
        ``fit(trial, **options)`` gives an `Estimate` that can predict.
    candidates : dict of str to sequence
        Values of each option; all combinations are tried, the last option varying fastest.
    criterion : {"instrumental", "cross-validation"}, optional
        "instrumental" by default if the trial has the reference, and it is not the position.
    reference : str
        Variable that serves as reference.
    delay : float or None
        Reflex delay for the instruments [s]; None for 40 ms.
    identification_rate : float
        Rate of the identification [Hz].
    folds : int
        Parts of the record.

    Returns
    -------
    Selection

    Raises
    ------
    DataError
        If no candidate can be fitted.
    ValueError
        For an unknown criterion, no candidates, or fewer than two folds.

    Examples
    --------
    >>> from functools import partial
    >>> from ankleloop.methods.moesp import identify_moesp
    >>> from ankleloop.simulation import simulate
    >>> fit = partial(identify_moesp, method="pr-moesp")
    >>> trial = simulate(seed=1, snr_db=None, voluntary=0.0)
    >>> select_options(trial, fit, {"basis": ["rectifier"], "order": [1, 2]}).chosen
    {'basis': 'rectifier', 'order': 2}
    """
    usable = reference in trial and reference != "position"
    criterion = criterion or ("instrumental" if usable else "cross-validation")
    if criterion not in CRITERIA:
        raise ValueError(f"unknown criterion {criterion!r}; known: {', '.join(CRITERIA)}.")
    if folds < 2 or not candidates or not all(len(values) for values in candidates.values()):
        raise ValueError("give at least two folds, and at least one value of each option to choose from.")
    parts = _parts(trial, folds)
    if criterion == "instrumental" and not usable:
        raise DataError(
            f"the instrumental criterion needs a reference, and the trial has no {reference!r} beside its position: "
            "use criterion='cross-validation'."
        )
    instruments = [
        _instruments(judged, reference, 0.04 if delay is None else delay, identification_rate) if usable else None
        for _, judged in parts
    ]
    tried, losses = [], []
    for values in itertools.product(*candidates.values()):
        options = dict(zip(candidates, values, strict=True))
        try:
            found = _losses(parts, instruments, fit, options)
        except DataError as error:
            tried.append({**options, "scores": {}, "error": str(error)})
            losses.append(None)
            continue
        scores = {name: float(100.0 * (1.0 - loss.sum() / total)) for name, (loss, total) in found.items()}
        tried.append({**options, "scores": scores})
        losses.append(found[criterion][0])
    return Selection(criterion, tried, {name: tried[_simplest(losses, tried)][name] for name in candidates})


def _parts(trial, folds):
    """For each fold the stretches to fit to, and the stretch to judge on."""
    time, rate = trial["time"].values, float(trial.attrs["sampling_rate"])
    edges = np.linspace(time[0], time[-1] + 1.0 / rate, folds + 1)
    stretches = [segment(trial, low, high) for low, high in itertools.pairwise(edges)]
    return [([other for other in stretches if other is not judged], judged) for judged in stretches]


def _instruments(trial, reference, delay, rate):
    """Times, and instruments at these times: leads and lags of what the reference explains."""
    regressors = build_regressors(
        trial, delay=delay, basis="spline", degree=TERMS, identification_rate=rate, reference=reference
    )
    inputs = predicted_inputs(trial, regressors, delay)
    ahead = round(LEADS * rate)
    # What a shift wraps round lies at the ends, which are not judged.
    columns = [np.roll(inputs[:, 0], shift) for shift in range(-ahead, ahead + 1)]
    for lag in range(0, round(LAGS * rate) + 1, max(1, round(STEP * rate))):
        columns += [np.roll(term, lag) for term in inputs[:, 3:].T]
    return regressors.time, np.column_stack(columns)


def _projected(grid, instruments, time, signals):
    """Projection on the instruments, at the times that both have."""
    rows = np.searchsorted(grid, time - 1e-6)
    inside = rows < grid.size
    basis = np.linalg.qr(instruments[rows[inside]] - instruments[rows[inside]].mean(axis=0))[0]
    kept = np.zeros_like(signals)
    kept[:, inside] = (signals[:, inside] @ basis) @ basis.T
    return kept


def _losses(parts, instruments, fit, options):
    """By criterion the losses of a candidate in blocks of time, and what there was to explain."""
    found = {}
    for (fitted, judged), tools in zip(parts, instruments, strict=True):
        for stretch in fitted:
            torque = fit(stretch, **options).predict(judged).torque
            time, rate = torque["time"].values, torque.attrs["identification_rate"]
            inside = (time >= time[0] + SETTLING) & (time <= time[-1] - SETTLING)
            measured = decimated(judged, "torque", time, rate)
            signals = np.stack([measured - torque["net"].values, measured])[:, inside]
            signals -= signals.mean(axis=1, keepdims=True)
            parts_seen = {"cross-validation": signals}
            if tools is not None:
                parts_seen["instrumental"] = _projected(*tools, time[inside], signals)
            blocks = np.arange(0, inside.sum(), round(BLOCK * rate))
            for name, (left, whole) in parts_seen.items():
                losses, total = found.get(name, (np.empty(0), 0.0))
                losses = np.concatenate([losses, np.add.reduceat(left**2, blocks)])
                found[name] = losses, total + float(np.sum(whole**2))
    return found


def _simplest(losses, tried):
    """The first candidate that is not worse than the best by more than one standard error."""
    fitted = [k for k, loss in enumerate(losses) if loss is not None]
    if not fitted:
        raise DataError(f"no candidate could be fitted; the first one failed with: {tried[0]['error']}")
    best = losses[min(fitted, key=lambda k: losses[k].sum())]
    for k in fitted:
        worse = losses[k] - best
        if worse.sum() <= np.std(worse, ddof=1) * np.sqrt(worse.size):
            return k
    raise AssertionError("the best candidate is within its own error")
