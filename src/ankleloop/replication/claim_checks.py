"""How each claim of the paper is checked: a comparison of results, and its reason in a sentence."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from ankleloop.replication.evidence import Evidence, Mean, MissingEvidence, StudyResults

__all__ = ["CLAIM_CHECKS", "CheckResult", "Claim", "check_table_number"]

ONE_PASS, CONVERGED = "parallel-cascade-one-pass", "parallel-cascade"
OPEN_LOOP_METHODS = ("pi-moesp", "po-moesp", CONVERGED, "real-time")
TOO_WIDE = "the 95 % interval is too wide to tell"

Claim = Mapping[str, Any]


@dataclass(frozen=True)
class CheckResult:
    """Result of a check.

    Parameters
    ----------
    holds : bool or None
        Whether the claim holds; None if the results leave that open.
    value, margin : float
        Our value and half of its 95 % interval.
    reason : str
        Why, in a sentence.
    """

    holds: bool | None
    value: float
    margin: float
    reason: str


CLAIM_CHECKS: dict[str, Callable[[Claim, Evidence], CheckResult]] = {}


def _claim_check(check: Callable[[Claim, Evidence], CheckResult]) -> Callable[[Claim, Evidence], CheckResult]:
    """Register a check under its name without "check_", as the claims give it."""
    CLAIM_CHECKS[check.__name__.removeprefix("check_")] = check
    return check


def _all_hold(outcomes: Iterable[bool | None]) -> bool | None:
    """False if any outcome is False, otherwise None if any is open."""
    outcomes = list(outcomes)
    return False if False in outcomes else None if None in outcomes else True


def _largest(means: Iterable[Mean]) -> Mean:
    return max(means, key=lambda mean: abs(mean.value))


def _readable(point: str) -> str:
    return point.replace("=", " ").replace("_", " ").replace(",", ", ").removesuffix(".0")


def check_table_number(claim: Claim, evidence: Evidence) -> CheckResult:
    """Compare a number of a table with the mean over trials at the first point of the study that reproduces it.

    Parameters
    ----------
    claim : mapping
        `study`, `method`, `torque`, `against`, `paper`, and `tolerance` where the table sets one.
    evidence : Evidence
        The results.

    Returns
    -------
    CheckResult

    Raises
    ------
    MissingEvidence
        If there are no such results.
    """
    study = evidence.study(claim["study"])
    point = study.first_point
    mean = study.mean_vaf(point, claim["method"], claim["torque"], claim["against"])
    if claim["study"] == "table2" and study.kind == "simulation":
        reason = f"the recording is not public; a simulated stand-in gives {mean.text} %."
        return CheckResult(None, mean.value, mean.margin, reason)
    difference, tolerance = mean.value - claim["paper"], claim.get("tolerance")
    holds = None if tolerance is None else Mean(difference, mean.margin).is_within(tolerance)
    side = "above" if difference > 0 else "below"
    reason = f"ours is {abs(difference):.1f} points {side} the paper's {claim['paper']:g} % at {_readable(point)}"
    if tolerance is None:
        reason += ": the table sets no tolerance"
    elif holds is None:
        reason += f" ± {mean.margin:.2g}: {TOO_WIDE}"
    elif not holds:
        reason += f", more than {tolerance:g} points" + (": better than published" if difference > 0 else "")
    return CheckResult(holds, mean.value, mean.margin, reason + ".")


@_claim_check
def check_open_loop_methods_biased(claim: Claim, evidence: Evidence) -> CheckResult:
    """K in closed loop is wrong by every method that was made for open loop."""
    study = evidence.study("voluntary")
    texts, errors, outcomes = [], [], []
    for method in OPEN_LOOP_METHODS:
        closed, opened = (
            study.stiffness_error(evidence.point("voluntary", voluntary=0.5, closed_loop=loop), method)
            for loop in (True, False)
        )
        outcome = abs(closed).exceeds(claim["tolerance"])
        remark = {True: "", False: ": not biased", None: f": {TOO_WIDE}"}[outcome]
        if abs(opened).exceeds(claim["tolerance"]):
            remark += ": biased in open loop, too"
        texts.append(
            f"{study.labels.get(method, method)} {closed.value:+.0f} ± {closed.margin:.0f} % "
            f"(open loop {opened.value:+.0f} ± {opened.margin:.0f} %){remark}"
        )
        errors.append(closed)
        outcomes.append(outcome)
    least = min(errors, key=lambda error: abs(error.value))
    reason = f"error of K in closed loop: {'; '.join(texts)}."
    return CheckResult(_all_hold(outcomes), least.value, least.margin, reason)


def _check_unbiased(claim: Claim, evidence: Evidence, method: str) -> CheckResult:
    """K in closed loop at every level of voluntary torque."""
    study = evidence.study("voluntary")
    points = study.points_with(closed_loop=True)
    errors = {study.points[point]["voluntary"]: study.stiffness_error(point, method) for point in points}
    if not errors:
        raise MissingEvidence("the study voluntary has no closed-loop points.")
    worst = _largest(errors.values())
    holds = _all_hold(error.is_within(claim["tolerance"]) for error in errors.values())
    texts = [f"{error.value:+.1f} ± {error.margin:.1f} % at {100 * level:g} %" for level, error in errors.items()]
    reason = f"error of K against voluntary torque: {', '.join(texts)}"
    if holds is None:
        reason += f": {TOO_WIDE}"
    elif not holds:
        reason += ". Torque that is fed back biases B and D by least squares, whatever the instruments of A and C are"
    return CheckResult(holds, worst.value, worst.margin, reason + ".")


@_claim_check
def check_eiv_unbiased(claim: Claim, evidence: Evidence) -> CheckResult:
    """K by EIV-MOESP is right in closed loop at every level of voluntary torque."""
    return _check_unbiased(claim, evidence, "eiv-moesp")


@_claim_check
def check_pr_unbiased(claim: Claim, evidence: Evidence) -> CheckResult:
    """K by PR-MOESP is right in closed loop at every level of voluntary torque."""
    return _check_unbiased(claim, evidence, "pr-moesp")


@_claim_check
def check_pr_accurate(claim: Claim, evidence: Evidence) -> CheckResult:
    """K by PR-MOESP is right at the setting of Table 1."""
    study = evidence.study("table1")
    error = study.stiffness_error(study.first_point, "pr-moesp")
    reason = f"error of K: {error.value:+.2f} ± {error.margin:.2f} %."
    return CheckResult(error.is_within(claim["tolerance"]), error.value, error.margin, reason)


@_claim_check
def check_similar(claim: Claim, evidence: Evidence) -> CheckResult:
    """PR-MOESP and EIV-MOESP differ little in Table 1."""
    study = evidence.study("table1")
    methods, targets = ("pr-moesp", "eiv-moesp"), (("net", "measured"), ("intrinsic", "true"), ("reflex", "true"))
    differences = {
        torque: study.vaf_difference(study.first_point, methods, torque, against) for torque, against in targets
    }
    worst = _largest(differences.values())
    holds = _all_hold(mean.is_within(claim["tolerance"]) for mean in differences.values())
    text = ", ".join(f"{torque} {mean.value:+.1f} ± {mean.margin:.1f}" for torque, mean in differences.items())
    reason = f"PR-MOESP less EIV-MOESP: {text} points of VAF" + (f": {TOO_WIDE}." if holds is None else ".")
    return CheckResult(holds, worst.value, worst.margin, reason)


@_claim_check
def check_cascade_net_good(claim: Claim, evidence: Evidence) -> CheckResult:
    """One pass of the parallel cascade gives a good net torque from poor parts."""
    study = evidence.study("table1")
    net = study.mean_vaf(study.first_point, ONE_PASS, "net", "measured")
    part = study.mean_vaf(study.first_point, ONE_PASS, "intrinsic")
    holds = abs(net.value - claim["paper"]) <= claim["tolerance"] and net.value - part.value > 20
    return CheckResult(holds, net.value, net.margin, f"net VAF {net.text} %, intrinsic VAF {part.text} %.")


@_claim_check
def check_cascade_better_in_open_loop(claim: Claim, evidence: Evidence) -> CheckResult:
    """One pass of the parallel cascade gives a better intrinsic torque in open loop."""
    study = evidence.study("voluntary")
    opened, closed = (
        study.mean_vaf(evidence.point("voluntary", voluntary=0.0, closed_loop=loop), ONE_PASS, "intrinsic")
        for loop in (False, True)
    )
    difference = opened - closed
    reason = f"intrinsic VAF {opened.text} % in open loop, {closed.text} % in closed loop."
    return CheckResult(difference.exceeds(claim["tolerance"]), difference.value, difference.margin, reason)


def _points_by_gain(study: StudyResults) -> dict[float, str]:
    """Points of Figure 4 by reflex gain, from the lowest to the highest."""
    return dict(sorted((settings["reflex_gain"], point) for point, settings in study.points.items()))


@_claim_check
def check_figure4_pr(claim: Claim, evidence: Evidence) -> CheckResult:
    """PR-MOESP is good at every gain."""
    study = evidence.study("figure4")
    means = {
        (gain, torque): study.mean_vaf(point, "pr-moesp", torque)
        for gain, point in _points_by_gain(study).items()
        for torque in ("net", "intrinsic", "reflex")
    }
    (gain, torque), lowest = min(means.items(), key=lambda item: item[1].value)
    reason = f"the lowest mean VAF is {lowest.text} % ({torque} torque at gain {gain:g})."
    return CheckResult(lowest.value >= claim["paper"], lowest.value, lowest.margin, reason)


@_claim_check
def check_figure4_cascade_biased(claim: Claim, evidence: Evidence) -> CheckResult:
    """The intrinsic torque by one pass of the parallel cascade is wrong at the highest gain."""
    study = evidence.study("figure4")
    points = _points_by_gain(study)
    low, high = (study.mean_vaf(points[gain], ONE_PASS, "intrinsic") for gain in (min(points), max(points)))
    reason = f"intrinsic VAF {low.text} % at gain {min(points):g}, {high.text} % at gain {max(points):g}."
    return CheckResult(high.value + high.margin < claim["paper"], high.value, high.margin, reason)


@_claim_check
def check_figure4_cascade_falls(claim: Claim, evidence: Evidence) -> CheckResult:
    """The intrinsic VAF of one pass of the parallel cascade falls with the gain."""
    study = evidence.study("figure4")
    points = _points_by_gain(study)
    if len(points) < 3:
        raise MissingEvidence("the study figure4 has fewer than three gains.")
    means = [study.mean_vaf(point, ONE_PASS, "intrinsic").value for point in points.values()]
    correlation = float(stats.spearmanr(list(points), means).statistic)
    reason = f"rank correlation {correlation:.2f} over {len(points)} gains, from {means[0]:.1f} to {means[-1]:.1f} %."
    return CheckResult(abs(correlation - claim["paper"]) <= claim["tolerance"], correlation, np.nan, reason)


@_claim_check
def check_figure4_cause(claim: Claim, evidence: Evidence) -> CheckResult:
    """The converged parallel cascade is biased on the same closed-loop trials, too."""
    study = evidence.study("figure4")
    points = _points_by_gain(study)
    gain = max(points)
    mean = study.mean_vaf(points[gain], CONVERGED, "intrinsic")
    passes = study.mean_parameter("passes", points[gain], CONVERGED)
    holds = mean.value + mean.margin < 99
    reason = f"after {passes.value:.0f} passes on average at gain {gain:g} the intrinsic VAF is {mean.text} %"
    if not holds:
        reason += ": the published bias is that of an iteration that was stopped early, not that of the loop"
    return CheckResult(holds, mean.value, mean.margin, reason + ".")


@_claim_check
def check_figure4_count(claim: Claim, evidence: Evidence) -> CheckResult:
    """Number of gains from 10 to 30 in steps of 1."""
    count = len(range(10, 30 + 1))
    return CheckResult(count == claim["paper"], count, np.nan, f"gains from 10 to 30 in steps of 1 are {count}.")


@_claim_check
def check_eq17_gain(claim: Claim, evidence: Evidence) -> CheckResult:
    """Table 1 with the gain of Eq. 17 as printed."""
    study = evidence.study("table1")
    printed = study.mean_vaf(evidence.point("table1", reflex_gain=2.0), ONE_PASS, "intrinsic")
    assumed = study.mean_vaf(study.first_point, ONE_PASS, "intrinsic")
    reason = (
        f"with a gain of 2 one pass of the parallel cascade finds {printed.text} % of the intrinsic torque, where "
        f"Table 1 has {claim['paper']:g} %; at {_readable(study.first_point)} it finds {assumed.text} %."
    )
    holds = abs(printed.value - claim["paper"]) <= claim["tolerance"]
    return CheckResult(holds, printed.value, printed.margin, reason)


@_claim_check
def check_eq10_constant(claim: Claim, evidence: Evidence) -> CheckResult:
    """Directions that a constant among the inputs adds."""
    directions, rows = evidence.measurement("constant_directions"), evidence.measurement("constant_rows")
    reason = (
        f"its {rows:g} Hankel rows are all alike and add {directions:g} directions once means are removed: it is left "
        "out, and a fifth-order basis is T1 … T5 in the usual numbering, five inputs."
    )
    return CheckResult(directions == claim["paper"], directions, np.nan, reason)


@_claim_check
def check_eq11_zero(claim: Claim, evidence: Evidence) -> CheckResult:
    """Increase of the net VAF if B is free."""
    increase = evidence.measurement("free_b_net_vaf")
    reason = f"leaving B free changes the net VAF by {increase:+.2f} points."
    return CheckResult(increase <= claim["tolerance"], increase, np.nan, reason)


def _instrument_columns(evidence: Evidence, method: str) -> tuple[float, str]:
    """Columns of instruments, and the rows that they are made of in words."""
    rows, block_rows = evidence.measurement(f"{method}_instrument_rows"), evidence.measurement("block_rows")
    return rows / block_rows, f"{rows:g} rows of instruments over {block_rows:g} block rows"


@_claim_check
def check_columns_eiv(claim: Claim, evidence: Evidence) -> CheckResult:
    """Columns of instruments of EIV-MOESP."""
    columns, text = _instrument_columns(evidence, "eiv-moesp")
    return CheckResult(columns == claim["paper"], columns, np.nan, f"{text}: 3 + 5 inputs and 1 output.")


@_claim_check
def check_columns_pr(claim: Claim, evidence: Evidence) -> CheckResult:
    """Columns of instruments of PR-MOESP."""
    columns, text = _instrument_columns(evidence, "pr-moesp")
    reason = (
        f"{text} in the ordinary form; the correlation form, which is consistent in closed loop, needs "
        f"{evidence.measurement('correlation_rows'):g} rows."
    )
    return CheckResult(columns == claim["paper"], columns, np.nan, reason)


def _check_economy(claim: Claim, evidence: Evidence, quantity: str, unit: str) -> CheckResult:
    """Ratio of what EIV-MOESP and PR-MOESP take."""
    pr, eiv = (evidence.measurement(f"{method}_{quantity}") for method in ("pr-moesp", "eiv-moesp"))
    reason = f"PR-MOESP {pr:.3g} {unit}, EIV-MOESP {eiv:.3g} {unit}."
    return CheckResult(eiv / pr > claim["paper"], eiv / pr, np.nan, reason)


@_claim_check
def check_economy_time(claim: Claim, evidence: Evidence) -> CheckResult:
    """Time of EIV-MOESP over that of PR-MOESP."""
    return _check_economy(claim, evidence, "milliseconds", "ms")


@_claim_check
def check_economy_memory(claim: Claim, evidence: Evidence) -> CheckResult:
    """Peak memory of EIV-MOESP over that of PR-MOESP."""
    return _check_economy(claim, evidence, "megabytes", "MB")


@_claim_check
def check_table2_text(claim: Claim, evidence: Evidence) -> CheckResult:
    """Numbers of Table 2 against those of the text."""
    table = evidence.tables["table2"].dropna(subset="text")
    difference = (table["paper"] - table["text"]).abs()
    pairs = [f"{row.torque} {row.paper:g} % and {row.text:g} %" for row in table[difference > 0].itertuples()]
    reason = f"table and text differ for the parallel cascade: {', '.join(pairs)}." if pairs else "they agree."
    largest = float(difference.max())
    return CheckResult(largest <= claim["tolerance"], largest, np.nan, reason)


@_claim_check
def check_real_time_input(claim: Claim, evidence: Evidence) -> CheckResult:
    """Error of K of the real-time algorithm by perturbation in open loop."""
    study = evidence.study("real-time")
    pulses, prbs = (
        study.stiffness_error(evidence.point("real-time", perturbation=name, closed_loop=False), "real-time")
        for name in ("pulses", "prbs")
    )
    holds = (abs(prbs) - abs(pulses)).exceeds(claim["tolerance"])
    texts = [f"{error.value:+.1f} ± {error.margin:.1f} %" for error in (pulses, prbs)]
    reason = f"error of K: {texts[0]} with it, {texts[1]} with a PRBS."
    return CheckResult(holds, pulses.value, pulses.margin, reason)
