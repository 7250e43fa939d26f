"""One recording from check to decision: what it can carry, every valid method, and what to trust."""

from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from ankleloop.checks import Check, check_trial
from ankleloop.errors import DataError
from ankleloop.evaluation import evaluate, parameters
from ankleloop.registry import identify
from ankleloop.regressors import build_regressors, decimated, predicted_inputs
from ankleloop.residuals import residual_test
from ankleloop.trial import segment

__all__ = ["Analysis", "analyse"]


@dataclass(frozen=True)
class Analysis:
    """What was found in one recording.

    Parameters
    ----------
    check : Check
        What the recording can carry.
    estimates : dict of str to Estimate
        Estimates of the whole recording, by the label of the method; none if it was refused.
    residuals : dict of str to ResidualTest
        Tests of what they leave.
    table : pandas.DataFrame
        One row for each method: whether it is valid here, cross-validated and fitted VAF [%] with intervals, parameters
        with intervals, tests of the residual, warnings; one row without a method if the recording was refused.
    """

    check: Check
    estimates: dict = field(repr=False)
    residuals: dict = field(repr=False)
    table: pd.DataFrame = field(repr=False)


def analyse(trial, methods, *, reference="reference"):
    """Check a recording, and fit every method that is valid for it.

    Each method is fitted to the first half and judged on the second; options to be selected are selected within the
    first half. Then it is fitted to the whole with the same options. The residual is tested within the pass band, for
    whiteness and for correlation with the position, or in closed loop with the position that the reference explains.

    Parameters
    ----------
    trial : xarray.Dataset
        The recording.
    methods : dict of str to dict
        For each label the `method`, its `options`, and options to `select` by a `criterion`.
    reference : str
        Variable that serves as reference.

    Returns
    -------
    Analysis

    Examples
    --------
    >>> from ankleloop.simulation import simulate
    >>> found = analyse(simulate(seed=1), {"riv": {"method": "riv"}, "PI-MOESP": {"method": "pi-moesp"}})
    >>> found.table[["label", "valid"]].values.tolist()
    [['riv', True], ['PI-MOESP', False]]
    """
    check = check_trial(trial, reference=reference)
    if check.verdict == "refused":
        return Analysis(check, {}, {}, pd.DataFrame([{"verdict": "refused", "reasons": " ".join(check.reasons)}]))
    estimates, residuals, rows = {}, {}, []
    for label, given in methods.items():
        row = {"verdict": check.verdict, "loop": check.loop, "label": label, "method": given["method"]}
        why_not = _not_valid(check, given)
        if why_not is None:
            try:
                estimates[label], scores = _fitted(trial, given)
                residuals[label] = _tested(trial, estimates[label], check.loop, reference)
                row |= {"valid": True, **scores, **_told(residuals[label])}
                row |= parameters(trial, estimates[label]).iloc[0].to_dict()
            except DataError as error:
                why_not = str(error)
        rows.append(row if why_not is None else row | {"valid": False, "warnings": why_not})
    return Analysis(check, estimates, residuals, pd.DataFrame(rows))


def _not_valid(check, given):
    """Why a method is not valid for this recording; None if it is."""
    method, options = given["method"], given.get("options", {})
    if method not in check.methods:
        return f"not valid in a loop that is {check.loop}"
    needs = check.methods[method]
    if check.loop == "undecided" and needs.get("reference") == "position" and options.get("reference") != "position":
        return "needs a reference: with reference='position' it is valid if the loop is open"
    if "input_matrices" in needs and options.get("input_matrices") != needs["input_matrices"]:
        return "least squares for B and D is biased in closed loop: input_matrices='instruments'"
    if check.loop == "closed" and options.get("reference") == "position":
        return "the position is no reference in closed loop"
    return None


def _fitted(trial, given):
    """Estimate of the whole, and VAFs of the half that was fitted, of the other one, and of the whole."""
    time, rate = trial["time"].values, float(trial.attrs["sampling_rate"])
    middle, end = 0.5 * (time[0] + time[-1]), time[-1] + 1.0 / rate
    first, second = segment(trial, time[0], middle), segment(trial, middle, end)
    method, options, select = given["method"], given.get("options", {}), given.get("select") or None
    half = identify(first, method, select=select, criterion=given.get("criterion"), **options)
    chosen = half.diagnostics["selection"]["chosen"] if select else {}
    whole = identify(trial, method, **options, **chosen)
    scores = {"selected": ", ".join(f"{name} {value}" for name, value in chosen.items())}
    try:
        unseen = evaluate(second, half.predict(second), against="measured", intervals=True).iloc[0]
        scores |= {"vaf_unseen": unseen["vaf"], "vaf_unseen_low": unseen["low"], "vaf_unseen_high": unseen["high"]}
    except DataError as error:
        scores |= {"vaf_unseen": np.nan, "unseen_error": str(error)}
    for row in evaluate(trial, whole, against="measured", intervals=True).itertuples():
        scores |= {f"vaf_{row.torque}": row.vaf, f"vaf_{row.torque}_low": row.low, f"vaf_{row.torque}_high": row.high}
    return whole, scores


def _tested(trial, estimate, loop, reference):
    """Test of the residual: against the position, or in closed loop what the reference explains of it."""
    time, rate = estimate.torque["time"].values, estimate.torque.attrs["identification_rate"]
    residual = decimated(trial, "torque", time, rate) - estimate.torque["net"].values
    if loop != "closed":
        return residual_test(residual, decimated(trial, "position", time, rate), rate)
    delay = estimate.reflex["delay"]
    regressors = build_regressors(trial, delay=delay, basis="rectifier", identification_rate=rate, reference=reference)
    explained = predicted_inputs(trial, regressors, delay)[:, 0]
    rows = np.searchsorted(regressors.time, time - 1e-6)
    inside = rows < regressors.time.size
    return residual_test(residual[inside], explained[rows[inside]], rate)


def _told(test):
    return {
        "residual_white": test.white,
        "residual_white_p": test.white_p,
        "residual_related": test.related,
        "residual_related_p": test.related_p,
    }
