"""The kernels that an identification cannot do without, on its data: the time that nothing can go below."""

import numpy as np
from scipy.linalg import blas, lapack

from ankleloop.subspace.compression import HankelRows
from ankleloop.subspace.input_matrices import BLOCK, sensitivities


def floor(data, rows):
    """A call that runs the kernels once and nothing else.

    They are: signals of zero mean and unit variance, without which no rank can be judged; products of lagged samples
    and the displacement of their blocks; a factor of the input rows, with its condition for the rank policy
    (eigenvectors where the inputs are deficient); what the inputs leave of the other rows; the same factor of the
    instruments; the decomposition that shows the order; A by least squares, and its poles; and for B, D and the initial
    state their regressors, normal equations and solution.
    """
    open_loop = data.reference is data.u
    raw = np.column_stack([data.u, data.y] if open_loop else [data.u, data.y, data.reference])
    m = data.u.shape[1]
    mean, deviation = raw.mean(axis=0), raw.std(axis=0)
    instruments = np.arange(m) if open_loop else np.arange(m + 1, raw.shape[1])
    chosen = HankelRows(m, 1, instruments, rows, rows, 0)
    indices = chosen.indices(raw.shape[1])
    cut = np.cumsum(chosen.sizes)
    deficient = not open_loop
    n = data.order
    dynamic = np.arange(m) if data.regressors is None else np.flatnonzero(data.regressors.reflex)
    A, C = 0.5 * np.eye(n), np.ones((1, n))
    space = np.zeros((min(BLOCK, len(raw)), 1, m + n * dynamic.size + n + 1))

    def run():
        x = (raw - mean) / deviation
        gram = chosen.gram(raw.shape[1])
        gram.add(x)
        G = gram.matrix(indices)
        inputs, others = G[: cut[0], : cut[0]], G[: cut[0], cut[0] :]
        if deficient:
            values, vectors = np.linalg.eigh(inputs)
            beside = (vectors[:, -80:] / np.sqrt(np.abs(values[-80:]))).T @ others
        else:
            factor, _ = lapack.dpotrf(inputs, lower=1)
            lapack.dpocon(factor, 1.0, uplo="L")
            beside = lapack.dtrtrs(factor, others, lower=1)[0]
        left = G[cut[0] :, cut[0] :] - beside.T @ beside
        size = cut[1] - cut[0]
        factor, _ = lapack.dpotrf(left[:size, :size], lower=1)
        lapack.dpocon(factor, 1.0, uplo="L")
        explained = lapack.dtrtrs(factor, left[:size, size:], lower=1)[0]
        columns = np.linalg.svd(np.linalg.qr(explained, mode="r").T, full_matrices=False)[0][:, :n]
        np.linalg.eigvals(np.linalg.lstsq(columns[:-1], columns[1:], rcond=None)[0])
        observed, driven, normal = C.copy(), np.zeros((1, n * dynamic.size)), 0.0
        for start in range(0, len(x), BLOCK):
            block = slice(start, start + BLOCK)
            phi = sensitivities(A, C, x[block, :m], dynamic, observed, driven, space[: len(x) - start])[:, 0]
            normal = normal + blas.dsyrk(1.0, phi.T)
            x[block, m] @ phi
        np.linalg.eigh(normal, UPLO="U")

    return run
