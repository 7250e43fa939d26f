"""The MOESP family on the joint: regressors in, intrinsic and reflex torque out.

Its members differ in their instruments and in the form of their projection, so they share one body.
"""

from dataclasses import dataclass

import numpy as np

from ankleloop.errors import DataError
from ankleloop.joint.estimate import Estimate, torque_dataset
from ankleloop.joint.hammerstein import separate
from ankleloop.joint.regressors import INTRINSIC_NAMES, build_regressors, predicted_inputs, shared_basis
from ankleloop.subspace.input_matrices import response
from ankleloop.subspace.moesp import moesp

__all__ = ["MEMBERS", "REGRESSION_TOLERANCE", "direct_stiffness", "identify_moesp", "reflex_path", "torques"]

# With free_b the responses to position, velocity, acceleration and delayed velocity are nearly dependent, and least
# squares would give torques that are huge and cancel. Without it the regression is far from this (condition below 100).
REGRESSION_TOLERANCE = 1e-3

# Instruments, and the form of the projection unless another one is asked for.
MEMBERS = {
    "pr-moesp": ("past-reference", "ordinary"),
    "eiv-moesp": ("past-input-output", "correlation"),
    "pi-moesp": ("past-input", "ordinary"),
    "po-moesp": ("past-input-output", "ordinary"),
    "moesp": ("none", "ordinary"),
}


def identify_moesp(
    trial,
    *,
    method="pr-moesp",
    order=2,
    block_rows=15,
    delay=0.04,
    basis=None,
    degree=5,
    identification_rate=100.0,
    input_matrices="least-squares",
    projection=None,
    instrument_rows=None,
    instrument_leads=0,
    reference="reference",
    free_b=False,
    rank_tolerance=1e-5,
):
    r"""Separate intrinsic and reflex torque by a member of the MOESP family.

    The net torque is the output of one linear model (Eq. 11) whose inputs are position, velocity and acceleration,
    which act at once through K, B and I, and basis functions of the delayed velocity, which drive the reflex:

    .. math:: x(t+1) = A x(t) + [0 \; \tilde B] \begin{bmatrix} U_i \\ U_r \end{bmatrix}, \qquad
              TQ = C x(t) + [K \; B \; I \; \tilde D] \begin{bmatrix} U_i \\ U_r \end{bmatrix}

    Simulating the model with one group of inputs at a time gives the two torques (Section III of the paper).

    Parameters
    ----------
    trial : xarray.Dataset, or list of those
        The trial; several are merged into one identification, without a joint across their seams.
    method : {"pr-moesp", "eiv-moesp", "pi-moesp", "po-moesp", "moesp"}
        Past reference (Zhao, Ludvig and Kearney, ACC 2008), past input and output in correlation form (Chou and
        Verhaegen 1997), past input (Verhaegen 1993), past input and output (Verhaegen 1994), or no instruments
        (Verhaegen and Dewilde 1992).
    order : int or None
        Order of the reflex dynamics; None takes it from the largest drop of the singular values.
    block_rows : int
        Block rows of the future Hankel matrices.
    delay : float
        Reflex delay [s].
    basis : {"chebyshev", "rectifier", "spline"}, optional
        Basis of the static nonlinearity, "chebyshev" by default.
    degree : int
        Number of its terms (the rectifier has one).
    identification_rate : float
        Rate of the identification [Hz]; the sampling rate has to be a multiple of it.
    input_matrices : {"least-squares", "instruments"}
        How B and D are found: least squares is biased by torque that is fed back; instruments are rebuilt from the
        position that the reference predicts.
    projection : {"ordinary", "correlation"}, optional
        Form of the projection; "correlation" for EIV-MOESP and "ordinary" for the others by default.
    instrument_rows : int, optional
        Block rows of the instruments; `block_rows`, or as many as the correlation form needs, by default.
    instrument_leads : int
        Block rows by which the reference of PR-MOESP reaches into the future as well.
    reference : str
        Variable that serves as reference; "position" for open-loop records.
    free_b : bool
        Let position, velocity and acceleration drive the state as well. D alone is not K, B and I then: they are those
        of the second-order model that explains the intrinsic torque best.
    rank_tolerance : float
        Rank policy of the projection: smaller singular values, relative to the largest, count as zero. The default
        is the accuracy of the decimation: a delayed velocity among the basis functions repeats rows of the velocity
        up to that, so smaller directions are errors of the filters.

    Returns
    -------
    Estimate, or list of those
        One for each trial where several were merged: the model is the same, the torques are those of the trial.

    Raises
    ------
    DataError
        If the record is unusable, too short, or lacks the reference that the method needs.

    Examples
    --------
    >>> from ankleloop.simulation import simulate
    >>> trial = simulate(seed=1, duration=20.0, snr_db=None, voluntary=0.0)
    >>> estimate = identify_moesp(trial, method="pr-moesp", basis="rectifier")
    >>> bool(abs(estimate.stiffness["K"] - 150) < 1)
    True
    """
    several = isinstance(trial, (list, tuple))
    trials = list(trial) if several else [trial]
    if not trials:
        raise DataError("there are no trials to merge.")
    instruments, usual_projection = MEMBERS[method]
    # Members that have no use for a reference take a trial that has none.
    needed = instruments == "past-reference" or input_matrices == "instruments"
    settled = shared_basis(trials, delay, basis or "chebyshev", degree) if several else basis or "chebyshev"
    regressors = [
        build_regressors(
            one,
            delay=delay,
            basis=settled,
            degree=degree,
            identification_rate=identification_rate,
            reference=reference if needed else None,
        )
        for one in trials
    ]
    first = regressors[0]
    predicted = None
    if input_matrices == "instruments":
        predicted = [predicted_inputs(one, part, delay) for one, part in zip(trials, regressors, strict=True)]

    def signals(parts):
        """One record as it is, several as a list of data batches."""
        return None if parts is None or parts[0] is None else parts if several else parts[0]

    found = moesp(
        signals([part.inputs for part in regressors]),
        signals([part.torque for part in regressors]),
        block_rows,
        order,
        instruments,
        projection or usual_projection,
        signals([part.reference for part in regressors]),
        dt=1.0 / first.rate,
        instrument_rows=instrument_rows,
        instrument_leads=instrument_leads,
        input_matrices=input_matrices,
        dynamic=None if free_b else first.reflex,
        predicted_inputs=signals(predicted),
        rank_tolerance=rank_tolerance,
        regression_tolerance=REGRESSION_TOLERANCE,
        names=(first.names, ("torque",)),
    )
    diagnostics = {"singular_values": found.singular_values, **found.diagnostics}
    if needed:
        diagnostics["reference"] = reference
    path = reflex_path(found.matrices, regressors)
    estimates = []
    for part, start in zip(regressors, np.atleast_2d(found.initial_state), strict=True):
        torque = _torques(found.matrices, start, part)
        estimates.append(
            Estimate(
                method=method,
                torque=torque,
                matrices=found.matrices,
                stiffness=part.stiffness(torque["intrinsic"].values) if free_b else direct_stiffness(found.matrices),
                reflex={"delay": float(delay), **path.parameters},
                diagnostics=diagnostics | path.diagnostics,
                predictor=_Predictor(found.matrices, part.basis, delay),
            )
        )
    return estimates if several else estimates[0]


@dataclass(frozen=True)
class _Predictor:
    """Torques of another trial by the same model."""

    matrices: object
    basis: object
    delay: float

    def __call__(self, trial):
        rate = 1.0 / self.matrices.dt
        regressors = build_regressors(trial, delay=self.delay, basis=self.basis, identification_rate=rate)
        return _torques(self.matrices, None, regressors)


def direct_stiffness(model):
    """K, B and I, through which position, velocity and acceleration act at once (Eq. 11)."""
    return dict(zip("KBI", map(float, model.D[0, : len(INTRINSIC_NAMES)]), strict=True))


def torques(model, initial_state, regressors):
    """Torques of the model with the inputs of one path at a time; the initial state belongs to the reflex.

    Parameters
    ----------
    model : Matrices
        The model, in physical units.
    initial_state : ndarray, shape (n,), or None
        Rest, if None.
    regressors : Regressors
        Its inputs.

    Returns
    -------
    dict of str to ndarray, shape (N,)
        `net`, `intrinsic` and `reflex` [N·m], without their means.

    Raises
    ------
    DataError
        If they are not finite.
    """
    motion, drive = regressors.centred_inputs
    paths = {}
    for name, u, used, start in (
        ("intrinsic", motion, ~regressors.reflex, None),
        ("reflex", drive, regressors.reflex, initial_state),
    ):
        of_path = model.of_inputs(used)
        if start is None and not of_path.B.any():
            torque = u @ of_path.D[0]
        else:
            torque = response(of_path.A, of_path.B, of_path.C, of_path.D, u, start)[:, 0]
        paths[name] = torque - torque.mean()
    if not all(np.all(np.isfinite(torque)) for torque in paths.values()):
        raise DataError("the estimated torques are not finite: the model does not suit the record; lower its order.")
    return {"net": paths["intrinsic"] + paths["reflex"], **paths}


def _torques(model, initial_state, regressors):
    return torque_dataset(regressors.time, regressors.rate, **torques(model, initial_state, regressors))


def reflex_path(matrices, regressors):
    """Nonlinearity and dynamics; the low-pass has a third pole where the model has three."""
    parts = [part.centred_inputs[1] for part in regressors]
    inputs = parts[0] if len(parts) == 1 else np.concatenate(parts)
    of_path = matrices.of_inputs(regressors[0].reflex)
    return separate(of_path, inputs, regressors[0].basis, 3 if len(matrices.A) == 3 else 2)
