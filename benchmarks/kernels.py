"""Lower bound of the time of an identification by inner products and simulated responses: its kernels, on its data."""

import numpy as np
from scipy.linalg import blas, lapack

from ankleloop.subspace.hankel_rows import HankelRows
from ankleloop.subspace.input_matrices import CHUNK, OutputRegression

SIGNIFICANT = 80  # directions of deficient inputs that count


def prepare_kernels(data, block_rows):
    """A call that runs the kernels once and nothing else.

    They are: signals of zero mean and unit variance, which a decision about ranks needs; products of lagged samples and
    their displacement along the Hankel rows; a factor of the input rows, with its condition for the decision about
    their rank (eigenvectors where the inputs are deficient); the other rows less their fit by the inputs; the same
    factor of the instruments; the decomposition that shows the order; A by least squares, and its poles; and for B, D
    and the initial state their regressors, normal equations and solution.

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
    instruments = np.arange(m) if open_loop else np.arange(m + 1, signals.shape[1])
    hankel_rows = HankelRows(m, 1, instruments, block_rows, block_rows, 0)
    indices = hankel_rows.list_indices(signals.shape[1])
    dynamic = None if data.regressors is None else data.regressors.reflex
    regression = OutputRegression(0.5 * np.eye(n), np.ones((1, n)), m, dynamic)

    def run():
        x = (signals - mean) / deviation
        gram = hankel_rows.start_gram(signals.shape[1])
        gram.add(x)
        columns = _project(gram.matrix(indices), hankel_rows.sizes, deficient=not open_loop)[:, :n]
        np.linalg.eigvals(np.linalg.lstsq(columns[:-1], columns[1:], rcond=None)[0])
        _solve_regression(regression, x[:, :m], x[:, m])

    return run


def _project(gram, sizes, *, deficient):
    """Column space of the projection, from the inner products of the rows of inputs, instruments and outputs."""
    m, z = sizes
    inputs, products = gram[:m, :m], gram[:m, m:]
    if deficient:
        values, vectors = np.linalg.eigh(inputs)
        components = (vectors[:, -SIGNIFICANT:] / np.sqrt(np.abs(values[-SIGNIFICANT:]))).T @ products
    else:
        factor, _ = lapack.dpotrf(inputs, lower=1)
        lapack.dpocon(factor, 1.0, uplo="L")
        components = lapack.dtrtrs(factor, products, lower=1)[0]
    residual = gram[m:, m:] - components.T @ components
    factor, _ = lapack.dpotrf(residual[:z, :z], lower=1)
    lapack.dpocon(factor, 1.0, uplo="L")
    explained = lapack.dtrtrs(factor, residual[:z, z:], lower=1)[0]
    return np.linalg.svd(np.linalg.qr(explained, mode="r").T, full_matrices=False)[0]


def _solve_regression(regression, inputs, output):
    """Regressors of B, D and the initial state, their normal equations, and the eigenvectors of these."""
    chunks = [slice(start, start + CHUNK) for start in range(0, len(inputs), CHUNK)]
    normal = 0.0
    for chunk, phi in zip(chunks, regression.generate_regressors(inputs[chunk] for chunk in chunks), strict=True):
        normal = normal + blas.dsyrk(1.0, phi.T)
        output[chunk] @ phi
    np.linalg.eigh(normal, UPLO="U")
