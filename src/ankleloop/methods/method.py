"""What an identification method is to its callers, and the options that several methods share."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, inf, isfinite
from typing import Any, Literal, NamedTuple, Self

import xarray as xr
from pydantic import model_validator

from ankleloop.checks.data import check_data, list_gaps, refuse_other_rates, refuse_repeated_trials
from ankleloop.checks.findings import name_trial
from ankleloop.errors import DataError
from ankleloop.joint.bases import BASES
from ankleloop.joint.estimate import Estimate, add_measured
from ankleloop.joint.prepared import GAP_MEMORY, PreparedTrial, prepare_trials
from ankleloop.joint.regressors import MEASURED, filtered_duration
from ankleloop.joint.verdicts import TOLERANCE
from ankleloop.options import Options, option
from ankleloop.quantities import QUANTITIES
from ankleloop.signals.decimation import USUAL_RATE, usual_rate
from ankleloop.signals.noise import describe_noise
from ankleloop.trials.trial import REQUIRED

Trial = xr.Dataset | PreparedTrial
NOMINAL_DELAY = 0.04  # s, where the delay is estimated
POSITION = {"reference": "position"}  # options of a method that needs a reference, in open loop


class MethodOptions(Options):
    """Options that all methods have."""

    identification_rate: float = option(
        USUAL_RATE,
        "rate of the identification, of which the sampling rate has to be a multiple; where it is not given, the whole "
        "division of the sampling rate that is nearest to 100 Hz",
        unit="Hz",
        ge=1,
        le=10000,
    )

    def at_rate(self, sampling_rate: float) -> Self:
        """These options for a trial, with a rate of the identification that divides its own."""
        if "identification_rate" in self.model_fields_set:
            return self
        return self.model_copy(update={"identification_rate": usual_rate(sampling_rate)})


class KnownDelayOptions(MethodOptions):
    """Options of methods that do not estimate the delay."""

    delay: float = option(NOMINAL_DELAY, "reflex delay", unit="s", ge=0, le=1)


class BasisOptions(MethodOptions):
    """Options of methods that have several static nonlinearities."""

    basis: Literal[tuple(BASES)] | None = option(  # type: ignore[valid-type]
        None,
        "basis of the static nonlinearity; null for the method's own: the rectifier in riv, else chebyshev",
    )
    degree: int = option(
        5, "number of basis functions (the rectifier has one, a spline four or more)", ge=1, le=30
    )

    @model_validator(mode="after")
    def _check_degree(self) -> Self:
        least = 1 if self.basis is None else BASES[self.basis].least_degree
        if self.degree < least:
            raise ValueError(
                f"degree: a {self.basis} basis needs a degree of at least {least}, got {self.degree}."
            )
        return self


class RectifierOptions(MethodOptions):
    """Options of methods that have the rectifier alone."""

    basis: Literal["rectifier"] | None = option(
        None, "static nonlinearity; null for the only one, the rectifier"
    )


def reference_option() -> Any:
    """The option of methods whose instruments are made of a reference."""
    return option(
        "reference",
        'variable that the load cannot reach: the command of the servo, or "position" in open loop',
    )


class RefinedOptions(MethodOptions):
    """Options of refined instrumental variables, of joints that change or do not."""

    order: Literal[2, 3] = option(2, "poles of the reflex dynamics (Eq. 2)")
    delay: float | None = option(None, "reflex delay; null estimates it", unit="s", ge=0, le=1)
    reference: str = reference_option()
    weighting: Literal["noise", "flat"] = option(
        "noise",
        "weights of frequencies: inverse of the noise, best where the model holds; or flat, if it simplifies",
    )
    tolerance: float = option(
        TOLERANCE,
        "what the model lacks, or a change within the record, is warned of where it may move a parameter by more than "
        "this share of it, and remarked else",
        gt=0,
        le=1,
    )


class Validity(NamedTuple):
    """Where a method is valid. In open loop with a reference every method is, if its paths need not be uncorrelated."""

    # Options that make it valid in closed loop; None where nothing does, or nothing is known to.
    closed: Mapping[str, Any] | None = None
    # Options that make it valid in open loop if the record has no reference.
    without_reference: Mapping[str, Any] = {}
    closed_fault: str = "it is biased in closed loop"  # without these options
    closed_caution: str = ""  # what to bear in mind where it is valid in closed loop
    open_caution: str = ""  # what to bear in mind where it is valid in open loop
    # Options with which it estimates the two paths one after the other, once, and is biased where they are correlated.
    one_pass: Mapping[str, Any] | None = None


UNKNOWN = Validity()  # of a method that says nothing: taken as valid in open loop only


class Offer(NamedTuple):
    """How `ankleloop identify` offers a method: with what suits a minute of a recording at the ankle.

    To its options come those that make it valid in the loop of the recording.
    """

    label: str
    options: Mapping[str, Any] = {}
    # Further options without a reference. Candidates of options that are selected there: the VAF of data that the fit
    # has not used tells them apart. With a reference a selection by instruments needs more than 20 s.
    options_without_reference: Mapping[str, Any] = {}
    candidates_without_reference: Mapping[str, Sequence[Any]] = {}
    changing: bool = False  # whether it is only for a joint that changes


def find_reference(options: Any) -> str | None:
    """Variable that the option `reference` names; None without one."""
    return getattr(options, "reference", None)


def prepare_records(method: Method, trial: Any, options: Any) -> list[PreparedTrial]:
    """A whole record, or each of a list of those that are merged; refuses a list that cannot be."""
    trials = prepare_trials(trial)
    if not isinstance(trial, (list, tuple)):
        return trials
    if not method.merges:
        raise DataError(
            f"{method.name} identifies one trial at a time: take riv, or a member of the MOESP family, which merge "
            "trials."
        )
    if not trials:
        raise DataError("there are no trials to merge.")
    refuse_repeated_trials(trials)
    refuse_other_rates(trials)
    return trials


def check_records(method: Method, trials: Sequence[PreparedTrial], options: Any) -> list[str]:
    """Warnings about whole records (`check_data`); refuses those of which the filters leave too little to merge."""
    if len(trials) > 1 and method.least:  # a single one is refused for what it does not show
        _check_lengths(method, trials, options)
    reference = method.reference(options)
    judged = method.judges_reference and reference not in (None, "position")
    return check_data(trials, reference, judged=judged, **_data_use(options))


def _check_lengths(method: Method, trials: Sequence[PreparedTrial], options: Any) -> None:
    """Refuse trials of which the filters leave too little."""
    rate = trials[0].rate
    delay = NOMINAL_DELAY if options.delay is None else options.delay
    needed = method.least + filtered_duration(rate, options.identification_rate, delay)
    for number, trial in enumerate(trials, 1):
        duration = trial.time.size / rate
        if duration < needed:
            raise DataError(
                f"trial {number} of {len(trials)} is too short to be merged by {method.name}: it has "
                f"{duration:.3g} s, and each has to last {ceil(10.0 * needed) / 10.0:g} s or more. Short windows "
                "around perturbations are for the method ensemble."
            )


@dataclass(frozen=True, eq=False)
class Method:
    """A method under its name.

    Calling it with a trial and options by name identifies; see `ankleloop.identify`, whose errors it raises. It
    prepares the data, checks them, and calls its function. Preparation and checks are those of whole records unless it
    names others.

    Parameters
    ----------
    name : str
    options : type of Options
    identify : callable
        ``identify(trial, options)`` gives the estimate of a prepared trial. For a method that merges,
        ``identify(trials, options)`` gives that of a sequence of prepared trials, which may be a single one.
    reference : callable, optional
        ``reference(options)`` names the variable whose leads or lags are instruments, or is None if there are none;
        by default the option `reference`.
    merges : bool
        Whether it merges several trials into one identification.
    least : float
        Time of each of several trials that has to be left beside the filters [s].
    judges_reference : bool
        Whether it refuses a reference that is too weak, and a torque that does not answer it, by itself.
    skips_gaps : bool
        Whether it leaves out gaps of the record that were filled.
    validity : Validity
        In which loop it is valid, and with which options; by default it is not known to be valid in closed loop.
    offer : Offer, optional
        How `ankleloop identify` offers it; None where it does not.
    prepare : callable
        ``prepare(method, trial, options)`` gives the prepared trials of what is identified, or refuses it.
    check : callable
        ``check(method, trials, options)`` gives warnings about the data of prepared trials, or refuses them.
    of_device : bool
        Whether it identifies a device without a subject, and no joint.
    subtracts : bool
        Whether it takes trials of which an apparatus is subtracted, and adds the covariance of that to its own.

    Examples
    --------
    >>> from ankleloop import METHODS, simulate
    >>> METHODS["riv"].merges, METHODS["parallel-cascade"].merges
    (True, False)
    >>> METHODS["pr-moesp"].validity.closed
    {'input_matrices': 'instruments'}
    >>> METHODS["pr-moesp"](simulate(seed=1, duration=20.0), basis="rectifier").method
    'pr-moesp'
    """

    name: str
    options: type[Options]
    identify: Callable[[Any, Any], Any]
    reference: Callable[[Any], str | None] = find_reference
    merges: bool = False
    least: float = 0.0
    judges_reference: bool = False
    skips_gaps: bool = False
    validity: Validity = UNKNOWN
    offer: Offer | None = None
    prepare: Callable[[Method, Any, Any], list[PreparedTrial]] = prepare_records
    check: Callable[[Method, Sequence[PreparedTrial], Any], list[str]] = check_records
    of_device: bool = False
    subtracts: bool = False

    def __call__(self, trial: Trial | Sequence[Trial], **options: Any) -> Estimate:
        """Identify a trial, or a list of trials that are merged into one estimate."""
        chosen = self.options.parse(f"method {self.name!r}", **options)
        trials = self.prepare(self, trial, chosen)
        _check_apparatus(self, trials)
        if isinstance(chosen, MethodOptions):
            chosen = chosen.at_rate(trials[0].rate)
        data_warnings = self.check(self, trials, chosen)
        estimate = self.identify(trials if self.merges else trials[0], chosen)
        diagnostics = dict(estimate.diagnostics)
        assumptions = _list_assumptions(chosen, self.reference(chosen))
        diagnostics["assumptions"] = [*diagnostics.get("assumptions", ()), *assumptions]
        faults = _list_faults(estimate, self)
        if self.takes_records and not self.skips_gaps:
            faults += [text for text in list_gaps(trials) if text not in data_warnings]
        diagnostics["warnings"] = [*diagnostics.get("warnings", ()), *faults, *data_warnings]
        omitted = _list_omitted(trials, skips_gaps=self.skips_gaps)
        diagnostics["remarks"] = [*diagnostics.get("remarks", ()), *omitted]
        if data_warnings:
            diagnostics["data_warnings"] = data_warnings
        diagnostics["options"] = chosen.model_dump(exclude_defaults=True)
        if not self.holds_in_closed_loop(chosen):
            diagnostics["holds"] = "in open loop"
        torque = estimate.torque
        if MEASURED not in torque:  # those that are means over trials have it
            torque = add_measured(torque, trials)
        return replace(estimate, method=self.name, torque=torque, diagnostics=diagnostics)

    @property
    def takes_records(self) -> bool:
        """Whether it takes whole records, and no windows or other kind of data."""
        return self.prepare is prepare_records

    def holds_in_closed_loop(self, options: Options) -> bool:
        """Whether an estimate with some options is valid where torque is fed back."""
        needed = self.validity.closed
        if needed is None or self.reference(options) == "position":
            return False
        return all(getattr(options, name) == value for name, value in needed.items())


def _check_apparatus(method: Method, trials: Sequence[PreparedTrial]) -> None:
    """Refuse trials that are less an apparatus, or less several ones, where the method does not know of it."""
    carried = {trial.apparatus and trial.apparatus.fingerprint for trial in trials}
    if carried == {None}:
        return
    if not method.subtracts:
        raise DataError(
            f"the trial is {trials[0].apparatus}, and {method.name} does not know how uncertain that is: take riv or "
            "riv-tv."
        )
    if len(carried) > 1:
        raise DataError(
            "the trials are less different apparatuses, or some of them less none: subtract the same one of all that "
            "are merged."
        )


def _list_assumptions(options: Any, reference: str | None) -> list[str]:
    """What the options take for granted; nothing in the record has to speak against it."""
    assumptions = []
    if reference is None:
        assumptions.append(
            "the loop is open: no reference is used, so torque that is fed back biases K, B, I and G."
        )
    elif reference == "position":
        assumptions.append("the loop is open: the position is its own reference.")
    elif getattr(options, "input_matrices", None) == "least-squares":
        assumptions.append("little torque is fed back: K, B and I are fitted by least squares.")
    if getattr(options, "delay", None) is not None:
        assumptions.append(f"the reflex delay is {1000 * options.delay:g} ms.")
    return assumptions


def _data_use(options: Any) -> dict[str, Any]:
    """What a method takes from its data under its options; what they do not have is as in `check_data`."""
    given = options.model_dump(
        include={"delay", "identification_rate", "order", "block_rows"}, exclude_none=True
    )
    if "block_rows" in given:
        given.setdefault("order", (options.block_rows - 1) // 2)  # the largest that may be chosen
    return given


def _list_omitted(trials: Sequence[PreparedTrial], *, skips_gaps: bool) -> list[str]:
    """Remarks about noise and filled gaps that are left out."""
    remarks = []
    for number, trial in enumerate(trials, 1):
        place = name_trial(number, len(trials))
        noise = trial.velocity_noise
        if noise and noise.dominates:
            remarks.append(f"{place}{describe_noise(noise)}, which is left out of it.")
        gaps = [
            f"{len(trial.gaps(name))} of the {name}" for name in REQUIRED if len(trial.gaps(name))
        ]
        if gaps and skips_gaps:
            remarks.append(
                f"{place}gaps were filled by the last value or a line, {' and '.join(gaps)}: they are left out, with "
                f"{GAP_MEMORY:g} s after each."
            )
    return remarks


def _list_faults(estimate: Estimate, method: Method) -> list[str]:
    """Warnings about parameters that are no numbers, or that no joint has with twice their interval.

    Chance alone puts one of forty intervals of a value that is nearly zero below it. A device may be of any size, and
    be pulled away from where it stands; it has no negative inertia or viscosity.
    """
    values = estimate.values
    warnings = []
    missing = [name for name, value in values.items() if not isfinite(value)]
    if missing:
        warnings.append(f"{', '.join(missing)} could not be computed: do not use this estimate.")
    for name, value in values.items():
        quantity = QUANTITIES.get(name)
        is_given = name == "delay" and name not in estimate.intervals
        if quantity is None or is_given:
            continue
        least, most = quantity.plausible
        subject = "joint"
        if method.of_device:
            subject = "device"
            least, most = (-inf if name == "K" else least), inf
        low, high = estimate.intervals.get(name, (value, value))
        margin = 0.5 * (high - low)
        if high + margin < least or low - margin > most:
            fault = f"not within {least:g} … {most:g}"
            if value < 0:
                fault = f"negative, which no {subject} has"
            warnings.append(
                f"{name} = {value:.3g} {quantity.unit} is {fault}: check signs, units and rate."
            )
    return warnings
