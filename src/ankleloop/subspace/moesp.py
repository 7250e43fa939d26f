"""The MOESP family on any linear data set: one body, the members differ in their instruments."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ankleloop.errors import DataError
from ankleloop.subspace.compression import COMPRESSIONS, HankelRows, compressed
from ankleloop.subspace.input_matrices import estimate_input_matrices
from ankleloop.subspace.instruments import instrument_channels, predict_from_reference
from ankleloop.subspace.matrices import Matrices
from ankleloop.subspace.realisation import choose_order, realise
from ankleloop.subspace.records import are_batches, as_batches, centred, scaled

__all__ = [
    "INPUT_MATRICES",
    "SubspaceEstimate",
    "check_options",
    "described",
    "instrument_block_rows",
    "moesp",
]

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
    matrices : Matrices
        A, B, C, D in the units of the data; `model` is the same as a `control.StateSpace`.
    singular_values : ndarray
        They show the order.
    initial_state : ndarray, shape (n,) or (batches, n)
        State at the first sample of the record, or of each data batch; of the data less their means.
    diagnostics : dict
        Order, poles, ranks, conditions and warnings.
    """

    matrices: Matrices
    singular_values: np.ndarray
    initial_state: np.ndarray
    diagnostics: dict = field(default_factory=dict)

    @cached_property
    def model(self):
        """The model as a `control.StateSpace`."""
        return self.matrices.state_space()


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
    compression="gram",
    rank_tolerance=1e-8,
    regression_tolerance=1e-10,
    names=None,
):
    r"""Identify a state-space model by a member of the MOESP family.

    .. math:: x(t+1) = A x(t) + B u(t), \qquad y(t) = C x(t) + D u(t) + v(t)

    Instruments: ``"none"`` ordinary MOESP, ``"past-input"`` PI-MOESP, ``"past-input-output"`` PO-MOESP (EIV-MOESP with
    the correlation form), ``"past-reference"`` PR-MOESP. Verhaegen and Dewilde (1992); Chou and Verhaegen (1997);
    Zhao and Westwick (2003). Means are removed and every channel is scaled to unit variance before the projection.

    Several data batches of one system are merged: no column of a Hankel matrix reaches across their seams, each has
    means, an offset and an initial state of its own, and their lengths may differ.

    Parameters
    ----------
    u : array_like, shape (N, m), or list of those
        Inputs; a list of two-dimensional arrays is a list of data batches, and y and reference are lists, too.
    y : array_like, shape (N, p), or list of those
        Outputs.
    block_rows : int
        Block rows of the future, more than the order.
    order : int or None
        Order n; None takes it from the largest drop of the singular values.
    instruments : {"none", "past-input", "past-input-output", "past-reference"}
        Instrumental variables.
    projection : {"ordinary", "correlation"}
        Form of the projection, see `ankleloop.subspace.projection.project`.
    reference : array_like, shape (N,) or (N, q), or list of those, optional
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
    predicted_inputs : array_like, shape (N, m), or list of those, optional
        Noise-free predictions of the inputs to serve as instruments for B and D, instead of linear ones.
    compression : {"gram", "qr"}
        How the Hankel matrices are compressed. "gram" takes the inner products of their rows by the displacement
        structure, and "qr" factorises them; where rounding of the squares would count, "gram" goes over to "qr" by
        itself, and `diagnostics["compression"]` says so.
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
    if compression not in COMPRESSIONS:
        raise ValueError(f"unknown compression {compression!r}; known: {', '.join(COMPRESSIONS)}.")
    several = are_batches(u)
    u, y = as_batches(u, several), as_batches(y, several)
    r = None if reference is None else as_batches(reference, several)
    _check_lengths(u, y, r)
    check_options(block_rows, order, instruments, instrument_leads)
    open_loop = instruments == "past-reference" and r is not None and _same(r, u)
    (u, u_scale), (y, y_scale) = scaled(u, "input"), scaled(y, "output")
    if r is not None:
        r = u if open_loop else scaled(r, "reference")[0]
    m, p = u[0].shape[1], y[0].shape[1]
    # In open loop the past reference is the past input, which is there already.
    source = "past-input" if open_loop else instruments
    channels = instrument_channels(source, m, p, 0 if r is None else r[0].shape[1])
    past = instrument_block_rows(instrument_rows, projection, block_rows, m, p, channels.size)
    rows = HankelRows(m, p, channels, block_rows, past, instrument_leads)
    referred = channels.max(initial=0) >= m + p
    records = [np.column_stack(parts) for parts in zip(u, y, *([r] if referred else []), strict=True)]
    found, used = compressed(records, rows, projection, rank_tolerance, order or 1, compression)
    n = choose_order(found.singular_values, (block_rows - 1) // 2) if order is None else order
    A, C, guarded = realise(found.observability, p, n)
    predicted = None
    if input_matrices == "instruments":
        predicted = _prediction(u, r) if predicted_inputs is None else _given(predicted_inputs, several, u_scale)
    inputs = estimate_input_matrices(A, C, u, y, dynamic, predicted, regression_tolerance)
    described_as = {"compression": used, "instruments": instruments, "projection": projection}
    described_as["input_matrices"] = input_matrices
    return described(found, (A, C, guarded), inputs, (u_scale, y_scale), rows, described_as, dt, names)


def described(found, realised, inputs, scales, rows, options, dt, names):
    """Put an estimate together: matrices in the units of the data, and what was seen on the way.

    Parameters
    ----------
    found : Projection
        Outcome of the projection.
    realised : tuple
        A, C and the guarded radius, from `realise`.
    inputs : InputMatrices
        B, D and initial state.
    scales : tuple of ndarray
        Scales of inputs and outputs.
    rows : HankelRows
        The rows that were projected.
    options : dict
        Options to be kept with the diagnostics.
    dt : float
        Sampling interval [s].
    names : tuple or None
        Names of inputs and outputs.

    Returns
    -------
    SubspaceEstimate
    """
    A, C, guarded = realised
    u_scale, y_scale = scales
    poles = np.linalg.eigvals(A)
    diagnostics = {
        "order": len(A),
        "poles": poles,
        "spectral_radius": float(np.abs(poles).max()),
        "rank": found.input_rank,
        "condition": found.condition,
        "instrument_rows": rows.sizes[1],
        "instrument_rank": found.instrument_rank,
        "input_matrices": "least-squares",
        "regression_rank": inputs.rank,
        "regression_condition": inputs.condition,
        "stable": guarded is None,
        **options,
        "warnings": [] if guarded is None else [GUARDED.format(radius=guarded, order=len(A))],
    }
    matrices = Matrices(A, inputs.B / u_scale, y_scale[:, None] * C, y_scale[:, None] * inputs.D / u_scale, dt, names)
    return SubspaceEstimate(matrices, found.singular_values, inputs.initial_state, diagnostics)


def _given(predicted, several, scale):
    return [record / scale for record in centred(as_batches(predicted, several))]


def _prediction(u, r):
    if r is None:
        raise DataError("input_matrices='instruments' needs a reference: pass the external command of the loop.")
    return predict_from_reference(u, r)


def _same(r, u):
    return all(np.array_equal(a, b) for a, b in zip(r, u, strict=True))


def _check_lengths(u, y, r):
    for name, signal in (("output", y), ("reference", r)):
        if signal is None:
            continue
        if len(signal) != len(u):
            raise DataError(f"{len(u)} data batches of inputs, {len(signal)} of the {name}: give one for each.")
        for k, (inputs, other) in enumerate(zip(u, signal, strict=True)):
            if other.shape[0] != inputs.shape[0]:
                batch = f" in data batch {k}" if len(u) > 1 else ""
                raise DataError(
                    f"{inputs.shape[0]} samples of inputs, {other.shape[0]} of the {name}{batch}: cut them to one "
                    "length."
                )


def check_options(block_rows, order, instruments, leads):
    """Refuse options outside their ranges."""
    if order is not None and order < 1:
        raise ValueError(f"order must be at least 1, got {order}.")
    if block_rows <= (order or 1):
        raise ValueError(f"block_rows must be larger than the order ({order or 1}), got {block_rows}.")
    if not 0 <= leads <= block_rows:
        raise ValueError(f"instrument_leads must be between 0 and block_rows ({block_rows}), got {leads}.")
    if leads and instruments != "past-reference":
        raise ValueError(f"instrument_leads need instruments made of the reference, not {instruments!r}: use 0.")


def instrument_block_rows(given, projection, block_rows, inputs, outputs, width):
    """Block rows of the past, from what was given: as many as those of the future, or as the correlation form needs."""
    if not width:
        return 0
    if given or projection == "ordinary":
        return given or block_rows
    # The correlation form spends m·s directions on the inputs; leave p·s of them for the outputs.
    return max(block_rows, -(-(inputs + outputs) * block_rows // width))
