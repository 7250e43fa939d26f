"""Lower bound of the time of an identification by inner products and simulated responses: its kernels, on its data."""

import numpy as np

from ankleloop.subspace.hankel import hankel_gram
from ankleloop.subspace.input_matrices import OutputRegression
from ankleloop.subspace.sources import MemoryOptions, select_rows

SIGNIFICANT = 80  # directions of deficient inputs that count


def prepare_kernels(data, block_rows):
    """A call that runs the kernels once and nothing else.

    They are: signals of zero mean and unit variance, which a decision about ranks needs; products of lagged samples and
    their displacement along the Hankel rows; eigenvectors of the input rows, for the decision about their rank; the
    other rows less their fit by the inputs; the same of the instruments; the decomposition that shows the order; A by
    least squares, and its poles; and for B, D and the initial state their regressors, a triangular factor and solution.

    Parameters
    ----------
    data : datasets.Data
        The data set.
    block_rows : int
        Block rows of the Hankel matrices.

    Returns
    -------
    callable
    """
    open_loop = data.reference is data.u
    signals = np.column_stack([data.u, data.y] if open_loop else [data.u, data.y, data.reference])
    m, n = data.u.shape[1], data.order
    mean, deviation = signals.mean(axis=0), signals.std(axis=0)
    options = MemoryOptions(block_rows=block_rows, order=n, instruments="past-reference", projection="ordinary", dt=1.0)
    hankel_rows = select_rows(options, (m, 1, signals.shape[1] - m - 1), open_loop=open_loop)
    indices = hankel_rows.indices
    dynamic = None if data.regressors is None else data.regressors.reflex
    regression = OutputRegression(0.5 * np.eye(n), np.ones((1, n)), m, dynamic, 1, offsets=True)

    def run():
        x = (signals - mean) / deviation
        gram = hankel_gram([x], hankel_rows.window, hankel_rows.lags)
        columns = _project(gram[np.ix_(indices, indices)], hankel_rows.sizes)[:, :n]
        np.linalg.eigvals(np.linalg.lstsq(columns[:-1], columns[1:], rcond=None)[0])
        regression.solve([[x]], None, 1e-10)

    return run


def _project(gram, sizes):
    """Column space of the projection, from the inner products of the rows of inputs, instruments and outputs."""
    m, z = sizes
    values, vectors = np.linalg.eigh(gram[:m, :m])
    components = (vectors[:, -SIGNIFICANT:] / np.sqrt(np.abs(values[-SIGNIFICANT:]))).T @ gram[:m, m:]
    residual = gram[m:, m:] - components.T @ components
    values, vectors = np.linalg.eigh(residual[:z, :z])
    return np.linalg.svd((vectors / np.sqrt(np.abs(values))).T @ residual[:z, z:])[2].T
