"""The programs that are compared, each as a function of data and block rows that returns A, B, C, D."""

import importlib.util
from functools import partial

import numpy as np
import pandas as pd

from ankleloop.methods.moesp import REGRESSION_TOLERANCE, MoespOptions
from ankleloop.subspace import moesp


def identify_by_ankleloop(data, block_rows, *, known_rows=True):
    """MOESP with the instruments of the data, by default with the knowledge which inputs do not drive the state."""
    options = {}
    if data.dynamic is not None:
        options = {
            "dynamic": data.dynamic if known_rows else None,
            "rank_tolerance": MoespOptions.defaults()["rank_tolerance"],
            "regression_tolerance": REGRESSION_TOLERANCE,
        }
    estimate = moesp(
        data.u,
        data.y,
        block_rows,
        data.order,
        data.instruments,
        reference=data.reference,
        **options,
    )
    model = estimate.matrices
    return model.A, model.B, model.C, model.D


def _with_unit_variance(identify):
    """The program on deviations from the means of unit variance; its model in the units of the data."""

    def identify_deviations(data, block_rows):
        deviations = [x - x.mean(axis=0) for x in (data.u, data.y)]
        u_scale, y_scale = (x.std(axis=0) for x in deviations)
        A, B, C, D = identify(
            deviations[0] / u_scale, deviations[1] / y_scale, data.order, block_rows
        )
        return A, B / u_scale, y_scale[:, None] * C, y_scale[:, None] * D / u_scale

    return identify_deviations


def identify_by_slicot(u, y, order, block_rows, *, complete=True):
    """SLICOT: IB01AD by its fastest route, IB01BD by the combined method.

    Complete: B, D and the initial state by IB01CD, from simulated responses as in ankleloop.
    """
    import ctrlsys as slicot

    u, y = np.asfortranarray(u), np.asfortranarray(y)
    samples, m, p = len(u), u.shape[1], y.shape[1]
    for route in "CQ":  # Cholesky factor; QR where that breaks down
        try:
            _, r, _, _, info = slicot.ib01ad(
                "M", route, "N", "O", "N", "N", block_rows, m, p, u, y, 0.0, -1.0
            )
        except ArithmeticError:
            info = -1
        if not info:
            break
    if not info:
        A, C, B, D, *_, info = slicot.ib01bd(
            "C", "A", "N", block_rows, order, m, p, samples, r, 0.0
        )
    if complete and not info:
        A, B, C, D = (np.asfortranarray(matrix) for matrix in (A, B, C, D))
        _, B, D, *_, info = slicot.ib01cd("X", "C", "D", order, m, p, A, B, C, D, u, y, 0.0)
    if info:
        raise ArithmeticError(f"SLICOT ended with info {info}")
    return A, B, C, D


def identify_by_sippy(u, y, order, block_rows):
    """SIPPY's MOESP."""
    from sippy_unipi import system_identification

    model = system_identification(
        y.T, u.T, "MOESP", SS_fixed_order=order, SS_f=block_rows, SS_D_required=True
    )
    return model.A, model.B, model.C, model.D


def identify_by_nfoursid(u, y, order, block_rows):
    """nfoursid's PO-MOESP."""
    from nfoursid.nfoursid import NFourSID

    inputs, outputs = (
        [f"{name}{k}" for k in range(x.shape[1])] for name, x in (("u", u), ("y", y))
    )
    frame = pd.DataFrame(np.hstack([u, y]), columns=[*inputs, *outputs])
    identification = NFourSID(
        frame, output_columns=outputs, input_columns=inputs, num_block_rows=block_rows
    )
    identification.subspace_identification()
    model, _ = identification.system_identification(rank=order)
    return model.a, model.b, model.c, model.d


OTHERS = {
    "ctrlsys": identify_by_slicot,
    "ctrlsys, IB01BD": partial(identify_by_slicot, complete=False),
    "sippy_unipi": identify_by_sippy,
    "nfoursid": identify_by_nfoursid,
}
MISSING = [name for name in OTHERS if importlib.util.find_spec(name.split(",")[0]) is None]


def select_programs(case):
    """Programs that identify a case, by name; on the data of the paper B has rows of zeros."""
    programs = {"ankleloop": identify_by_ankleloop}
    programs |= {
        name: _with_unit_variance(program)
        for name, program in OTHERS.items()
        if name not in MISSING
    }
    if case.kind == "paper":
        programs["ankleloop, B not known to be zero"] = partial(
            identify_by_ankleloop, known_rows=False
        )
    return programs
