"""Instrumental variables of the MOESP family: which past signals are uncorrelated with the future noise."""

import numpy as np

from ankleloop.errors import DataError
from ankleloop.subspace.hankel import block_hankel
from ankleloop.subspace.records import as_batches, batch_hankel, centred

__all__ = ["INSTRUMENTS", "instrument_channels", "predict_from_reference", "reference_response"]

# Which signals each choice stacks.
INSTRUMENTS = {
    "none": (),
    "past-input": ("input",),
    "past-input-output": ("input", "output"),
    "past-reference": ("reference",),
}


def instrument_channels(instruments, inputs, outputs, references):
    """Which channels a choice of instruments consists of, where a record holds inputs, outputs and reference.

    Parameters
    ----------
    instruments : str
        One of `INSTRUMENTS`.
    inputs, outputs, references : int
        Number of channels of each; 0 references where there is none.

    Returns
    -------
    ndarray of int

    Raises
    ------
    DataError
        If the choice needs a reference and there is none.

    Examples
    --------
    >>> instrument_channels("past-reference", 2, 1, 1).tolist()
    [3]
    """
    if instruments not in INSTRUMENTS:
        raise ValueError(f"unknown instruments {instruments!r}; known: {', '.join(INSTRUMENTS)}.")
    if "reference" in INSTRUMENTS[instruments] and not references:
        raise DataError("past-reference instruments need a reference: pass the external command of the loop.")
    edges = np.cumsum([0, inputs, outputs, references])
    of = {name: np.arange(*edges[k : k + 2]) for k, name in enumerate(("input", "output", "reference"))}
    return np.concatenate([of[name] for name in INSTRUMENTS[instruments]] or [np.arange(0)])


def reference_response(u, reference, leads=15, lags=80):
    """Finite response of signals to leads and lags of the reference, by least squares.

    Zero-phase filters leak the future into the past, hence the leads.

    Parameters
    ----------
    u : ndarray, shape (N, m), or list of those
        Signals of one record, or of several.
    reference : ndarray, shape (N, q), or list of those
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
    u, reference = as_batches(u), as_batches(reference)
    taps, q = leads + lags + 1, reference[0].shape[1]
    columns = sum(max(0, record.shape[0] - taps + 1) for record in reference)
    if columns < taps * q:
        samples = " + ".join(str(record.shape[0]) for record in reference)
        raise DataError(
            f"a record of {samples} samples is too short to predict its inputs from {taps} leads and lags "
            "of the reference: record longer, or use input_matrices='least-squares'."
        )
    regressors = batch_hankel(reference, 0, taps, taps).T
    # Every lag loses its own mean: they differ a little, and an offset of the signal would leak through the difference.
    regressors = regressors - regressors.mean(axis=0)
    target = np.concatenate([record[lags : record.shape[0] - leads] for record in u if record.shape[0] >= taps])
    # Rows run from the oldest lag to the furthest lead; the response reads the other way.
    return np.linalg.lstsq(regressors, target - target.mean(axis=0), rcond=1e-10)[0].reshape(taps, q, -1)[::-1]


def predict_from_reference(u, reference, leads=15, lags=80):
    """Part of signals that leads and lags of the reference explain: it is free of fed-back noise.

    Parameters
    ----------
    u : ndarray, shape (N, m), or list of those
        Signals of zero mean, of one record, or of several.
    reference : ndarray, shape (N, q), or list of those
        External reference; it counts as zero beyond its ends.
    leads, lags : int
        Samples ahead of and behind the present.

    Returns
    -------
    ndarray, shape (N, m), or list of those

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
    taps = response[::-1].reshape(-1, response.shape[2])
    edges = ((lags, leads), (0, 0))
    predicted = [
        block_hankel(np.pad(record, edges), 0, leads + lags + 1, record.shape[0]).T @ taps
        for record in centred(as_batches(reference))
    ]
    return predicted if isinstance(u, list) else predicted[0]
