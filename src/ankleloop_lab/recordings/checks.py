"""Checks of a recording before anything is fitted to it, with their results in sentences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ankleloop.checks.data import (
    check_signals,
    rectifier_regressors,
    refuse_repeated_trials,
)
from ankleloop.checks.findings import VERDICTS, Finding, merge_findings, name_trial
from ankleloop.checks.loop import check_loop, path_bias
from ankleloop.checks.movement import (
    check_excitation,
    check_relation,
    check_sign,
    motion_products,
    project_records,
    regress_torque_by_reference,
)
from ankleloop.checks.record import check_coherence, check_drift, check_length, estimate_spectra
from ankleloop.checks.reference import find_reference_fault
from ankleloop.errors import DataError
from ankleloop.joint.prepared import PreparedTrial, prepare_trials
from ankleloop.joint.regressors import Regressors
from ankleloop.methods.apparatus import is_device
from ankleloop.methods.method import POSITION, KnownDelayOptions, Trial
from ankleloop.methods.registry import METHODS
from ankleloop.methods.riv.riv import RivOptions, find_solution
from ankleloop.methods.riv.strength import check_answer, check_strength, find_unshown
from ankleloop.options import option, show_fields
from ankleloop.signals.responses import ReferenceProjection
from ankleloop_lab.files.reading import LARGEST_JITTER
from ankleloop_lab.recordings.validity import describe_validity, valid_methods

DEVICE = "It looks like the record of a device without a subject. If it is one, take the method apparatus, by its name."


@dataclass(frozen=True)
class Check:
    """Results of all checks of a recording.

    Parameters
    ----------
    findings : list of Finding
        In the order of the checks.
    loop : {"closed", "open", "undecided"}
        Whether torque feeds back on the position.
    methods : dict of str to dict
        Methods that are valid for this recording, with the options that make them so.
    spectra : dict of str to ndarray
        `frequency` [Hz], power spectral densities of `position` [rad²/Hz] and `torque` [(N·m)²/Hz], squared `coherence`
        of the two, and of the reference with the position where there is one (`reference_coherence`).
    reference : bool
        Whether there is a usable reference.
    path_bias : float
        How far K of a model without a reflex is off [%], see `ankleloop.checks.loop.path_bias`.
    """

    findings: list[Finding]
    loop: str
    methods: dict[str, dict[str, Any]]
    spectra: dict[str, np.ndarray] = field(default_factory=dict, repr=False)
    reference: bool = False
    path_bias: float = 0.0

    @property
    def verdict(self) -> str:
        """The worst of all verdicts."""
        return max((finding.verdict for finding in self.findings), key=VERDICTS.index)

    @property
    def reasons(self) -> list[str]:
        """Texts of all findings that are not ok."""
        return [finding.text for finding in self.findings if finding.verdict != "ok"]

    @property
    def remedy(self) -> dict[str, Any]:
        """Values of the options that the findings ask for, None where only the user knows the value."""
        return {name: value for f in self.findings for name, value in f.remedy.items()}

    @property
    def instrumental(self) -> bool:
        """Whether results have to rest on the reference: feedback is there, or is not excluded."""
        return self.reference and self.loop != "open"

    def __str__(self) -> str:
        return "\n".join(f"{f.verdict:>8}  {f.name}: {f.text}" for f in self.findings)


class CheckOptions(KnownDelayOptions):
    """Options of `check_trial`."""

    reference: str = option("reference", "variable that serves as reference")
    order: int = option(2, "largest order that a subspace method will use", ge=1, le=20)
    block_rows: int = option(15, "largest number of its block rows", unit="samples", ge=3, le=200)


@show_fields(CheckOptions)
def check_trial(trial: Trial | Sequence[Trial], **options: Any) -> Check:
    """Check what can be identified from a recording before anything is fitted to it.

    The checks are: length and rates; clipping, stretches at rest and spikes of position and torque; their size, and how
    much of the torque the movement explains; sign of the torque, coherence, persistent excitation for the given order
    and block rows, slow drift, whether there is a usable reference (not exchanged with the position, and no filter of
    the torque), whether the torque feeds back on the position, and which methods are therefore valid. Those that cost
    little are made by every identification as well (`ankleloop.checks.data.check_data`).

    Parameters
    ----------
    trial : xarray.Dataset or PreparedTrial, or list of those
        The recording: a trial, or several short ones that are to be merged into one identification.
    **options
        `reference`, the variable that serves as reference; reflex `delay` [s]; largest `order` and `block_rows` that a
        subspace method will use; `identification_rate` [Hz].

    Returns
    -------
    Check
        Length, reference, loop and methods are those of all trials together; of every other property it has the worst
        finding, with the number of its trial.

    Raises
    ------
    DataError
        If the list is empty or has a record twice, or a trial is not valid.

    See Also
    --------
    ankleloop.identify : Makes those of the checks that cost little, too.
    ankleloop.read_trial : A trial from a file.

    Examples
    --------
    >>> from ankleloop.simulation.simulate import simulate
    >>> check = check_trial(simulate(seed=1))
    >>> check.verdict, check.loop, "riv" in check.methods
    ('ok', 'closed', True)
    """
    values = CheckOptions.parse("check_trial", **options)
    trials = prepare_trials(trial)
    if not trials:
        raise DataError("there are no trials to check.")
    refuse_repeated_trials(trials)
    values = values.at_rate(trials[0].rate)
    length = check_length(trials, values.identification_rate)
    if length.verdict == "refused":
        return Check([length], "undecided", {})
    try:
        records = _make_records(trials, values)
    except DataError as error:
        return Check(
            [length, Finding("signals", "refused", str(error), error.remedy)], "undecided", {}
        )
    signals = [
        check_signals(part, record.grid) for part, record in zip(trials, records, strict=True)
    ]
    strength, relation, *excitation = _check_instruments(trials, records, values)
    usable = strength.verdict == "ok"
    projection = project_records(records) if usable else None
    loop, feedback = check_loop(records, projection)
    sign = _check_sign(trials, records, projection if loop != "open" else None)
    velocities = [record.inputs[:, 1] for record in records]
    findings = [
        length,
        *_describe_times(trials),
        *map(merge_findings, zip(*signals, strict=True)),
        relation,
        sign,
        merge_findings([check_coherence(record) for record in records]),
        *(excitation or [check_excitation(velocities, values.order, values.block_rows)]),
        merge_findings([check_drift(record) for record in records]),
        strength,
    ]
    spectra = estimate_spectra(records)
    if sign.verdict == "refused":  # loop and methods rest on it
        return Check(findings, "undecided", {}, spectra, usable)
    bias = path_bias(records)
    merged = len(records) > 1
    methods = valid_methods(loop, usable, bias, merged=merged)
    if trials[0].apparatus is not None:
        methods = {name: given for name, given in methods.items() if METHODS[name].subtracts}
    validity = describe_validity(methods, loop, usable, bias, merged=merged)
    if is_device(trials, values.reference if usable else "position", values.identification_rate):
        methods["apparatus"] = {} if usable else dict(POSITION)
        validity += f" {DEVICE}"
    findings += [feedback, Finding("methods", "ok" if usable else "warning", validity)]
    return Check(findings, loop, methods, spectra, usable, bias)


def _describe_times(trials: Sequence[PreparedTrial]) -> list[Finding]:
    """What was done to times that were not even."""
    attributes = [trial.trial.attrs for trial in trials]
    jitter = max(each.get("jitter", 0.0) for each in attributes)
    findings = []
    if jitter:
        text = f"jitter of {jitter:.2g} samples (standard deviation) around an even clock was straightened."
        findings.append(Finding("times", "ok" if jitter <= LARGEST_JITTER else "warning", text))
    rates = {each["resample"] for each in attributes if "resample" in each}
    if rates:
        text = f"uneven; samples were interpolated at {' and '.join(f'{rate:g}' for rate in rates)} Hz."
        findings.append(Finding("times", "ok", text))
    return findings


def _make_records(trials: Sequence[PreparedTrial], options: CheckOptions) -> list[Regressors]:
    """Regressors of all trials, with the reference if all have it; an error has the number of its trial."""
    name: str | None = options.reference
    if name == "position" or not all(name in trial.trial for trial in trials):
        name = None
    records = []
    for number, trial in enumerate(trials, 1):
        try:
            record = rectifier_regressors(trial, options.delay, options.identification_rate, name)
        except DataError as error:
            raise DataError(f"{name_trial(number, len(trials))}{error}", error.remedy) from None
        records.append(record)
    return records


def _check_instruments(
    trials: Sequence[PreparedTrial], records: Sequence[Regressors], options: CheckOptions
) -> list[Finding]:
    """Whether the reference can serve as an instrument, and the torque answers it; and what the reference cannot show.

    Where `riv` can be had, these are its own rules: voluntary torque can hide the relation of torque and movement, and
    not that to the reference; and it excites what the reference does not. A reference that is not ok leaves a recording
    that may be one in open loop.
    """
    relation = merge_findings(
        [
            check_relation(trial, motion_products(trial, record.grid))
            for trial, record in zip(trials, records, strict=True)
        ]
    )
    name = records[0].reference_name
    if name is None:
        text = (
            "there is none. Record the command of the servo, or name its variable: without it a closed loop cannot be "
            "told from an open one."
        )
        return [Finding("reference", "warning", text), relation]
    given = {name: getattr(options, name) for name in ("delay", "identification_rate", "reference")}
    try:
        solution, _ = find_solution(trials, RivOptions(**given))
    except DataError as error:
        text = f"what {name} explains of the movement cannot be told: {error}"
        return [Finding("reference", "warning", text), relation]
    strength = check_strength(solution)
    faults = [find_reference_fault(trial, name, options.delay) for trial in trials]
    if strength.verdict == "ok" and any(faults):
        strength = merge_findings([fault or strength for fault in faults])
    if strength.verdict != "ok":
        return [replace(strength, verdict="warning"), relation]
    findings = [strength, check_answer(solution)]
    unshown, reason = find_unshown(solution)
    if unshown:
        text = f"{', '.join(unshown)} cannot be shown: {reason}."
        findings.append(Finding("excitation", "warning", text))
    return findings


def _check_sign(
    trials: Sequence[PreparedTrial],
    records: Sequence[Regressors],
    projection: ReferenceProjection | None,
) -> Finding:
    """Sign of the torque; by what the reference explains where least squares may be off by torque that is fed back."""
    if projection is not None:
        fits = regress_torque_by_reference(projection)
    else:
        pairs = zip(trials, records, strict=True)
        fits = [motion_products(trial, record.grid).stiffness for trial, record in pairs]
    return merge_findings(list(map(check_sign, trials, fits)))
