"""The programs that are compared, each as a function of data and block rows that returns A, B, C, D."""

import importlib.util

import numpy as np

from ankleloop.methods.moesp import REGRESSION_TOLERANCE, torques
from ankleloop.subspace import moesp

PEERS = {
    "ctrlsys": "ctrlsys",
    "ctrlsys, IB01BD": "ctrlsys",
    "sippy_unipi": "sippy_unipi",
    "nfoursid": "nfoursid",
}
RANK_TOLERANCE = 1e-5  # what identify_moesp takes


def available(name):
    """Whether a peer is installed."""
    return importlib.util.find_spec(PEERS[name]) is not None


def _options(data):
    if data.regressors is None:
        return {}
    tolerances = {"rank_tolerance": RANK_TOLERANCE, "regression_tolerance": REGRESSION_TOLERANCE}
    return {"dynamic": data.regressors.reflex, **tolerances}


def _ankleloop(data, rows):
    return moesp(data.u, data.y, rows, data.order, "past-reference", reference=data.reference, **_options(data))


def ankleloop(data, rows):
    """MOESP with the past reference as instrument: A, B, C, D and initial state."""
    found = _ankleloop(data, rows).matrices
    return found.A, found.B, found.C, found.D


def with_torques(data, rows):
    """The same with the three torques."""
    found = _ankleloop(data, rows)
    return torques(found.matrices, found.initial_state, data.regressors)


def _slicot(data, rows):
    """A, B, C, D by SLICOT: IB01AD by its fastest route, IB01BD by the combined method, whose B and D are right."""
    import ctrlsys as slicot

    u, y = (np.array(x - x.mean(axis=0), order="F") for x in (data.u, data.y))
    samples, m, p = len(u), u.shape[1], y.shape[1]
    for route in "CQ":  # Cholesky factor; QR where that breaks down
        try:
            _, r, _, _, info = slicot.ib01ad("M", route, "N", "O", "N", "N", rows, m, p, u, y, 0.0, -1.0)
        except ArithmeticError:
            info = -1
        if not info:
            break
    if info:
        raise ArithmeticError(f"IB01AD ended with info {info}")
    A, C, B, D, *_, info = slicot.ib01bd("C", "A", "N", rows, data.order, m, p, samples, r, 0.0)
    if info:
        raise ArithmeticError(f"IB01BD ended with info {info}")
    return u, y, A, B, C, D


def slicot_matrices(data, rows):
    """SLICOT without initial state: B and D from the factor of the Hankel matrix."""
    return _slicot(data, rows)[2:]


def ctrlsys(data, rows):
    """SLICOT, complete: B, D and the initial state by IB01CD, from simulated responses, as ankleloop finds them."""
    import ctrlsys as slicot

    u, y, *matrices = _slicot(data, rows)
    A, B, C, D = (np.asfortranarray(matrix) for matrix in matrices)
    n, m, p = len(A), u.shape[1], y.shape[1]
    _, B, D, *_, info = slicot.ib01cd("X", "C", "D", n, m, p, A, B, C, D, u, y, 0.0)
    if info:
        raise ArithmeticError(f"IB01CD ended with info {info}")
    return A, B, C, D


def sippy(data, rows):
    """SIPPY's MOESP."""
    from sippy_unipi import system_identification

    u, y = (data.u - data.u.mean(axis=0)).T, (data.y - data.y.mean(axis=0)).T
    given = {"SS_fixed_order": data.order, "SS_f": rows, "SS_D_required": True}
    found = system_identification(y, u, "MOESP", **given)
    return found.A, found.B, found.C, found.D


def nfoursid(data, rows):
    """nfoursid's PO-MOESP."""
    import pandas as pd
    from nfoursid.nfoursid import NFourSID

    u, y = data.u - data.u.mean(axis=0), data.y - data.y.mean(axis=0)
    inputs, outputs = [f"u{k}" for k in range(u.shape[1])], ["y"]
    frame = pd.DataFrame(np.hstack([u, y]), columns=[*inputs, *outputs])
    found = NFourSID(frame, output_columns=outputs, input_columns=inputs, num_block_rows=rows)
    found.subspace_identification()
    model, _ = found.system_identification(rank=data.order)
    return model.a, model.b, model.c, model.d


_ALL = {
    "ankleloop": ankleloop,
    "ctrlsys": ctrlsys,
    "ctrlsys, IB01BD": slicot_matrices,
    "sippy_unipi": sippy,
    "nfoursid": nfoursid,
}
PROGRAMS = {name: program for name, program in _ALL.items() if name == "ankleloop" or available(name)}
