"""The programs that are compared, each as a function of data and block rows that returns A, B, C, D."""

import importlib.util
from functools import partial

import numpy as np

from ankleloop.joint.models import simulate_torques
from ankleloop.methods.moesp import REGRESSION_TOLERANCE, MoespOptions
from ankleloop.subspace import moesp

PACKAGES = {
    "ctrlsys": "ctrlsys",
    "ctrlsys, IB01BD": "ctrlsys",
    "ctrlsys, units of the data": "ctrlsys",
    "sippy_unipi": "sippy_unipi",
    "nfoursid": "nfoursid",
}


def is_installed(name):
    """Whether the package of a program is installed."""
    return importlib.util.find_spec(PACKAGES[name]) is not None


def _identify_by_ankleloop(data, block_rows, *, known_rows=True):
    options = {}
    if data.regressors is not None:
        options = {
            "dynamic": data.regressors.reflex if known_rows else None,
            "rank_tolerance": MoespOptions.defaults()["rank_tolerance"],
            "regression_tolerance": REGRESSION_TOLERANCE,
        }
    return moesp(data.u, data.y, block_rows, data.order, data.instruments, reference=data.reference, **options)


def ankleloop(data, block_rows):
    """MOESP with the instruments of the data: A, B, C, D and initial state."""
    model = _identify_by_ankleloop(data, block_rows).matrices
    return model.A, model.B, model.C, model.D


def ankleloop_with_torques(data, block_rows):
    """The same and the three torques."""
    estimate = _identify_by_ankleloop(data, block_rows)
    return simulate_torques(estimate.matrices, estimate.initial_state, data.regressors)


def ankleloop_free_b(data, block_rows):
    """The same without the knowledge which inputs do not drive the state."""
    model = _identify_by_ankleloop(data, block_rows, known_rows=False).matrices
    return model.A, model.B, model.C, model.D


def _remove_means(data, *, scaling=True):
    """Deviations of inputs and outputs from their means, by default of unit variance; and the scales."""
    deviations = [x - x.mean(axis=0) for x in (data.u, data.y)]
    scales = [x.std(axis=0) if scaling else np.ones(x.shape[1]) for x in deviations]
    return [x / scale for x, scale in zip(deviations, scales, strict=True)], scales


def _restore_units(scales, A, B, C, D):
    """The model of scaled data in the units of the data."""
    u_scale, y_scale = scales[0], scales[1][:, None]
    return A, B / u_scale, y_scale * C, y_scale * D / u_scale


def _identify_by_slicot(data, block_rows, *, scaling=True):
    """Data, scales and A, B, C, D by SLICOT: IB01AD by its fastest route, IB01BD by the combined method."""
    import ctrlsys as slicot

    signals, scales = _remove_means(data, scaling=scaling)
    u, y = map(np.asfortranarray, signals)
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
    return u, y, scales, A, B, C, D


def ctrlsys_without_ib01cd(data, block_rows):
    """SLICOT without initial state: B and D from the factor of the Hankel matrix."""
    _, _, scales, *matrices = _identify_by_slicot(data, block_rows)
    return _restore_units(scales, *matrices)


def ctrlsys(data, block_rows, *, scaling=True):
    """SLICOT, complete: B, D and the initial state by IB01CD, from simulated responses as in ankleloop."""
    import ctrlsys as slicot

    u, y, scales, *matrices = _identify_by_slicot(data, block_rows, scaling=scaling)
    A, B, C, D = (np.asfortranarray(matrix) for matrix in matrices)
    n, m, p = len(A), u.shape[1], y.shape[1]
    _, B, D, *_, info = slicot.ib01cd("X", "C", "D", n, m, p, A, B, C, D, u, y, 0.0)
    if info:
        raise ArithmeticError(f"IB01CD ended with info {info}")
    return _restore_units(scales, A, B, C, D)


def sippy(data, block_rows):
    """SIPPY's MOESP."""
    from sippy_unipi import system_identification

    (u, y), scales = _remove_means(data)
    options = {"SS_fixed_order": data.order, "SS_f": block_rows, "SS_D_required": True}
    model = system_identification(y.T, u.T, "MOESP", **options)
    return _restore_units(scales, model.A, model.B, model.C, model.D)


def nfoursid(data, block_rows):
    """nfoursid's PO-MOESP."""
    import pandas as pd
    from nfoursid.nfoursid import NFourSID

    (u, y), scales = _remove_means(data)
    inputs, outputs = ([f"{name}{k}" for k in range(x.shape[1])] for name, x in (("u", u), ("y", y)))
    frame = pd.DataFrame(np.hstack([u, y]), columns=[*inputs, *outputs])
    identification = NFourSID(frame, output_columns=outputs, input_columns=inputs, num_block_rows=block_rows)
    identification.subspace_identification()
    model, _ = identification.system_identification(rank=data.order)
    return _restore_units(scales, model.a, model.b, model.c, model.d)


_ALL = {
    "ankleloop": ankleloop,
    "ctrlsys": ctrlsys,
    "ctrlsys, IB01BD": ctrlsys_without_ib01cd,
    "sippy_unipi": sippy,
    "nfoursid": nfoursid,
}
PROGRAMS = {name: program for name, program in _ALL.items() if name == "ankleloop" or is_installed(name)}
# Only on the data of the paper, whose channels differ in size by orders of magnitude.
PAPER_PROGRAMS = {"ankleloop, B not known to be zero": ankleloop_free_b}
if is_installed("ctrlsys"):
    PAPER_PROGRAMS["ctrlsys, units of the data"] = partial(ctrlsys, scaling=False)


def select_programs(case):
    """Programs that identify a case."""
    return PROGRAMS | (PAPER_PROGRAMS if case.kind == "paper" else {})
