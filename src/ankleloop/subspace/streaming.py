"""The MOESP family on a record of any length, in constant memory: it is read chunk by chunk, a few times."""

import numpy as np
from scipy import linalg

from ankleloop.errors import DataError
from ankleloop.subspace.compression import HankelRows
from ankleloop.subspace.gram_projection import project_gram
from ankleloop.subspace.hankel import block_hankel
from ankleloop.subspace.input_matrices import driving, least_squares, matrices_of, sensitivities
from ankleloop.subspace.instruments import instrument_channels
from ankleloop.subspace.moesp import check_options, described, instrument_block_rows
from ankleloop.subspace.projection import project_factor
from ankleloop.subspace.realisation import choose_order, realise
from ankleloop.subspace.records import refuse_constant

__all__ = ["moesp_chunks"]

SPENT = 1e-200  # what an initial state leaves in the end; smaller numbers slow the arithmetic down


def moesp_chunks(
    chunks,
    block_rows,
    order,
    instruments="past-input",
    projection="ordinary",
    dt=1.0,
    *,
    instrument_rows=None,
    instrument_leads=0,
    dynamic=None,
    rank_tolerance=1e-8,
    regression_tolerance=1e-10,
    names=None,
):
    """Identify a state-space model as `moesp` does, from a record that comes in chunks.

    The first pass takes moments and the inner products of the Hankel rows, one more a factorisation of them where
    those are not accurate enough, and the last pass the regression for B, D and the initial state. Time is in
    proportion to the length of the record, memory to that of a chunk.

    Parameters
    ----------
    chunks : callable
        Returns an iterator over the chunks of the record from its beginning, each a tuple of inputs, shape (N, m),
        outputs, shape (N, p), and reference, shape (N, q) or None. It is called once for each pass.
    block_rows, order, instruments, projection, dt, instrument_rows, instrument_leads, dynamic
        As `moesp` takes them.
    rank_tolerance, regression_tolerance, names
        As `moesp` takes them.

    Returns
    -------
    SubspaceEstimate

    Raises
    ------
    DataError
        As `moesp` does.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> u, y = rng.standard_normal((2000, 1)), np.zeros((2000, 1))
    >>> for t in range(1, 2000):
    ...     y[t] = 0.8 * y[t - 1] + u[t - 1]
    >>> estimate = moesp_chunks(lambda: ((u[k : k + 300], y[k : k + 300], None) for k in range(0, 2000, 300)), 8, 1)
    >>> bool(abs(estimate.model.poles()[0] - 0.8) < 1e-9)
    True
    """
    check_options(block_rows, order, instruments, instrument_leads)
    record = _Record(chunks)
    m, p, q = record.sizes
    channels = instrument_channels(instruments, m, p, q)
    past = instrument_block_rows(instrument_rows, projection, block_rows, m, p, channels.size)
    rows = HankelRows(m, p, channels, block_rows, past, instrument_leads)
    found, used = _projected(record, rows, projection, rank_tolerance, order or 1)
    n = choose_order(found.singular_values, (block_rows - 1) // 2) if order is None else order
    A, C, guarded = realise(found.observability, p, n)
    inputs = _input_matrices(record, A, C, dynamic, regression_tolerance)
    described_as = {"compression": used, "instruments": instruments, "projection": projection}
    scales = record.scale[:m], record.scale[m : m + p]
    return described(found, (A, C, guarded), inputs, scales, rows, described_as, dt, names)


class _Record:
    """Chunks of inputs, outputs and reference side by side; once moments are known, without means, of unit variance."""

    def __init__(self, chunks):
        self._chunks = chunks
        first = next(iter(chunks()), None)
        if first is None:
            raise DataError("the record has no chunks.")
        self.sizes = [0 if part is None else part.shape[1] for part in first]
        start = self._side_by_side(first)
        self.mean, self.scale = start.mean(axis=0), start.std(axis=0)
        self.scale[self.scale == 0] = 1.0

    @staticmethod
    def _side_by_side(chunk):
        return np.column_stack([part for part in chunk if part is not None])

    def __iter__(self):
        at = 0
        for chunk in self._chunks():
            x = self._side_by_side(chunk)
            if not np.isfinite(x).all():
                t, channel = np.argwhere(~np.isfinite(x))[0]
                raise DataError(f"channel {channel} is not finite at sample {at + t}: cut or repair the record.")
            at += len(x)
            yield (x - self.mean) / self.scale

    def settle(self, sums, squares, samples):
        """Take the moments of the whole record; returns what the scales have changed by."""
        shift = sums / samples
        deviation = np.sqrt(np.maximum(squares / samples - shift**2, 0.0))
        mean, scale = self.mean + shift * self.scale, self.scale * deviation
        edges = np.cumsum([0, *self.sizes])
        for name, start, stop in zip(("input", "output", "reference"), edges, edges[1:], strict=False):
            refuse_constant(scale[start:stop], np.abs(mean[start:stop]), name)
        self.mean, self.scale = mean, scale
        return deviation


def _projected(record, rows, form, rank_tolerance, order):
    """First pass: moments and inner products; a second one where these do not do."""
    width = sum(record.sizes)
    gram, sums, squares, samples = rows.gram(width), 0.0, 0.0, 0
    for x in record:
        gram.add(x)
        sums, squares, samples = sums + x.sum(axis=0), squares + np.einsum("tc,tc->c", x, x), samples + len(x)
    columns = rows.check([samples])
    deviation = record.settle(sums, squares, samples)
    chosen = rows.indices(width)
    each = deviation[chosen % width]
    inner = gram.matrix(chosen) / np.outer(each, each)
    found = project_gram(inner, rows.sizes, columns, form, rank_tolerance, order)
    if found is not None:
        return found, "gram"
    return project_factor(_factor(record, rows), rows.sizes, columns, form, rank_tolerance, order), "qr"


def _factor(record, rows):
    """Triangular factor of the Hankel rows, chunk after chunk; a row of ones before them takes their means."""
    R, tail = np.zeros((0, rows.total + 1)), None
    for chunk in record:
        x = chunk if tail is None else np.concatenate([tail, chunk])
        columns = len(x) - rows.window + 1
        tail = x[max(columns, 0) :].copy()
        if columns < 1:
            continue
        parts = [block_hankel(x[:, used], first, count, columns).T for used, first, count in rows.matrices if used.size]
        R = linalg.qr(np.vstack([R, np.hstack([np.ones((columns, 1)), *parts])]), mode="r", check_finite=False)[0]
        R = R[: rows.total + 1]
    return R[1:, 1:]


def _input_matrices(record, A, C, dynamic, rank_tolerance):
    """Last pass: the regression of `estimate_input_matrices`, by a triangular factor that grows with the chunks."""
    m, p, _ = record.sizes
    n = A.shape[0]
    dynamic = driving(dynamic, m)
    which = np.flatnonzero(dynamic)
    observed, driven = np.array(C), np.zeros((p, n * which.size))
    R = np.zeros((0, m * p + n * which.size + n + p + 1))
    for x in record:
        phi = sensitivities(A, C, x[:, :m], which, observed, driven)
        observed[np.abs(observed) < SPENT] = 0.0
        both = np.column_stack([phi.reshape(-1, phi.shape[2]), x[:, m : m + p].reshape(-1)])
        R = linalg.qr(np.vstack([R, both]), mode="r", check_finite=False)[0][: R.shape[1]]
    theta, rank, condition = least_squares(R[:-1, :-1], R[:-1, -1], rank_tolerance)
    return matrices_of(theta, (m, n, p), dynamic, 1, rank, condition)
