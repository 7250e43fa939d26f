"""The MOESP family on any linear data set.

One body serves all: members of the family differ in their instruments and their projection.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ankleloop.errors import DataError
from ankleloop.options import check_memory, show_fields
from ankleloop.subspace.input_matrices import InputMatrices, OutputRegression, simulate_response
from ankleloop.subspace.matrices import Matrices
from ankleloop.subspace.projection import (
    Projection,
    Realisation,
    choose_order,
    project_correlation,
    project_factor,
    project_gram,
    realise,
)
from ankleloop.subspace.sources import HankelRows, Records, SubspaceOptions, select_rows

if TYPE_CHECKING:
    from control import StateSpace

UNSTABLE = "least squares gave an unstable A (spectral radius {radius:.4f}) at order {order}; "
REPLACED = (
    "it was replaced by a guaranteed stable one. Lower the order or change block_rows, and do not trust these poles; "
    "subspace.moesp keeps A with stable=False, for an unstable system in a stable loop."
)
KEPT = "it was kept (stable=False). Without the loop that stabilises it, a simulation grows without bound."
UNDETERMINED = (
    "the inputs do not determine B and D: their regression has rank {rank} for {unknowns} unknowns, so the model holds "
    "for inputs such as these alone. Use inputs with more frequencies than a sinusoid or a step, leave out inputs that "
    "follow from others, or lower the order."
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
    input_means : ndarray, shape (m,); of merged records (records, m)
        Means of the inputs of each record; zero without the option `offsets`.
    offsets : ndarray, shape (p,); of merged records (records, p)
        What `simulate` adds to the outputs of each record; zero without the option `offsets`.
    diagnostics : dict
        Order, poles, ranks and warnings.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> u = rng.standard_normal(500)
    >>> y = np.convolve(u, 0.5 ** np.arange(40))[:500]
    >>> estimate = moesp(u, y, block_rows=5, order=1)
    >>> float(np.round(estimate.model.poles()[0].real, 6))
    0.5

    Inputs and outputs may have means: the model is for deviations from them, and the simulation for the data.

    >>> estimate = moesp(u + 4.0, y - 2.0, block_rows=5, order=1)
    >>> bool(np.allclose(estimate.simulate(u + 4.0)[:, 0], y - 2.0))
    True
    """

    matrices: Matrices
    singular_values: np.ndarray
    initial_state: np.ndarray
    input_means: np.ndarray
    offsets: np.ndarray
    diagnostics: dict[str, Any]

    @cached_property
    def model(self) -> StateSpace:
        """The model as a `control.StateSpace`."""
        return self.matrices.state_space()

    def simulate(self, u: ArrayLike, record: int = 0) -> np.ndarray:
        """Outputs of a record for inputs, both with their means, as they were given to `moesp`.

        It is ``simulate_response(A, B, C, D, u - input_means, initial_state) + offsets``.

        Parameters
        ----------
        u : array_like, shape (N, m); of one input also (N,)
            Inputs from the first sample of the record on.
        record : int
            Which of the merged records, whose means, initial state and offsets are taken.

        Returns
        -------
        ndarray, shape (N, p)
        """
        start = np.atleast_2d(self.initial_state)[record]
        means = np.atleast_2d(self.input_means)[record]
        offsets = np.atleast_2d(self.offsets)[record]
        model = self.matrices
        return offsets + simulate_response(
            model.A, model.B, model.C, model.D, np.asarray(u, dtype=float) - means, start
        )


@show_fields(SubspaceOptions)
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
        Options by name; `ankleloop.subspace.sources.SubspaceOptions` describes each of them, with its default.

    Returns
    -------
    SubspaceEstimate

    Raises
    ------
    DataError
        For records that are too short, constant channels, a missing reference or too few instruments.
    TypeError, ValueError
        For an unknown option, or one out of its range.

    See Also
    --------
    ankleloop.identify : Subspace methods for the joint.

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
    all_options = SubspaceOptions.parse(
        "moesp",
        block_rows=block_rows,
        order=order,
        instruments=instruments,
        projection=projection,
        dt=dt,
        **options,
    )
    records = Records(u, y, reference, predicted_inputs, all_options)
    m, p, _ = records.sizes
    rows = select_rows(all_options, records.sizes)
    outcome, compression = _project(records, rows, all_options)
    largest = (all_options.block_rows - 1) // 2
    chosen_order = all_options.order or choose_order(outcome.singular_values, largest)
    realisation = realise(outcome.observability, p, chosen_order, stable=all_options.stable)
    was_stable = realisation.unstable_radius is None
    regression = OutputRegression(
        realisation.A,
        realisation.C,
        inputs=m,
        dynamic=dynamic,
        records=len(records.lengths),
        offsets=records.offsets,
        stable=was_stable or all_options.stable,
    )
    fit = regression.solve(records.scaled, records.predicted, all_options.regression_tolerance)
    diagnostics = {
        "order": chosen_order,
        "poles": realisation.poles,
        "spectral_radius": float(np.abs(realisation.poles).max()),
        "rank": outcome.input_rank,
        "instrument_rows": rows.sizes[1],
        "instrument_rank": outcome.instrument_rank,
        "regression_rank": fit.rank,
        "stable": was_stable,
        "compression": compression,
        "warnings": _list_warnings(realisation, fit, all_options.stable),
    }
    # In the units of the data; of a single record its vectors instead of one for each record.
    outputs = slice(m, m + p)
    input_scale = records.scale[:m]
    output_scale = records.scale[outputs]
    matrices = Matrices(
        A=realisation.A,
        B=fit.B / input_scale,
        C=output_scale[:, None] * realisation.C,
        D=output_scale[:, None] * fit.D / input_scale,
        dt=all_options.dt,
    )
    chosen = slice(None) if len(records.lengths) > 1 else 0
    offsets = records.means[:, outputs] + output_scale * fit.offsets
    return SubspaceEstimate(
        matrices=matrices,
        singular_values=outcome.singular_values,
        initial_state=fit.initial_state[chosen],
        input_means=records.means[chosen, :m],
        offsets=offsets[chosen],
        diagnostics=diagnostics,
    )


def _project(
    records: Records, rows: HankelRows, options: SubspaceOptions
) -> tuple[Projection, str]:
    """Project the Hankel rows, and name the compression: inner products, or a triangular factor."""
    size = rows.indices.size
    # The Gram matrix, a copy in the order of the projection, and its eigenvectors.
    check_memory(
        "moesp", 3 * 8.0 * size**2, "use fewer block_rows, instrument_rows or instrument_leads"
    )
    columns = sum(max(0, length - rows.window + 1) for length in records.lengths)
    if columns < size:
        raise DataError(
            f"the record of {' + '.join(map(str, records.lengths))} samples is shorter than its Hankel window: "
            f"{size} Hankel rows need at least {size + rows.window - 1} samples. Record longer, or use fewer "
            "block_rows or instrument_rows."
        )
    gram = records.compute_gram(rows)
    arguments = (rows.sizes, columns, options.rank_tolerance, options.order or 1)
    project = project_correlation if options.projection == "correlation" else project_gram
    projection = project(gram, *arguments)
    if projection is not None:
        return projection, "gram"
    return project_factor(records.factor_rows(rows), *arguments), "qr"


def _list_warnings(realisation: Realisation, fit: InputMatrices, stable: bool) -> list[str]:
    """What a user must know of A, B and D."""
    warnings = []
    if realisation.unstable_radius is not None:
        text = UNSTABLE.format(radius=realisation.unstable_radius, order=len(realisation.A))
        warnings.append(text + (REPLACED if stable else KEPT))
    if not fit.determined:
        warnings.append(UNDETERMINED.format(rank=fit.rank, unknowns=fit.unknowns))
    return warnings
