"""The kernels that an identification cannot do without, on its data: the time that nothing can go below."""

import numpy as np
from scipy.linalg import blas, lapack

from ankleloop.subspace.compression import HankelRows
from ankleloop.subspace.input_matrices import BLOCK, sensitivities


def floor(data, rows):
    """A call that runs the kernels once and nothing else.

    They are: products of lagged samples and the displacement of their blocks; a factor of the input rows, with its
    condition for the rank policy (eigenvectors where the inputs are deficient); what the inputs leave of the other
    rows; the same factor of the instruments; the decomposition that shows the order; and for B, D and the initial state
    their regressors, normal equations and solution.
    """
    u, y = (x - x.mean(axis=0) for x in (data.u, data.y))
    scale = u.std(axis=0)
    open_loop = data.reference is data.u
    parts = [u / scale, y / y.std()] + ([] if open_loop else [data.reference / data.reference.std()])
    m, x = u.shape[1], np.column_stack(parts)
    instruments = np.arange(m) if open_loop else np.arange(m + 1, x.shape[1])
    chosen = HankelRows(m, 1, instruments, rows, rows, 0)
    indices = chosen.indices(x.shape[1])
    cut = np.cumsum(chosen.sizes)
    deficient = not open_loop
    n = data.order
    dynamic = np.arange(m) if data.regressors is None else np.flatnonzero(data.regressors.reflex)
    A, C = 0.5 * np.eye(n), np.ones((1, n))
    space = np.zeros((min(BLOCK, len(x)), 1, m + n * dynamic.size + n + 1))

    def run():
        gram = chosen.gram(x.shape[1])
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
        np.linalg.svd(lapack.dtrtrs(factor, left[:size, size:], lower=1)[0].T, full_matrices=False)
        observed, driven, normal = C.copy(), np.zeros((dynamic.size, 1, n)), 0.0
        for start in range(0, len(x), BLOCK):
            block = slice(start, start + BLOCK)
            phi = sensitivities(A, C, x[block, :m], dynamic, observed, driven, space[: len(x) - start])[:, 0]
            normal = normal + blas.dsyrk(1.0, phi.T)
            x[block, m] @ phi
        np.linalg.eigh(normal, UPLO="U")

    return run
