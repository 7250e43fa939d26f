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
from ankleloop.paper.judgement import Comparison, Mean

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
def check_riv_unbiased(claim: Claim, evidence: Evidence) -> CheckResult:
    """K by refined instrumental variables is right in closed loop at every level of voluntary torque."""
    return _check_unbiased(claim, evidence.study("voluntary"), "riv")


@claim_check
def check_pr_unbiased(claim: Claim, evidence: Evidence) -> CheckResult:
    """K by PR-MOESP is right in closed loop at every level of voluntary torque."""
    study = evidence.study("voluntary")
    result = _check_unbiased(claim, study, "pr-moesp")
    instruments = _closed_loop_errors(claim, study, "pr-moesp-instruments")
    reason = f"{result.reason}; with instruments for B and D, too: {_list_errors(instruments)}"
    return replace(result, reason=reason)


@claim_check
def check_net_vaf_hides_bias(claim: Claim, evidence: Evidence) -> CheckResult:
    """PR-MOESP explains more of the net torque than riv, and has a wrong K."""
    study, tolerance = evidence.study("voluntary"), claim["tolerance"]
    point = study.point(**claim_settings(claim), closed_loop=True)
    lead = study.vaf_difference(point, *((method, "net", "measured") for method in ("pr-moesp", "riv")))
    error = study.stiffness_error(point, "pr-moesp")
    reason = f"net VAF of PR-MOESP less that of riv {format_signed(lead)} points; error of K {format_signed(error)} %"
    comparisons = [
        Comparison("net VAF", lead, at_least(0.0)),
        Comparison("error of K", error, at_least(tolerance), size=True),
    ]
    return CheckResult(reason, comparisons, ours=error)


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
    return _check_accurate(claim, evidence, RECTIFIER)


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
