"""The MOESP family on any linear data set.

One body serves all: members of the family differ in their instruments and their projection, and data come from a source
in memory or in chunks.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ankleloop.errors import DataError
from ankleloop.options import check_memory, show_fields, show_value
from ankleloop.subspace.input_matrices import OutputRegression
from ankleloop.subspace.matrices import Matrices
from ankleloop.subspace.projection import (
    choose_order,
    project_correlation,
    project_factor,
    project_gram,
    realise,
)
from ankleloop.subspace.sources import (
    MemoryOptions,
    MemorySource,
    Source,
    SubspaceOptions,
    select_rows,
)

if TYPE_CHECKING:
    from control import StateSpace

UNSTABLE = (
    "least squares gave an unstable A (spectral radius {radius:.4f}) at order {order}; it was replaced by a guaranteed "
    "stable one. Lower the order or change block_rows, and do not trust these poles."
)


@dataclass(frozen=True)
class SubspaceEstimate:
    """A state-space model from a subspace method.

    Parameters
    ----------
    matrices : Matrices
        A, B, C, D in the units of the data; `model` is the same as a `control.StateSpace`.
    singular_values : ndarray
        They show the order.
    initial_state : ndarray, shape (n,); of merged records (records, n)
        State at the first sample of each record, for data without their means.
    diagnostics : dict
        Order, poles, ranks, conditions and warnings.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> u = rng.standard_normal(500)
    >>> y = np.convolve(u, 0.5 ** np.arange(40))[:500]
    >>> estimate = moesp(u, y, block_rows=5, order=1)
    >>> float(np.round(estimate.model.poles()[0].real, 6))
    0.5
    """

    matrices: Matrices
    singular_values: np.ndarray
    initial_state: np.ndarray
    diagnostics: dict[str, Any] = field(default_factory=dict)

    @cached_property
    def model(self) -> StateSpace:
        """The model as a `control.StateSpace`."""
        return self.matrices.state_space()


@show_fields(MemoryOptions)
def moesp(
    u: Any,
    y: Any,
    block_rows: int,
    order: int | None,
    instruments: str = "past-input",
    projection: str = "ordinary",
    reference: Any = None,
    dt: float = 1.0,
    *,
    dynamic: ArrayLike | None = None,
    predicted_inputs: Any = None,
    **options: Any,
) -> SubspaceEstimate:
    r"""Identify a state-space model by a member of the MOESP family.

    .. math:: x(t+1) = A x(t) + B u(t), \qquad y(t) = C x(t) + D u(t) + v(t)

    Instruments: ``"none"`` ordinary MOESP, ``"past-input"`` PI-MOESP, ``"past-input-output"`` PO-MOESP (EIV-MOESP with
    the correlation form), ``"past-reference"`` PR-MOESP. Verhaegen and Dewilde (1992); Chou and Verhaegen (1997);
    Zhao and Westwick (2003). Means are removed and every channel is scaled to unit variance before the projection,
    unless the options `offsets` and `scaling` say otherwise.

    Several records of one system are merged: no column of a Hankel matrix reaches across their seams, each has means,
    an offset and an initial state of its own, and their lengths may differ.

    Parameters
    ----------
    u : array_like, shape (N, m), or list of those
        Inputs; a list of two-dimensional arrays is a list of records, and y and reference are lists, too.
    y : array_like, shape (N, p), or list of those
        Outputs.
    block_rows : int
        Block rows of the future, more than the order.
    order : int or None
        Order n; None takes it from the largest drop of the singular values.
    instruments : {"none", "past-input", "past-input-output", "past-reference"}
        Instrumental variables.
    projection : {"ordinary", "correlation"}
        Form of the projection, see `ankleloop.subspace.projection`.
    reference : array_like, shape (N,) or (N, q), or list of those, optional
        External reference of the loop.
    dt : float
        Sampling interval [s].
    dynamic : array_like of bool, shape (m,), optional
        Inputs that drive the state; the rest act through D alone.
    predicted_inputs : array_like, shape (N, m), or list of those, optional
        Noise-free predictions of the inputs to serve as instruments for B and D, instead of linear ones.
    **options
        Options by name; `ankleloop.subspace.sources.MemoryOptions` describes each of them, with its default.

    Returns
    -------
    SubspaceEstimate

    Raises
    ------
    DataError
        For records that are too short, constant channels, a missing reference or too few instruments.
    TypeError, ValueError
        For an unknown option, or one out of its range.

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
    positional = {
        "block_rows": block_rows,
        "order": order,
        "instruments": instruments,
        "projection": projection,
    }
    all_options = MemoryOptions.parse("moesp", **positional, dt=dt, **options)
    return _identify(
        MemorySource(u, y, reference, predicted_inputs, all_options), dynamic, all_options
    )


def _identify(
    source: Source, dynamic: ArrayLike | None, options: SubspaceOptions
) -> SubspaceEstimate:
    """The body of the family: project the Hankel rows, realise A and C, estimate B and D."""
    m, p, _ = source.sizes
    for kind, group, size in zip(("inputs", "outputs"), options.names or (), (m, p), strict=False):
        if len(group) != size:
            raise ValueError(
                f"names must have {size} names of {kind}, got {show_value(list(group))}."
            )
    rows = select_rows(options, source.sizes, open_loop=source.open_loop)
    # The Gram matrix, a copy in the order of the projection, and its eigenvectors.
    check_memory(
        "moesp",
        3 * 8.0 * rows.indices.size**2,
        "use fewer block_rows, instrument_rows or instrument_leads",
    )
    gram = source.compute_gram(rows)
    columns, size = (
        sum(max(0, length - rows.window + 1) for length in source.lengths),
        rows.indices.size,
    )
    if columns < size:
        raise DataError(
            f"the record of {' + '.join(map(str, source.lengths))} samples is shorter than its Hankel window: "
            f"{size} Hankel rows need at least {size + rows.window - 1} samples. Record longer, or use fewer "
            "block_rows or instrument_rows."
        )
    arguments = rows.sizes, columns, options.rank_tolerance, options.order or 1
    if options.projection == "correlation":
        compression, projection = "gram", project_correlation(gram, *arguments)
    else:
        squares = project_gram(gram, *arguments)
        compression = "gram" if squares else "qr"
        projection = squares or project_factor(source.factor_rows(rows), *arguments)
    largest = (options.block_rows - 1) // 2
    order = (
        choose_order(projection.singular_values, largest)
        if options.order is None
        else options.order
    )
    A, C, poles, unstable_radius = realise(projection.observability, p, order)
    regression = OutputRegression(A, C, m, dynamic, len(source.lengths), offsets=source.offsets)
    inputs = regression.solve(source.records, source.predicted, options.regression_tolerance)
    u_scale, y_scale = source.scale[:m], source.scale[m : m + p, None]
    matrices = Matrices(
        A, inputs.B / u_scale, y_scale * C, y_scale * inputs.D / u_scale, options.dt, options.names
    )
    stable = unstable_radius is None
    diagnostics = {
        "order": order,
        "poles": poles,
        "spectral_radius": float(np.abs(poles).max()),
        "rank": projection.input_rank,
        "condition": projection.condition,
        "instrument_rows": rows.sizes[1],
        "instrument_rank": projection.instrument_rank,
        "input_matrices": "instruments" if source.predicted else "least-squares",
        "regression_rank": inputs.rank,
        "regression_condition": inputs.condition,
        "stable": stable,
        "compression": compression,
        "instruments": options.instruments,
        "projection": options.projection,
        "warnings": [] if stable else [UNSTABLE.format(radius=unstable_radius, order=order)],
    }
    return SubspaceEstimate(matrices, projection.singular_values, inputs.initial_state, diagnostics)
