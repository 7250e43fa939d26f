"""The MOESP family on any linear data set: one body, the members differ in their instruments."""

from dataclasses import dataclass, field

import numpy as np

from ankleloop.errors import DataError
from ankleloop.subspace.hankel import block_hankel
from ankleloop.subspace.input_matrices import estimate_input_matrices
from ankleloop.subspace.instruments import instrument_hankel, instrument_signals, predict_from_reference
from ankleloop.subspace.projection import project
from ankleloop.subspace.realisation import choose_order, realise

__all__ = ["INPUT_MATRICES", "SubspaceEstimate", "moesp"]

INPUT_MATRICES = ("least-squares", "instruments")
GUARDED = (
    "least squares gave an unstable A (spectral radius {radius:.4f}) at order {order}; it was replaced by a guaranteed "
    "stable one. Lower the order or change block_rows, and do not trust these poles."
)


@dataclass(frozen=True)
class SubspaceEstimate:
    """A state-space model found by a subspace method.

    Parameters
    ----------
    model : control.StateSpace
        The model in the units of the data.
    singular_values : ndarray
        They show the order.
    initial_state : ndarray, shape (n,)
        State at the first sample, of the data less their means.
    diagnostics : dict
        Order, poles, ranks, conditions and warnings.
    """

    model: object
    singular_values: np.ndarray
    initial_state: np.ndarray
    diagnostics: dict = field(default_factory=dict)


def moesp(
    u,
    y,
    block_rows,
    order,
    instruments="past-input",
    projection="ordinary",
    reference=None,
    dt=1.0,
    *,
    instrument_rows=None,
    instrument_leads=0,
    input_matrices="least-squares",
    dynamic=None,
    predicted_inputs=None,
    rank_tolerance=1e-8,
    regression_tolerance=1e-10,
    names=None,
):
    r"""Identify a state-space model by a member of the MOESP family.

    .. math:: x(t+1) = A x(t) + B u(t), \qquad y(t) = C x(t) + D u(t) + v(t)

    Instruments: ``"none"`` ordinary MOESP, ``"past-input"`` PI-MOESP, ``"past-input-output"`` PO-MOESP (EIV-MOESP with
    the correlation form), ``"past-reference"`` PR-MOESP. Verhaegen and Dewilde (1992); Chou and Verhaegen (1997);
    Zhao and Westwick (2003). Means are removed and every channel is scaled to unit variance before the projection.

    Parameters
    ----------
    u : array_like, shape (N, m)
        Inputs.
    y : array_like, shape (N, p)
        Outputs.
    block_rows : int
        Block rows of the future, more than the order.
    order : int or None
        Order n; None takes it from the largest drop of the singular values.
    instruments : {"none", "past-input", "past-input-output", "past-reference"}
        Instrumental variables.
    projection : {"ordinary", "correlation"}
        Form of the projection, see `ankleloop.subspace.projection.project`.
    reference : array_like, shape (N,) or (N, q), optional
        External reference of the loop.
    dt : float
        Sampling interval [s].
    instrument_rows : int, optional
        Block rows of the past. By default `block_rows`, or as many as the correlation form needs.
    instrument_leads : int
        Block rows by which the reference reaches into the future as well, up to `block_rows`: any shift of an external
        reference is a valid instrument. Past inputs and outputs have none.
    input_matrices : {"least-squares", "instruments"}
        How B and D are found. With instruments the inputs are predicted from the reference.
    dynamic : array_like of bool, shape (m,), optional
        Inputs that drive the state; the rest act through D alone.
    predicted_inputs : array_like, shape (N, m), optional
        Noise-free predictions of the inputs to serve as instruments for B and D, instead of linear ones.
    rank_tolerance : float
        Rank policy of the projection: singular values below this fraction of the largest one count as zero.
    regression_tolerance : float
        The same for the regression that gives B and D.
    names : tuple of two sequences of str, optional
        Names of inputs and outputs of the model.

    Returns
    -------
    SubspaceEstimate

    Raises
    ------
    DataError
        For records that are too short, constant channels, a missing reference or too few instruments.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> u = rng.standard_normal((500, 1))
    >>> y = np.zeros((500, 1))
    >>> for t in range(1, 500):
    ...     y[t] = 0.8 * y[t - 1] + u[t - 1]
    >>> estimate = moesp(u, y, block_rows=8, order=1)
    >>> bool(abs(estimate.model.poles()[0] - 0.8) < 1e-9)
    True
    """
    if input_matrices not in INPUT_MATRICES:
        raise ValueError(f"unknown input_matrices {input_matrices!r}; known: {', '.join(INPUT_MATRICES)}.")
    u, u_scale = _scaled(u, "input")
    y, y_scale = _scaled(y, "output")
    r = None if reference is None else _scaled(reference, "reference")[0]
    _check(u, y, r, block_rows, order)
    _check_leads(instruments, instrument_leads, block_rows)
    z = instrument_signals(instruments, u, y, r)
    past = 0
    if z.shape[1]:
        past = instrument_rows or _instrument_rows(projection, block_rows, u.shape[1], y.shape[1], z.shape[1])
    found = _project(u, y, z, block_rows, past, instrument_leads, projection, rank_tolerance, order or 1)
    n = choose_order(found.singular_values, (block_rows - 1) // 2) if order is None else order
    A, C, guarded = realise(found.observability, y.shape[1], n)
    predicted = None
    if input_matrices == "instruments":
        predicted = _prediction(u, r) if predicted_inputs is None else _centred(predicted_inputs) / u_scale
    inputs = estimate_input_matrices(A, C, u, y, dynamic, predicted, regression_tolerance)
    B, D, C = inputs.B / u_scale, y_scale[:, None] * inputs.D / u_scale, y_scale[:, None] * C
    diagnostics = {
        "order": n,
        "poles": np.linalg.eigvals(A),
        "rank": found.input_rank,
        "condition": found.condition,
        "instruments": instruments,
        "projection": projection,
        "instrument_rows": (past + instrument_leads) * z.shape[1],
        "instrument_rank": found.instrument_rank,
        "input_matrices": input_matrices,
        "regression_rank": inputs.rank,
        "regression_condition": inputs.condition,
        "stable": guarded is None,
        "warnings": [] if guarded is None else [GUARDED.format(radius=guarded, order=n)],
    }
    model = _state_space(A, B, C, D, dt, names)
    return SubspaceEstimate(model, found.singular_values, inputs.initial_state, diagnostics)


def _centred(x):
    x = np.asarray(x, dtype=float)
    return x - x.mean(axis=0)


def _scaled(x, name):
    """Zero mean, unit variance, two dimensions; and the scale."""
    x = np.asarray(x, dtype=float)
    x = x[:, None] if x.ndim == 1 else x
    bad = np.argwhere(~np.isfinite(x))
    if bad.size:
        raise DataError(f"{name} {bad[0, 1]} is not finite at sample {bad[0, 0]}: cut or repair the record.")
    scale = x.std(axis=0)
    constant = np.flatnonzero(scale <= 1e-13 * np.max(np.abs(x), axis=0, initial=0.0))
    if constant.size:
        raise DataError(f"{name} {constant[0]} is constant and carries no information: leave it out.")
    return _centred(x) / scale, scale


def _prediction(u, r):
    if r is None:
        raise DataError("input_matrices='instruments' needs a reference: pass the external command of the loop.")
    return predict_from_reference(u, r)


def _check(u, y, r, block_rows, order):
    for name, signal in (("output", y), ("reference", r)):
        if signal is not None and signal.shape[0] != u.shape[0]:
            raise DataError(f"{u.shape[0]} samples of inputs, {signal.shape[0]} of the {name}: cut them to one length.")
    if order is not None and order < 1:
        raise ValueError(f"order must be at least 1, got {order}.")
    if block_rows <= (order or 1):
        raise ValueError(f"block_rows must be larger than the order ({order or 1}), got {block_rows}.")


def _instrument_rows(projection, block_rows, inputs, outputs, width):
    if projection == "ordinary":
        return block_rows
    # The correlation form spends m·s directions on the inputs; leave p·s of them for the outputs.
    return max(block_rows, -(-(inputs + outputs) * block_rows // width))


def _check_leads(instruments, leads, block_rows):
    if not 0 <= leads <= block_rows:
        raise ValueError(f"instrument_leads must be between 0 and block_rows ({block_rows}), got {leads}.")
    if leads and instruments != "past-reference":
        raise ValueError(f"instrument_leads need instruments made of the reference, not {instruments!r}: use 0.")


def _project(u, y, z, block_rows, past, leads, form, rank_tolerance, least):
    columns = u.shape[0] - past - block_rows + 1
    rows = (u.shape[1] + y.shape[1]) * block_rows + z.shape[1] * (past + leads)
    if columns < rows:
        raise DataError(
            f"the record of {u.shape[0]} samples is shorter than its Hankel window: {rows} Hankel rows need at least "
            f"{rows + past + block_rows - 1} samples. Record longer, or use fewer block_rows or instrument_rows."
        )
    U, Y = block_hankel(u, past, block_rows, columns), block_hankel(y, past, block_rows, columns)
    return project(U, Y, instrument_hankel(z, past + leads, columns), form, rank_tolerance, least)


def _state_space(A, B, C, D, dt, names):
    from control import StateSpace  # here, because importing it takes longer than the identification

    inputs, outputs = names if names is not None else (None, None)
    return StateSpace(A, B, C, D, dt, inputs=inputs, outputs=outputs, remove_useless_states=False)
