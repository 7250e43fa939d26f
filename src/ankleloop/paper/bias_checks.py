"""Checks of the claims on bias: what closed loop does to the estimates of each method."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ankleloop.paper.checks import (
    CheckResult,
    Claim,
    at_least,
    claim_check,
    claim_settings,
    format_signed,
    within,
)
from ankleloop.paper.evidence import Evidence, MissingEvidence, StudyResults, parse_settings
from ankleloop.paper.judgement import REPRODUCED, Comparison, Mean, judge
from ankleloop.paper.results import true_spectral_radius

CONVERGED = "parallel-cascade"


@claim_check
def check_open_loop_methods_biased(claim: Claim, evidence: Evidence) -> CheckResult:
    """K is wrong in closed loop, and right in open loop, by every method that was made for open loop.

    Open loop is the control: an error that is there in open loop, too, does not come from the loop. The real-time
    algorithm needs its own perturbation, so it has its own study.
    """
    settings, tolerance = claim_settings(claim), claim["tolerance"]
    texts, comparisons = [], []
    arms: list[tuple[str, str, dict[str, Any]]] = [
        ("voluntary", "pi-moesp", {}),
        ("voluntary", "po-moesp", {}),
        ("voluntary", CONVERGED, {}),
        ("real-time", "real-time", {"perturbation": "pulses", "reflex_gain": 5.0}),
    ]
    for name, method, own in arms:
        study = evidence.study(name)
        closed, opened = (
            study.stiffness_error(study.point(**settings, **own, closed_loop=loop), method) for loop in (True, False)
        )
        label = study.label(method)
        comparisons += [
            Comparison(f"{label} in closed loop", closed, at_least(tolerance), size=True),
            Comparison(f"{label} in open loop, the control", opened, within(tolerance), control=True),
        ]
        texts.append(f"{label} {format_signed(closed)} % (open loop {format_signed(opened)} %)")
    return CheckResult(f"error of K in closed loop: {'; '.join(texts)}", comparisons)


def _closed_loop_errors(claim: Claim, study: StudyResults, method: str) -> dict[float, Mean]:
    """Error of K in closed loop at each level of voluntary torque that the claim names."""
    levels = parse_settings(claim["settings"])["voluntary"]
    return {level: study.stiffness_error(study.point(voluntary=level, closed_loop=True), method) for level in levels}


def _check_unbiased(claim: Claim, study: StudyResults, method: str) -> CheckResult:
    """K in closed loop at every level of voluntary torque."""
    errors = _closed_loop_errors(claim, study, method)
    comparisons = [
        Comparison(f"voluntary torque {100 * level:g} %", error, within(claim["tolerance"]))
        for level, error in errors.items()
    ]
    return CheckResult(f"error of K against voluntary torque: {_list_errors(errors)}", comparisons)


def _list_errors(errors: Mapping[float, Mean]) -> str:
    return ", ".join(f"{format_signed(error)} % at {100 * level:g} %" for level, error in errors.items())


@claim_check
def check_eiv_unbiased(claim: Claim, evidence: Evidence) -> CheckResult:
    """K by EIV-MOESP is right in closed loop at every level of voluntary torque."""
    return _check_unbiased(claim, evidence.study("voluntary"), "eiv-moesp")


@claim_check
def check_pr_unbiased(claim: Claim, evidence: Evidence) -> CheckResult:
    """K by PR-MOESP is right in closed loop at every level of voluntary torque.

    The same A and C with instruments for B and D show how much of the error comes from least squares.
    """
    study = evidence.study("voluntary")
    result = _check_unbiased(claim, study, "pr-moesp")
    if judge(result.comparisons).verdict == REPRODUCED:
        return result
    instruments = _closed_loop_errors(claim, study, "pr-moesp-instruments")
    level = max(instruments)
    point = study.point(voluntary=level, closed_loop=True)
    change = study.stiffness_difference(point, "pr-moesp", "pr-moesp-instruments")
    texts = [
        result.reason,
        f"with the same A and C, and instruments for B and D: {_list_errors(instruments)}",
        f"so least squares for B and D adds {format_signed(change)} % at {100 * level:g} %"
        if _excludes_zero(change)
        else f"so an effect of least squares for B and D is not shown at {100 * level:g} %",
        describe_origin(study),
    ]
    return replace(result, reason="; ".join(texts))


def _excludes_zero(mean: Mean) -> bool:
    """Whether the 95 % interval of a mean has one sign."""
    low, high = mean.interval()
    return low > 0.0 or high < 0.0


def describe_origin(study: StudyResults) -> str:
    """Where the error of K by PR-MOESP comes from without voluntary torque, as far as the arms of a study show it.

    Instruments for B and D keep A and C; PI-MOESP keeps the regression for B and D, and has other A and C; in open loop
    the same noise is not fed back.
    """
    closed, opened = (study.point(voluntary=0.0, closed_loop=loop) for loop in (True, False))
    change_by_loop = study.stiffness_error(closed, "pr-moesp") - study.stiffness_error(opened, "pr-moesp")
    by_matrices = _excludes_zero(study.stiffness_difference(closed, "pr-moesp", "pi-moesp"))
    by_loop = _excludes_zero(change_by_loop)
    cause = {
        (True, True): "noise that is fed back causes it, through A and C",
        (True, False): "noise that is fed back causes it",
        (False, True): "it comes with A and C",
        (False, False): "its cause is not shown",
    }[by_loop, by_matrices]
    arms = {
        "by PR-MOESP": (closed, "pr-moesp"),
        "with instruments for B and D": (closed, "pr-moesp-instruments"),
        "by PI-MOESP (other A and C, the same regression)": (closed, "pi-moesp"),
        "by PR-MOESP in open loop": (opened, "pr-moesp"),
    }
    texts = [f"{name} {_describe_arm(study, *arm)}" for name, arm in arms.items()]
    truth = true_spectral_radius(study.points[closed])
    return f"error with measurement noise alone: {', '.join(texts)}; the true pole is {truth:.2f}: {cause}"


def _describe_arm(study: StudyResults, point: str, method: str) -> str:
    """Error of K of a method, and its largest pole."""
    radius = study.mean_parameter("spectral_radius", point, method).value
    return f"{format_signed(study.stiffness_error(point, method))} % (largest pole {radius:.2f})"


# Methods by study that are PR-MOESP with one basis, as published otherwise.
CHEBYSHEV = {"table1": "pr-moesp", "projection": "ordinary", "obstacles": "pr-chebyshev"}
RECTIFIER = {"projection": "ordinary-rectifier", "obstacles": "pr-rectifier"}


def _check_accurate(claim: Claim, evidence: Evidence, arms: Mapping[str, str]) -> CheckResult:
    """K by PR-MOESP with one basis over all trials at the setting of Table 1, and without noise as a control."""
    settings = claim_settings(claim)
    error = evidence.pooled_stiffness_error(arms, **settings)
    parts = [
        f"{study} {format_signed(evidence.pooled_stiffness_error({study: method}, **settings))} %"
        for study, method in arms.items()
        if study in evidence.studies
    ]
    reason = f"error of K {format_signed(error)} % over {error.freedom + 1:.0f} trials ({', '.join(parts)})"
    try:
        control = {"obstacles": arms["obstacles"]}
        clean = evidence.pooled_stiffness_error(control, **{**settings, "voluntary": 0.0, "snr_db": None})
        reason += f"; {format_signed(clean, 2)} % without noise and voluntary torque"
    except MissingEvidence as missing:
        reason += f"; not known without noise: {str(missing).rstrip('.')}"
    return CheckResult(reason, [Comparison("error of K", error, within(claim["tolerance"]))])


@claim_check
def check_pr_accurate(claim: Claim, evidence: Evidence) -> CheckResult:
    """K by PR-MOESP is right at the setting of Table 1, with the published basis."""
    return _check_accurate(claim, evidence, CHEBYSHEV)


@claim_check
def check_pr_accurate_rectifier(claim: Claim, evidence: Evidence) -> CheckResult:
    """K by PR-MOESP is right at the setting of Table 1, with a basis that has no error of its own."""
    result = _check_accurate(claim, evidence, RECTIFIER)
    if judge(result.comparisons).verdict == REPRODUCED or "voluntary" not in evidence.studies:
        return result
    return replace(result, reason=f"{result.reason}; {describe_origin(evidence.study('voluntary'))}")


@claim_check
def check_real_time_input(claim: Claim, evidence: Evidence) -> CheckResult:
    """K by the real-time algorithm in open loop is right with its perturbation, and wrong with a PRBS."""
    study, settings, tolerance = evidence.study("real-time"), claim_settings(claim), claim["tolerance"]
    pulses, prbs = (
        study.stiffness_error(study.point(**settings, perturbation=name, closed_loop=False), "real-time")
        for name in ("pulses", "prbs")
    )
    reason = f"error of K in open loop: {format_signed(pulses)} % with it, {format_signed(prbs)} % with a PRBS"
    return CheckResult(
        reason,
        [
            Comparison("with the perturbation", pulses, within(tolerance)),
            Comparison("with a PRBS", prbs, at_least(tolerance), size=True),
        ],
    )
