"""Data batches: several records of one system, which no Hankel column and no state may join."""

import numpy as np
from numba import njit

from ankleloop.errors import DataError
from ankleloop.subspace.hankel import block_hankel

__all__ = ["are_batches", "as_batches", "batch_hankel", "centred", "refuse_constant", "scaled"]


def are_batches(x):
    """Whether a signal is a list of records: its items are two-dimensional.

    Parameters
    ----------
    x : array_like or list
        The signal.

    Returns
    -------
    bool
    """
    return isinstance(x, (list, tuple)) and len(x) > 0 and all(np.ndim(record) == 2 for record in x)


def as_batches(x, several=None):
    """A signal as a list of two-dimensional records.

    Parameters
    ----------
    x : array_like, shape (N,) or (N, m), or list of those
        One record, or several. A list counts as several if its items are two-dimensional arrays.
    several : bool, optional
        Whether x is a list of records, where another signal has said so already.

    Returns
    -------
    list of ndarray, shape (N, m) each

    Raises
    ------
    DataError
        If there are no records, or they differ in their number of channels.

    Examples
    --------
    >>> [record.shape for record in as_batches([np.zeros((4, 2)), np.zeros((3, 2))])]
    [(4, 2), (3, 2)]
    >>> [record.shape for record in as_batches([1.0, 2.0, 3.0])]
    [(3, 1)]
    """
    several = are_batches(x) if several is None else several
    records = [np.asarray(record, dtype=float) for record in (x if several else [x])]
    if not records:
        raise DataError("there are no data batches.")
    records = [record[:, None] if record.ndim == 1 else record for record in records]
    widths = [record.shape[1] if record.ndim == 2 else -1 for record in records]
    for k, width in enumerate(widths):
        if width != widths[0] or width < 0:
            raise DataError(
                f"data batch {k} has shape {records[k].shape}, batch 0 {records[0].shape}: every batch must be "
                "(samples, channels), with the same channels."
            )
    return records


def centred(batches):
    """Every record less its own means.

    Parameters
    ----------
    batches : list of ndarray, shape (N, m) each
        The records.

    Returns
    -------
    list of ndarray
    """
    return [_about_means(np.ascontiguousarray(record))[0] for record in batches]


def scaled(batches, name):
    """Every record less its own means, each channel of unit variance over all records.

    Parameters
    ----------
    batches : list of ndarray, shape (N, m) each
        The records.
    name : str
        What the channels are, for the error.

    Returns
    -------
    list of ndarray
        The records.
    ndarray, shape (m,)
        Standard deviation by which each channel was divided.

    Raises
    ------
    DataError
        If a channel is constant or has a value that is not finite.
    """
    raw, samples = batches, sum(record.shape[0] for record in batches)
    batches, means, squares = zip(*map(_about_means, map(np.ascontiguousarray, batches)), strict=True)
    scale = np.sqrt(sum(squares) / max(samples, 1))
    if not np.isfinite(scale).all():
        _refuse_not_finite(raw, name)
    refuse_constant(scale, np.max(np.abs(means), axis=0), name)
    for record in batches:
        record /= scale
    return list(batches), scale


@njit(cache=True, error_model="numpy")
def _about_means(record):
    """A record less the means of its channels, those means, and the sums of squares about them."""
    samples, channels = record.shape
    means, squares, left = np.zeros(channels), np.zeros(channels), np.empty((samples, channels))
    for t in range(samples):
        for c in range(channels):
            means[c] += record[t, c]
    means /= samples
    for t in range(samples):
        for c in range(channels):
            left[t, c] = record[t, c] - means[c]
            squares[c] += left[t, c] ** 2
    return left, means, squares


def refuse_constant(scale, size, name):
    """Refuse channels, called by a name and their number, that deviate from a mean by rounding alone."""
    constant = np.flatnonzero(scale <= 1e-13 * size)
    if constant.size:
        raise DataError(f"{name} {constant[0]} is constant and carries no information: leave it out.")


def _refuse_not_finite(batches, name):
    for k, record in enumerate(batches):
        bad = np.argwhere(~np.isfinite(record))
        if bad.size:
            batch = f" of data batch {k}" if len(batches) > 1 else ""
            raise DataError(f"{name} {bad[0, 1]} is not finite at sample {bad[0, 0]}{batch}: cut or repair the record.")


def batch_hankel(batches, first, rows, before, *, own_means=False):
    """Hankel matrices of all records side by side.

    Parameters
    ----------
    batches : list of ndarray, shape (N, m) each
        The records; those that are too short for a single column are left out.
    first : int
        Sample in the upper left corner.
    rows : int
        Block rows.
    before : int
        Samples of a record that make one column of all Hankel matrices that belong together.
    own_means : bool
        Whether every row loses its mean over each record: the offset of a record is one more input, constant in it.

    Returns
    -------
    ndarray, shape (rows * m, columns of all records)
    """
    parts = [
        block_hankel(record, first, rows, record.shape[0] - before + 1).T
        for record in batches
        if record.shape[0] >= before
    ]
    if own_means:
        parts = [part - part.mean(axis=0) for part in parts]
    # Column-major, so that its transpose goes into a QR factorisation without a copy.
    return parts[0].T if len(parts) == 1 else np.concatenate(parts).T
