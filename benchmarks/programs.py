"""The programs that are compared, each as a function of data and block rows that returns A, B, C, D."""

import importlib.util

import numpy as np

from ankleloop import method_options
from ankleloop.methods.moesp import REGRESSION_TOLERANCE, simulate_torques
from ankleloop.subspace import moesp

PACKAGES = {
    "ctrlsys": "ctrlsys",
    "ctrlsys, IB01BD": "ctrlsys",
    "sippy_unipi": "sippy_unipi",
    "nfoursid": "nfoursid",
}


def is_installed(name):
    """Whether the package of a program is installed."""
    return importlib.util.find_spec(PACKAGES[name]) is not None


def _identify_by_ankleloop(data, block_rows):
    options = {}
    if data.regressors is not None:
        options = {
            "dynamic": data.regressors.reflex,
            "rank_tolerance": method_options("pr-moesp")["rank_tolerance"],
            "regression_tolerance": REGRESSION_TOLERANCE,
        }
    return moesp(data.u, data.y, block_rows, data.order, "past-reference", reference=data.reference, **options)


def ankleloop(data, block_rows):
    """MOESP with the past reference as instrument: A, B, C, D and initial state."""
    model = _identify_by_ankleloop(data, block_rows).matrices
    return model.A, model.B, model.C, model.D


def ankleloop_with_torques(data, block_rows):
    """The same and the three torques."""
    estimate = _identify_by_ankleloop(data, block_rows)
    return simulate_torques(estimate.matrices, estimate.initial_state, data.regressors)


def _remove_means(data):
    return data.u - data.u.mean(axis=0), data.y - data.y.mean(axis=0)


def _identify_by_slicot(data, block_rows):
    """Data and A, B, C, D by SLICOT: IB01AD by its fastest route, IB01BD by the combined method."""
    import ctrlsys as slicot

    u, y = (np.asfortranarray(x) for x in _remove_means(data))
    samples, m, p = len(u), u.shape[1], y.shape[1]
    for route in "CQ":  # Cholesky factor; QR where that breaks down
        try:
            _, r, _, _, info = slicot.ib01ad("M", route, "N", "O", "N", "N", block_rows, m, p, u, y, 0.0, -1.0)
        except ArithmeticError:
            info = -1
        if not info:
            break
    if info:
        raise ArithmeticError(f"IB01AD ended with info {info}")
    A, C, B, D, *_, info = slicot.ib01bd("C", "A", "N", block_rows, data.order, m, p, samples, r, 0.0)
    if info:
        raise ArithmeticError(f"IB01BD ended with info {info}")
    return u, y, A, B, C, D


def ctrlsys_without_ib01cd(data, block_rows):
    """SLICOT without initial state: B and D from the factor of the Hankel matrix."""
    return _identify_by_slicot(data, block_rows)[2:]


def ctrlsys(data, block_rows):
    """SLICOT, complete: B, D and the initial state by IB01CD, from simulated responses as in ankleloop."""
    import ctrlsys as slicot

    u, y, *matrices = _identify_by_slicot(data, block_rows)
    A, B, C, D = (np.asfortranarray(matrix) for matrix in matrices)
    n, m, p = len(A), u.shape[1], y.shape[1]
    _, B, D, *_, info = slicot.ib01cd("X", "C", "D", n, m, p, A, B, C, D, u, y, 0.0)
    if info:
        raise ArithmeticError(f"IB01CD ended with info {info}")
    return A, B, C, D


def sippy(data, block_rows):
    """SIPPY's MOESP."""
    from sippy_unipi import system_identification

    u, y = _remove_means(data)
    options = {"SS_fixed_order": data.order, "SS_f": block_rows, "SS_D_required": True}
    model = system_identification(y.T, u.T, "MOESP", **options)
    return model.A, model.B, model.C, model.D


def nfoursid(data, block_rows):
    """nfoursid's PO-MOESP."""
    import pandas as pd
    from nfoursid.nfoursid import NFourSID

    u, y = _remove_means(data)
    inputs, outputs = [f"u{k}" for k in range(u.shape[1])], ["y"]
    frame = pd.DataFrame(np.hstack([u, y]), columns=[*inputs, *outputs])
    identification = NFourSID(frame, output_columns=outputs, input_columns=inputs, num_block_rows=block_rows)
    identification.subspace_identification()
    model, _ = identification.system_identification(rank=data.order)
    return model.a, model.b, model.c, model.d


_ALL = {
    "ankleloop": ankleloop,
    "ctrlsys": ctrlsys,
    "ctrlsys, IB01BD": ctrlsys_without_ib01cd,
    "sippy_unipi": sippy,
    "nfoursid": nfoursid,
}
PROGRAMS = {name: program for name, program in _ALL.items() if name == "ankleloop" or is_installed(name)}
