"""What every identification checks of its data: faults become warnings; what says nothing at all is refused."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ankleloop.checks.channels import CHANNEL_CHECKS, GAPS, check_gaps, is_reference_filled
from ankleloop.checks.findings import Finding, name_trial
from ankleloop.checks.movement import (
    COPY_SHARE,
    STRONG_SHARE,
    check_bandwidth,
    check_excitation,
    check_reference,
    check_relation,
    check_scale,
    check_sign,
    check_size,
    check_velocity,
    motion_products,
    project_records,
    reference_correlations,
    regress_torque_by_reference,
)
from ankleloop.checks.reference import find_reference_fault
from ankleloop.errors import DataError
from ankleloop.joint.prepared import PreparedTrial, once
from ankleloop.joint.regressors import Grid, Regressors
from ankleloop.trials.trial import REQUIRED

FEW_BLOCK_ROWS = (
    15  # of a method that has none: a movement that excites few of their directions says too little
)


def check_data(
    trials: Sequence[PreparedTrial],
    reference: str | None,
    *,
    judged: bool = False,
    delay: float = 0.04,
    identification_rate: float = 100.0,
    order: int = 2,
    block_rows: int | None = None,
) -> list[str]:
    """Check the data of an identification.

    `reference` is the variable whose leads or lags are instruments, `order` and `block_rows` are those for which the
    movement has to be persistently exciting; None for a method that has none. `judged` is whether the method itself
    refuses a reference that is too weak and a torque that does not answer it: then both are left to it.

    Filled gaps concern all methods alike where the reference was filled as well; else some leave them out.

    The checks are: scale, clipping, stretches at rest, filled gaps and spikes of position and torque; noise of the
    velocity and bandwidth of the torque; whether the torque has to do with the movement, and opposes it; whether the
    position is ahead of the reference, as it is where the two were exchanged; persistent excitation; and, if it is
    used, the strength of the reference, and whether it is the torque or a filter of it. They are those of
    `ankleloop_lab.recordings.checks.check_trial` that cost little.
    """
    warnings = []
    for number, trial in enumerate(trials, 1):
        findings = [
            *_find_faults(trial, delay, identification_rate, reference or "reference"),
            find_reference_fault(trial, reference, delay),
        ]
        if judged:
            findings = [finding for finding in findings if finding and finding.name != "relation"]
        if not is_reference_filled(trial, reference or "position"):
            findings = [
                finding for finding in findings if finding and not finding.name.startswith(GAPS)
            ]
        place = name_trial(number, len(trials))
        warnings += [f"{place}{finding.text}" for finding in findings if finding]
    if reference and reference != "position":
        warnings += _check_references(trials, reference, delay, identification_rate, judged=judged)
    if warnings:  # what a fault of a channel excites, or does not, says little
        return warnings
    velocities = []
    for trial in trials:
        grid = trial.grid(identification_rate, delay)
        velocities.append(trial.motion(grid)[1])
    excitation = check_excitation(velocities, order, block_rows or FEW_BLOCK_ROWS)
    # A movement of few frequencies says little about more than a few block rows.
    tolerated = ("ok",) if block_rows else ("ok", "warning")
    return [] if excitation.verdict in tolerated else [excitation.text]


def list_gaps(trials: Sequence[PreparedTrial]) -> list[str]:
    """Warnings about filled gaps of position and torque, for methods that mix them with the joint."""
    warnings = []
    for number, trial in enumerate(trials, 1):
        findings = [check_gaps(trial, name) for name in REQUIRED]
        place = name_trial(number, len(trials))
        warnings += [f"{place}{finding.text}" for finding in findings if finding.verdict != "ok"]
    return warnings


@once
def _find_faults(trial: PreparedTrial, delay: float, rate: float, reference: str) -> list[Finding]:
    """Findings about one trial that are not ok; each is computed once for all methods that take it."""
    grid = trial.grid(rate, delay)
    motion = motion_products(trial, grid)
    findings = [*check_signals(trial, grid), check_relation(trial, motion)]
    for finding in findings:
        if finding.name == "scale" and finding.verdict != "ok":
            raise DataError(finding.text)
    sign = check_sign(trial, motion.stiffness)
    if sign.verdict != "ok" and reference != "position" and reference in trial.trial:
        # Least squares may be off by fed-back torque; what the reference explains is not.
        record = rectifier_regressors(trial, delay, rate, reference)
        strength = check_reference([record]).verdict
        if strength == "ok":
            (stiffness,) = regress_torque_by_reference(project_records([record]))
            sign = check_sign(trial, stiffness)
        elif strength == "refused":  # nothing tells the sign
            sign = replace(sign, verdict="ok")
    return [finding for finding in (*findings, sign) if finding.verdict != "ok"]


def check_signals(trial: PreparedTrial, grid: Grid) -> list[Finding]:
    """Findings about position and torque of a trial, in an order that is that of every trial.

    `ankleloop_lab.recordings.checks.check_trial` shows all of them, an identification warns of those that are not ok.
    """
    motion = motion_products(trial, grid)
    return [
        *(check(trial, name) for check in CHANNEL_CHECKS for name in REQUIRED),
        check_velocity(trial),
        check_bandwidth(trial),
        check_scale(trial, motion),
        check_size(motion),
    ]


def rectifier_regressors(
    trial: PreparedTrial, delay: float, rate: float, reference: str | None
) -> Regressors:
    """Regressors of a check: their only basis function is the rectified velocity."""
    return trial.regressors(
        delay=delay, basis="rectifier", identification_rate=rate, reference=reference
    )


def _check_references(
    trials: Sequence[PreparedTrial], name: str, delay: float, rate: float, *, judged: bool
) -> list[str]:
    """Warnings about the reference; with one that explains nothing the identification is refused."""
    if not all(name in trial.trial for trial in trials):
        return []  # without the variable the method says so itself
    warnings = []
    for trial in trials:
        later, position, torque = reference_correlations(trial, trial.grid(rate, delay), name)
        if torque > 1.0 - COPY_SHARE:
            raise DataError(
                f"{name} is the torque itself, which is no instrument: give the command of the servo as reference."
            )
        if position > 1.0 - COPY_SHARE**2:
            warnings.append(
                f"{name} is a copy of the position, so the results hold only if the loop is open: give the command of "
                "the servo as reference, or say reference='position'."
            )
        if judged or later > STRONG_SHARE:
            continue
        finding = check_reference([rectifier_regressors(trial, delay, rate, name)])
        if finding.verdict == "warning" and len(trials) > 1:  # too short alone
            records = [rectifier_regressors(each, delay, rate, name) for each in trials]
            finding = check_reference(records)
        if finding.verdict == "refused":
            raise DataError(finding.text)
        if finding.verdict == "warning":
            warnings.append(finding.text)
    return list(dict.fromkeys(warnings))


def refuse_repeated_trials(trials: Sequence[PreparedTrial]) -> None:
    """Refuse trials of which one is there twice: merged, it would count twice, and intervals would be too narrow.

    Two trials are one record where every sample of position and torque is the same, whatever object or file it comes
    from. Two measurements never are.
    """
    numbers: dict[tuple[int, ...], int] = {}
    for number, trial in enumerate(trials, 1):
        record = tuple(hash(trial.samples[name].tobytes()) for name in REQUIRED)
        earlier = numbers.setdefault(record, number)
        if earlier != number:
            raise DataError(
                f"trials {earlier} and {number} of {len(trials)} are the same record, which would count twice: leave "
                "one of them out."
            )


def refuse_other_rates(trials: Sequence[PreparedTrial]) -> None:
    """Refuse trials that do not all have the sampling rate of the first one."""
    for number, trial in enumerate(trials[1:], 2):
        if trial.rate != trials[0].rate:
            raise DataError(
                f"trial {number} of {len(trials)} has {trial.rate:g} Hz, the first one {trials[0].rate:g} Hz: "
                "resample them to one rate before they are merged."
            )
