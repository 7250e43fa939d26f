"""Instrumental variables of the MOESP family: which past signals are uncorrelated with the future noise."""

import numpy as np

from ankleloop.errors import DataError
from ankleloop.subspace.hankel import block_hankel

__all__ = ["INSTRUMENTS", "instrument_hankel", "instrument_signals", "predict_from_reference", "reference_response"]

# Which signals each choice stacks.
INSTRUMENTS = {
    "none": (),
    "past-input": ("input",),
    "past-input-output": ("input", "output"),
    "past-reference": ("reference",),
}


def instrument_signals(instruments, u, y, reference):
    """Stack the signals that a choice of instruments consists of.

    Parameters
    ----------
    instruments : str
        One of `INSTRUMENTS`.
    u, y : ndarray, shape (N, m), (N, p)
        Inputs and outputs.
    reference : ndarray, shape (N, q), or None
        External reference.

    Returns
    -------
    ndarray, shape (N, z)

    Raises
    ------
    DataError
        If the choice needs a reference and there is none.
    """
    if instruments not in INSTRUMENTS:
        raise ValueError(f"unknown instruments {instruments!r}; known: {', '.join(INSTRUMENTS)}.")
    if "reference" in INSTRUMENTS[instruments] and reference is None:
        raise DataError("past-reference instruments need a reference: pass the external command of the loop.")
    signals = {"input": u, "output": y, "reference": reference}
    chosen = [signals[name] for name in INSTRUMENTS[instruments]]
    return np.column_stack(chosen) if chosen else np.empty((u.shape[0], 0))


def instrument_hankel(z, rows, columns):
    """Hankel matrix of the instruments, from their furthest past on.

    Parameters
    ----------
    z : ndarray, shape (N, q)
        Instrument signals; q may be 0.
    rows, columns : int
        Block rows, and columns.

    Returns
    -------
    ndarray, shape (rows * q, columns)
    """
    if z.shape[1] == 0:
        return np.empty((0, columns))
    return block_hankel(z, 0, rows, columns)


def reference_response(u, reference, leads=15, lags=80):
    """Finite response of signals to leads and lags of the reference, by least squares.

    Zero-phase filters leak the future into the past, hence the leads.

    Parameters
    ----------
    u : ndarray, shape (N, m)
        Signals.
    reference : ndarray, shape (N, q)
        External reference.
    leads, lags : int
        Samples ahead of and behind the present.

    Returns
    -------
    ndarray, shape (leads + lags + 1, q, m)
        Response from `leads` samples ahead to `lags` samples behind.

    Raises
    ------
    DataError
        If the record is too short for so many leads and lags.
    """
    taps, q = leads + lags + 1, reference.shape[1]
    columns = reference.shape[0] - taps + 1
    if columns < taps * q:
        raise DataError(
            f"a record of {reference.shape[0]} samples is too short to predict its inputs from {taps} leads and lags "
            "of the reference: record longer, or use input_matrices='least-squares'."
        )
    regressors = block_hankel(reference, 0, taps, columns).T
    # Every lag loses its own mean: they differ a little, and an offset of the signal would leak through the difference.
    regressors = regressors - regressors.mean(axis=0)
    target = u[lags : lags + columns]
    # Rows run from the oldest lag to the furthest lead; the response reads the other way.
    return np.linalg.lstsq(regressors, target - target.mean(axis=0), rcond=1e-10)[0].reshape(taps, q, -1)[::-1]


def predict_from_reference(u, reference, leads=15, lags=80):
    """Part of signals that leads and lags of the reference explain: it is free of fed-back noise.

    Parameters
    ----------
    u : ndarray, shape (N, m)
        Signals of zero mean.
    reference : ndarray, shape (N, q)
        External reference; it counts as zero beyond its ends.
    leads, lags : int
        Samples ahead of and behind the present.

    Returns
    -------
    ndarray, shape (N, m)

    Raises
    ------
    DataError
        If the record is too short for so many leads and lags.

    Examples
    --------
    >>> r = np.random.default_rng(0).standard_normal((400, 1))
    >>> u = np.vstack([np.zeros((1, 1)), r[:-1]])
    >>> bool(np.abs(predict_from_reference(u, r) - u).max() < 0.1)
    True
    """
    response = reference_response(u, reference, leads, lags)
    edges = ((lags, leads), (0, 0))
    padded = np.pad(reference - reference.mean(axis=0), edges)
    regressors = block_hankel(padded, 0, leads + lags + 1, u.shape[0]).T
    return regressors @ response[::-1].reshape(-1, u.shape[1])
