"""The MOESP family on the joint: regressors in, intrinsic and reflex torque out.

Its members differ in their instruments and in the form of their projection, so they share one body.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, Literal, Self, get_args

import numpy as np
from pydantic import model_validator

from ankleloop.joint.estimate import Estimate
from ankleloop.joint.hammerstein import DriveSpectra, ReflexPath, separate_path
from ankleloop.joint.models import ModelInputs, StateSpaceModel, simulate_torques
from ankleloop.joint.prepared import PreparedTrial, make_regressors
from ankleloop.joint.regressors import MOTION, InputStep, Regressors, merge_torques
from ankleloop.methods.method import (
    POSITION,
    BasisOptions,
    KnownDelayOptions,
    Method,
    Offer,
    Validity,
)
from ankleloop.options import option
from ankleloop.quantities import STIFFNESS
from ankleloop.subspace.moesp import SubspaceEstimate, moesp
from ankleloop.subspace.sources import SubspaceOptions, check_rows

# With free_b the responses to position, velocity, acceleration and delayed velocity are nearly dependent, and least
# squares would give torques that are huge and cancel. Without it the regression is far from this (condition below 100).
REGRESSION_TOLERANCE = 1e-3

# Instruments, and the form of the projection unless another one is chosen.
MEMBERS = {
    "pr-moesp": ("past-reference", "ordinary"),
    "pi-moesp": ("past-input", "ordinary"),
    "po-moesp": ("past-input-output", "ordinary"),
    "eiv-moesp": ("past-input-output", "correlation"),
    "moesp": ("none", "ordinary"),
}
OmittedStep = Literal[InputStep, "rank-policy", "scaling", "mean-removal"]
OMITTED_STEPS: tuple[OmittedStep, ...] = get_args(OmittedStep)

# Options by which `ankleloop.subspace.moesp.moesp` leaves out the steps that are its own.
SUBSPACE_OPTIONS: Mapping[OmittedStep | None, dict[str, Any]] = {
    "rank-policy": {"rank_tolerance": 0.0, "regression_tolerance": 0.0},
    "scaling": {"scaling": False},
    "mean-removal": {"offsets": False},
}
# Options that regressors are made by.
INPUTS = {"delay", "degree", "identification_rate"}


class MoespOptions(KnownDelayOptions, BasisOptions):
    """Options of the MOESP family."""

    order: int | None = option(
        2, "order of the reflex; null: largest drop of the singular values", ge=1, le=20
    )
    block_rows: int = option(15, "block rows of the Hankel matrices", unit="samples", ge=3, le=200)
    projection: Literal["ordinary", "correlation"] | None = option(
        None,
        "form of the projection; null for the method's own (correlation for eiv-moesp, else ordinary)",
    )
    instrument_rows: int | None = option(
        None,
        "block rows of the instruments; null for what the form needs",
        unit="samples",
        ge=1,
        le=1000,
    )
    instrument_leads: int = option(
        0,
        "block rows by which the reference of pr-moesp reaches into the future as well",
        unit="samples",
        ge=0,
        le=200,
    )
    # A delayed velocity among the basis functions repeats rows of the velocity up to the accuracy of the decimation,
    # which is the default: smaller directions are errors of the filters.
    rank_tolerance: float = option(
        1e-5, "singular values below this fraction of the largest one count as zero", ge=0, lt=1
    )
    input_matrices: Literal["least-squares", "instruments"] = option(
        "least-squares", "how B and D are estimated; torque that is fed back biases least squares"
    )
    reference: str = option(
        "reference", 'variable that serves as reference; "position" for open-loop records'
    )
    free_b: bool = option(False, "let position, velocity and acceleration drive the state as well")
    omitted_step: OmittedStep | None = option(
        None,
        "step of the processing to leave out, to see what it is good for; null for the complete processing",
    )

    @model_validator(mode="after")
    def _check_rows(self) -> Self:
        check_rows(self.block_rows, self.order, self.instrument_leads)
        return self


def identify_moesp(
    trials: Sequence[PreparedTrial], options: MoespOptions, *, member: str = "pr-moesp"
) -> Estimate:
    r"""Separate intrinsic and reflex torque by a member of the MOESP family.

    The net torque is the output of one linear model (Eq. 11) whose inputs are position, velocity and acceleration,
    which act at once through K, B and I, and basis functions of the delayed velocity, which drive the reflex:

    .. math:: x(t+1) = A x(t) + [0 \; \tilde B] \begin{bmatrix} U_i \\ U_r \end{bmatrix}, \qquad
              TQ = C x(t) + [K \; B \; I \; \tilde D] \begin{bmatrix} U_i \\ U_r \end{bmatrix}

    Simulating the model with one group of inputs at a time gives the two torques (Section III of the paper).

    Parameters
    ----------
    trials : sequence of PreparedTrial
        One trial, or several of one joint: they are merged, with an initial state of their own each.
    options : MoespOptions
    member : {"pr-moesp", "eiv-moesp", "pi-moesp", "po-moesp", "moesp"}
        Past reference (Zhao, Ludvig and Kearney, ACC 2008), past input and output in correlation form (Chou and
        Verhaegen 1997), past input (Verhaegen 1993), past input and output (Verhaegen 1994), or no instruments
        (Verhaegen and Dewilde 1992).

    Returns
    -------
    Estimate

    Examples
    --------
    >>> from ankleloop.methods.registry import identify
    >>> from ankleloop.simulation.simulate import simulate
    >>> trial = simulate(seed=1, duration=20.0, snr_db=None, voluntary=0.0)
    >>> estimate = identify(trial, "pr-moesp", basis="rectifier")
    >>> bool(abs(estimate.stiffness["K"] - 150) < 1)
    True
    """
    reference = _find_reference(member, options)
    regressors = _make_regressors(trials, options, reference)
    model = _fit_model(trials, regressors, options, member)
    path = separate_reflex(model, regressors)
    inputs = ModelInputs.of(regressors[0])
    matrices = inputs.label(model.matrices)
    states = _find_states(model, regressors, options)
    torques = [
        simulate_torques(model.matrices, state, part)
        for part, state in zip(regressors, states, strict=True)
    ]
    values = matrices.D[0, :MOTION]  # they act at once
    if options.free_b:
        pairs = zip(regressors, torques, strict=True)
        fits = [part.fit_stiffness(torque["intrinsic"].values) for part, torque in pairs]
        values = np.mean([[*fit.values()] for fit in fits], axis=0)
    return Estimate(
        method=member,
        torque=merge_torques(torques),
        stiffness=dict(zip(STIFFNESS, values.tolist(), strict=True)),
        reflex={"delay": inputs.delay, **path.valid_parameters},
        diagnostics=_describe_fit(options, model, path, reference),
        predictor=StateSpaceModel(inputs, matrices, states[0]),
    )


def _make_regressors(
    trials: Sequence[PreparedTrial], options: MoespOptions, reference: str | None
) -> list[Regressors]:
    """Regressors of each trial."""
    inputs = options.model_dump(include=INPUTS)
    if options.omitted_step in get_args(InputStep):
        inputs["omitted_step"] = options.omitted_step
    return make_regressors(
        trials, basis=options.basis or "chebyshev", reference=reference, **inputs
    )


def _fit_model(
    trials: Sequence[PreparedTrial],
    regressors: Sequence[Regressors],
    options: MoespOptions,
    member: str,
) -> SubspaceEstimate:
    """The linear model of all trials (Eq. 11)."""
    arguments = subspace_arguments(options, regressors[0], member)
    arguments |= SUBSPACE_OPTIONS.get(options.omitted_step, {})
    if options.free_b:
        arguments["dynamic"] = None
    if options.input_matrices == "instruments":
        pairs = zip(trials, regressors, strict=True)
        arguments["predicted_inputs"] = [trial.predict_inputs(part) for trial, part in pairs]
    if regressors[0].reference is not None:
        arguments["reference"] = [part.reference for part in regressors]
    return moesp(
        [part.inputs for part in regressors],
        [part.torque for part in regressors],
        **arguments,
    )


def subspace_arguments(
    options: MoespOptions, regressors: Regressors, member: str
) -> dict[str, Any]:
    """Arguments of `ankleloop.subspace.moesp` beside the data."""
    instruments, projection = MEMBERS[member]
    return {
        **options.model_dump(include=set(SubspaceOptions.model_fields)),
        "instruments": instruments,
        "projection": options.projection or projection,
        "dt": 1.0 / options.identification_rate,
        "dynamic": regressors.reflex,
        "regression_tolerance": REGRESSION_TOLERANCE,
    }


def separate_reflex(model: SubspaceEstimate, regressors: Sequence[Regressors]) -> ReflexPath:
    """Nonlinearity and dynamics of the reflex path; the low-pass has a third pole where the model has three."""
    first = regressors[0]
    drives = [part.centred[1] for part in regressors]
    spectra = DriveSpectra.of(np.concatenate(drives), first.rate)
    response = model.matrices.frequency_response(np.exp(spectra.s / first.rate))
    order = 3 if len(model.matrices.A) == 3 else 2
    return separate_path(response[:, first.reflex], spectra, first.basis, order)


def _find_states(
    model: SubspaceEstimate, regressors: Sequence[Regressors], options: MoespOptions
) -> np.ndarray:
    """State at the first sample of each trial, shape (trials, n)."""
    states = np.atleast_2d(model.initial_state)
    if options.omitted_step != "mean-removal":
        return states
    A = model.matrices.A
    mean_inputs = np.array([part.inputs.mean(axis=0) for part in regressors])
    rest_inputs = model.matrices.B @ mean_inputs.T
    # Less the state of rest under the mean inputs.
    return states - np.linalg.solve(np.eye(len(A)) - A, rest_inputs).T


def _describe_fit(
    options: MoespOptions, model: SubspaceEstimate, path: ReflexPath, reference: str | None
) -> dict[str, Any]:
    """Diagnostics of a model."""
    diagnostics = {"singular_values": model.singular_values, **model.diagnostics}
    diagnostics |= path.diagnostics
    if path.basis.caution:
        diagnostics["assumptions"] = [path.basis.caution]
    if reference is not None:
        diagnostics["reference"] = reference
    if options.omitted_step is not None:
        warnings = model.diagnostics["warnings"]
        diagnostics["warnings"] = [*warnings, describe_omission(options.omitted_step)]
    return diagnostics


def describe_omission(step: OmittedStep) -> str:
    """Warning about an estimate whose processing is not complete."""
    return f"The processing is not complete (omitted_step: {step})."


def _find_reference(member: str, options: MoespOptions) -> str | None:
    """The reference; None for members that have no use for one, and take a trial that has none."""
    instruments, _ = MEMBERS[member]
    if instruments == "past-reference" or options.input_matrices == "instruments":
        return options.reference
    return None


INSTRUMENTS = {"input_matrices": "instruments"}
SUBSPACE_POLES = (
    "in closed loop its B and D are estimated by instruments, but its poles by a subspace step that is not consistent "
    "there: compare K with that of riv (the study voluntary measures its error)."
)
WHITE_NOISE = "it assumes white noise: voluntary torque biases its poles, and with them K, B and I."
BY_INSTRUMENTS = Validity(
    closed=INSTRUMENTS,
    closed_fault="least squares for B and D is biased in closed loop",
    closed_caution=SUBSPACE_POLES,
)


def _member(name: str, validity: Validity, offer: Offer | None = None) -> Method:
    """A member of the family as a method."""
    return Method(
        name,
        MoespOptions,
        partial(identify_moesp, member=name),
        partial(_find_reference, name),
        merges=True,
        validity=validity,
        offer=offer,
    )


METHODS = (
    _member(
        "pr-moesp",
        BY_INSTRUMENTS._replace(without_reference=POSITION),
        Offer("PR-MOESP", {"degree": 8, "block_rows": 20}),
    ),
    _member(
        "pi-moesp",
        BY_INSTRUMENTS,
        Offer(
            "PI-MOESP (spline)",  # a spline takes a rectifier with or without a threshold
            {"block_rows": 20, "basis": "spline", "degree": 8},
            candidates_without_reference={"degree": [6, 8, 12]},
        ),
    ),
    _member("po-moesp", BY_INSTRUMENTS),
    _member("eiv-moesp", BY_INSTRUMENTS._replace(open_caution=WHITE_NOISE)),
    _member("moesp", Validity(open_caution=WHITE_NOISE)),
)
