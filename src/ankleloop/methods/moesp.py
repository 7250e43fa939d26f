"""The MOESP family on the joint: regressors in, intrinsic and reflex torque out.

Its members differ in their instruments and in the form of their projection, so they share one body.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, Literal, get_args

import numpy as np
import xarray as xr

from ankleloop.joint.bases import BASES
from ankleloop.joint.estimate import Estimate
from ankleloop.joint.hammerstein import DriveSpectra, ReflexPath, separate_path
from ankleloop.joint.models import ModelInputs, StateSpaceModel, simulate_torques
from ankleloop.joint.prepared import PreparedTrial
from ankleloop.joint.regressors import MOTION, InputStep, Regressors
from ankleloop.methods.method import INPUTS, BasisOptions, KnownDelayOptions, Method
from ankleloop.options import option
from ankleloop.quantities import STIFFNESS
from ankleloop.subspace.moesp import SubspaceEstimate, moesp

# With free_b the responses to position, velocity, acceleration and delayed velocity are nearly dependent, and least
# squares would give torques that are huge and cancel. Without it the regression is far from this (condition below 100).
REGRESSION_TOLERANCE = 1e-3

# Instruments, and the form of the projection unless another one is chosen.
MEMBERS = {
    "pr-moesp": ("past-reference", "ordinary"),
    "eiv-moesp": ("past-input-output", "correlation"),
    "pi-moesp": ("past-input", "ordinary"),
    "po-moesp": ("past-input-output", "ordinary"),
    "moesp": ("none", "ordinary"),
}
OmittedStep = Literal[
    "kernel-derivatives", "early-nonlinearity", "rank-policy", "scaling", "mean-removal"
]

OMITTED_STEPS: tuple[OmittedStep, ...] = get_args(OmittedStep)

# Options by which `ankleloop.subspace.moesp.moesp` leaves out the steps that are its own.
SUBSPACE_OPTIONS: Mapping[OmittedStep | None, dict[str, Any]] = {
    "rank-policy": {"rank_tolerance": 0.0, "regression_tolerance": 0.0},
    "scaling": {"scaling": False},
    "mean-removal": {"offsets": False},
}


class MoespModelOptions(KnownDelayOptions, BasisOptions):
    """Options of the model of the MOESP family, for records of any length."""

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


class MoespOptions(MoespModelOptions):
    """Options of the MOESP family."""

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


def identify_moesp(
    trials: Sequence[PreparedTrial], options: MoespOptions, *, member: str = "pr-moesp"
) -> list[Estimate]:
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
    list of Estimate
        One for each trial.

    Examples
    --------
    >>> from ankleloop.methods.registry import identify
    >>> from ankleloop.simulation.simulate import simulate
    >>> trial = simulate(seed=1, duration=20.0, snr_db=None, voluntary=0.0)
    >>> estimate = identify(trial, "pr-moesp", basis="rectifier")
    >>> bool(abs(estimate.stiffness["K"] - 150) < 1)
    True
    """
    reference, step = _find_reference(member, options), options.omitted_step
    inputs = options.model_dump(include=INPUTS) | {
        "basis": options.basis or "chebyshev",
        "reference": reference,
    }
    if len(trials) > 1:
        velocity = np.concatenate([trial.velocity(options.delay) for trial in trials])
        inputs["basis"] = BASES[inputs["basis"]].fit(velocity, options.degree)
    if step in get_args(InputStep):
        inputs["omitted_step"] = step
    regressors = [trial.regressors(**inputs) for trial in trials]
    arguments = subspace_arguments(options, regressors[0], member) | SUBSPACE_OPTIONS.get(step, {})
    if options.free_b:
        arguments["dynamic"] = None
    if options.input_matrices == "instruments":
        pairs = zip(trials, regressors, strict=True)
        arguments["predicted_inputs"] = [trial.predict_inputs(part) for trial, part in pairs]
    if reference is not None:
        arguments["reference"] = [part.reference for part in regressors]
    signals = [part.inputs for part in regressors], [part.torque for part in regressors]
    model = moesp(*signals, input_matrices=options.input_matrices, **arguments)
    diagnostics: dict[str, Any] = {} if reference is None else {"reference": reference}
    if step is not None:
        diagnostics["warnings"] = [*model.diagnostics["warnings"], describe_omission(step)]
    path, estimates = separate_reflex(model, regressors), []
    for part, state in zip(regressors, np.atleast_2d(model.initial_state), strict=True):
        if step == "mean-removal":  # less the state of rest under constant inputs
            A, B = model.matrices.A, model.matrices.B
            state = state - np.linalg.solve(np.eye(len(A)) - A, B @ part.inputs.mean(axis=0))
        torque = simulate_torques(model.matrices, state, part)
        estimate = describe_model(member, model, part, state, path, torque)
        estimate.diagnostics.update(diagnostics)
        if options.free_b:
            estimate.stiffness.update(part.fit_stiffness(torque["intrinsic"].values))
        estimates.append(estimate)
    return estimates


def subspace_arguments(
    options: MoespModelOptions, regressors: Regressors, member: str
) -> dict[str, Any]:
    """Arguments of `ankleloop.subspace.moesp` beside the data."""
    instruments, projection = MEMBERS[member]
    return {
        **options.model_dump(
            include={"block_rows", "order", "instrument_rows", "instrument_leads", "rank_tolerance"}
        ),
        "instruments": instruments,
        "projection": options.projection or projection,
        "dt": 1.0 / options.identification_rate,
        "dynamic": regressors.reflex,
        "regression_tolerance": REGRESSION_TOLERANCE,
    }


def separate_reflex(model: SubspaceEstimate, regressors: Sequence[Regressors]) -> ReflexPath:
    """Nonlinearity and dynamics of the reflex path; the low-pass has a third pole where the model has three."""
    first = regressors[0]
    spectra = DriveSpectra.of(np.concatenate([part.centred[1] for part in regressors]), first.rate)
    order = 3 if len(model.matrices.A) == 3 else 2
    reflex = model.matrices.select_inputs(first.reflex)
    return separate_path(
        reflex.frequency_response(np.exp(spectra.s / first.rate)), spectra, first.basis, order
    )


def describe_model(
    member: str,
    model: SubspaceEstimate,
    part: Regressors,
    state: np.ndarray,
    path: ReflexPath,
    torque: xr.Dataset,
) -> Estimate:
    """Estimate of a model, with K, B and I, through which position, velocity and acceleration act at once (Eq. 11)."""
    inputs = ModelInputs.of(part)
    matrices = inputs.label(model.matrices)
    diagnostics = {
        "singular_values": model.singular_values,
        **model.diagnostics,
        **path.diagnostics,
    }
    if inputs.basis.caution:
        diagnostics["assumptions"] = [inputs.basis.caution]
    return Estimate(
        method=member,
        torque=torque,
        stiffness=dict(zip(STIFFNESS, matrices.D[0, :MOTION].tolist(), strict=True)),
        reflex={"delay": inputs.delay, **path.valid_parameters},
        diagnostics=diagnostics,
        predictor=StateSpaceModel(inputs, matrices, state),
    )


def _find_reference(member: str, options: MoespOptions) -> str | None:
    """The reference; None for members that have no use for one, and take a trial that has none."""
    instruments = MEMBERS[member][0]
    return (
        options.reference
        if instruments == "past-reference" or options.input_matrices == "instruments"
        else None
    )


METHODS = tuple(
    Method(
        name,
        MoespOptions,
        partial(identify_moesp, member=name),
        partial(_find_reference, name),
        merges=True,
    )
    for name in MEMBERS
)


def describe_omission(step: OmittedStep) -> str:
    """Warning about an estimate whose processing is not complete."""
    return f"The processing is not complete (omitted_step: {step})."
