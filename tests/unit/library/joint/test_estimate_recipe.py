"""The recipe of docs/reference/estimates.md in plain numpy: torques of a position record from the file alone."""

import h5netcdf
import numpy as np
import pytest
import scipy.io
from scipy.interpolate import BSpline

from ankleloop import identify, save_estimate, simulate, vaf

CASES = {
    "moesp": ("pr-moesp", {}),
    "rectifier": ("pr-moesp", {"basis": "rectifier", "delay": 0.0423, "order": 3}),
    "spline": ("pr-moesp", {"basis": "spline", "free_b": True, "identification_rate": 125.0}),
    "riv": ("riv", {"order": 3, "basis": "chebyshev"}),
    "riv spline": ("riv", {"basis": "spline", "degree": 6, "delay": None}),
}


def read_netcdf(path):
    with h5netcdf.File(path) as file:
        model = {name: variable[...] for name, variable in file["model"].variables.items()}
        return model | dict(file["model"].attrs), file["torque/time"][...]


def read_matlab(path):
    struct = scipy.io.loadmat(path, simplify_cells=True)["estimate"]
    return struct["model"], struct["torque"]["time"]


def sum_lags(x, kernel, lag, samples):
    return x[np.asarray(samples)[:, None] - np.asarray(lag, dtype=int)] @ kernel


def expand(model, v):
    if model["basis"] == "rectifier":
        return np.maximum(v, 0.0)[:, None]
    if model["basis"] == "spline":
        return expand_spline(np.asarray(model["basis_knots"]), v)
    x = v / model["basis_scale"]
    terms = [np.ones_like(x), x]
    while len(terms) <= model["degree"]:
        terms.append(2 * x * terms[-1] - terms[-2])
    return np.column_stack(terms[1:])


def expand_spline(knots, v):
    """Cubic B-splines, without the first one, and constant beyond the ends."""
    inside = np.clip(v, knots[0], knots[-1])
    return BSpline.design_matrix(inside, knots, 3).toarray()[:, 1:]


def make_inputs(model, time, position, start=0.0):
    p = position - position.mean()
    n = np.round((time - start) * model["recording_rate"]).astype(int)
    kernel, lag = (
        np.asarray(model["decimation_kernel"]),
        np.asarray(model["decimation_lag"], dtype=int),
    )
    motion = [sum_lags(p, row, lag, n) for row in kernel]
    needed = np.arange(n[0] - lag.max(), n[-1] - lag.min() + 1)
    v = sum_lags(p, model["velocity_kernel"], model["velocity_lag"], needed)
    drive = [sum_lags(term, kernel[0], lag, n - needed[0]) for term in expand(model, v).T]
    u = np.column_stack([*motion, *drive])
    return u - u.mean(axis=0)


def simulate_path(model, u, state):
    A, B, C, D = (np.atleast_2d(model[name]) for name in "ABCD")
    A, B, C, D = A.reshape(len(A), -1), B.reshape(len(A), -1), C.reshape(1, -1), D.reshape(1, -1)
    y = np.empty(len(u))
    for t, row in enumerate(u):
        y[t] = (C @ state + D @ row).item()
        state = A @ state + B @ row
    return y - y.mean()


def compute_torques(model, time, position):
    u = make_inputs(model, time, position)
    motion = np.arange(u.shape[1]) < 3
    state = np.ravel(model.get("initial_state", np.zeros(len(model["A"]))))
    intrinsic = simulate_path(model, np.where(motion, u, 0.0), 0.0 * state)
    reflex = simulate_path(model, np.where(motion, 0.0, u), state)
    return {"net": intrinsic + reflex, "intrinsic": intrinsic, "reflex": reflex}


@pytest.fixture(scope="module")
def trial():
    return simulate(seed=1, duration=20.0)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize(
    ("container", "read"), [(".nc", read_netcdf), (".mat", read_matlab)], ids=["nc", "mat"]
)
def test_the_recipe_gives_the_torques_of_the_estimate(case, container, read, trial, tmp_path):
    method, options = CASES[case]
    estimate = identify(trial, method, **options)
    save_estimate(estimate, tmp_path / f"e{container}")
    torques = compute_torques(*read(tmp_path / f"e{container}"), trial["position"].values)
    for name, torque in torques.items():
        expected = estimate.torque[name].values
        if method == "riv" and name != "intrinsic":
            # Its dynamics are those of the recording rate, and it is at rest when the record begins, not 0.4 s later.
            assert vaf(expected[100:], torque[100:]) > 99.9
        else:
            np.testing.assert_allclose(torque, expected, atol=1e-9 * np.ptp(expected))
