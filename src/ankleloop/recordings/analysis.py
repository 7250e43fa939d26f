"""One recording from check to decision: what it can carry, every valid method, and what to trust."""

from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from ankleloop.assessment.residuals import residual_test
from ankleloop.assessment.scores import evaluate, parameters
from ankleloop.errors import DataError
from ankleloop.joint.estimate import TORQUES
from ankleloop.joint.regressors import build_regressors, decimated, predicted_inputs
from ankleloop.methods.registry import identify
from ankleloop.recordings.checks import Check, check_batch, check_trial
from ankleloop.records.trial import segment

__all__ = ["Analysis", "analyse"]


@dataclass(frozen=True)
class Analysis:
    """What was found in one recording.

    Parameters
    ----------
    check : Check
        What the recording can carry.
    records : dict of str to list of Estimate
        By the label of the method the estimates of the whole recording, one for each trial that was merged; none if it
        was refused.
    residuals : dict of str to ResidualTest
        Tests of what they leave of the longest trial.
    table : pandas.DataFrame
        One row for each method: whether it is valid here, cross-validated and fitted VAF [%] with intervals, parameters
        with intervals, tests of the residual, warnings; one row without a method if the recording was refused.
    """

    check: Check
    records: dict = field(repr=False)
    residuals: dict = field(repr=False)
    table: pd.DataFrame = field(repr=False)

    @property
    def estimates(self):
        """Estimate of the first trial by the label of the method."""
        return {label: estimates[0] for label, estimates in self.records.items()}


def analyse(trial, methods, *, reference="reference"):
    """Check a recording, and fit every method that is valid for it.

    Each method is fitted to the first half and judged on the second; options to be selected are selected within the
    first half. Then it is fitted to the whole with the same options. The residual is tested within the pass band, for
    whiteness and for correlation with the position, or in closed loop with the position that the reference explains.

    Parameters
    ----------
    trial : xarray.Dataset, or list of those
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
    >>> from ankleloop.simulation import simulate
    >>> found = analyse(simulate(seed=1), {"riv": {"method": "riv"}, "PI-MOESP": {"method": "pi-moesp"}})
    >>> found.table[["label", "valid"]].values.tolist()
    [['riv', True], ['PI-MOESP', False]]
    """
    several = isinstance(trial, (list, tuple)) and len(trial) > 1
    trials = list(trial) if isinstance(trial, (list, tuple)) else [trial]
    asked = {"reference": reference, **_largest(methods)}
    check = check_batch(trials, **asked) if several else check_trial(trials[0], **asked)
    if check.verdict == "refused":
        return Analysis(check, {}, {}, pd.DataFrame([{"verdict": "refused", "reasons": " ".join(check.reasons)}]))
    longest = int(np.argmax([one.sizes["time"] for one in trials]))
    records, residuals, rows = {}, {}, []
    for label, given in methods.items():
        row = {"verdict": check.verdict, "loop": check.loop, "label": label, "method": given["method"]}
        why_not = _not_valid(check, given, several)
        if why_not is None:
            try:
                found, scores = _fitted(trials, given)
                test = _tested(trials[longest], found[longest], check.loop, reference)
                row |= {"valid": True, **scores, **_told(test), **parameters(trials[0], found[0]).iloc[0].to_dict()}
                records[label], residuals[label] = found, test
            except DataError as error:
                why_not = str(error)
        rows.append(row if why_not is None else row | {"valid": False, "warnings": why_not})
    return Analysis(check, records, residuals, pd.DataFrame(rows))


def _largest(methods):
    """Largest order and number of block rows that any method may take: the movement has to excite as much."""
    found = {"order": [2], "block_rows": [15]}
    for given in methods.values():
        for name, values in found.items():
            asked = [given.get("options", {}).get(name), *(given.get("select") or {}).get(name, ())]
            values += [value for value in asked if value is not None]
    return {name: max(values) for name, values in found.items()}


def _not_valid(check, given, several):
    """Why a method is not valid for this recording; None if it is."""
    method, options = given["method"], given.get("options", {})
    if several and not method.endswith("moesp"):
        return "identifies one trial at a time: it does not merge them"
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


def _fitted(trials, given):
    """Estimates of the whole, and VAFs of the whole and of the half that was not fitted."""
    method, options, select = given["method"], given.get("options", {}), given.get("select") or None
    first, second = _halves(trials)
    half = _identified(first, method, select=select, criterion=given.get("criterion"), **options)
    chosen = half[0].diagnostics["selection"]["chosen"] if select else {}
    whole = _identified(trials, method, **options, **chosen)
    scores = {"selected": ", ".join(f"{name} {value}" for name, value in chosen.items())}
    try:
        scores |= _scores([(one, half[0].predict(one)) for one in second], {"net": "vaf_unseen"})
    except DataError as error:
        scores |= {"vaf_unseen": np.nan, "unseen_error": str(error)}
    names = {torque: f"vaf_{torque}" for torque in TORQUES}
    return whole, scores | _scores(list(zip(trials, whole, strict=True)), names)


def _halves(trials):
    """Two halves of a trial, or of a list of them."""
    if len(trials) > 1:
        return trials[: (len(trials) + 1) // 2], trials[(len(trials) + 1) // 2 :]
    time, rate = trials[0]["time"].values, float(trials[0].attrs["sampling_rate"])
    middle = 0.5 * (time[0] + time[-1])
    return [segment(trials[0], time[0], middle)], [segment(trials[0], middle, time[-1] + 1.0 / rate)]


def _identified(trials, method, **options):
    """A list of estimates, whether trials are merged or not."""
    return identify(trials, method, **options) if len(trials) > 1 else [identify(trials[0], method, **options)]


def _scores(pairs, names):
    """VAFs against the measured torque; means over trials that were merged, intervals of a single one."""
    tables = [
        evaluate(trial, estimate, against="measured", intervals=True).set_index("torque") for trial, estimate in pairs
    ]
    scores = {}
    for torque, name in names.items():
        scores[name] = float(np.mean([table.loc[torque, "vaf"] for table in tables]))
        if len(tables) == 1:
            scores |= {f"{name}_{end}": float(tables[0].loc[torque, end]) for end in ("low", "high")}
    return scores


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
