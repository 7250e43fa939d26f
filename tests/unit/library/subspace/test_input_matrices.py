import re

import control
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy import signal as sps

from ankleloop.errors import DataError
from ankleloop.signals.responses import predict_from_reference
from ankleloop.subspace.input_matrices import OutputRegression, simulate_response

SEEDS = st.integers(0, 2**32 - 1)


def estimate_input_matrices(A, C, u, y, dynamic=None, predicted=None):
    regression = OutputRegression(A, C, u.shape[1], dynamic, 1, offsets=True)
    return regression.solve([np.hstack([u, y])], None if predicted is None else [predicted], 1e-10)


def random_model(rng, order, inputs, outputs, radius=0.9):
    A = rng.standard_normal((order, order))
    A *= radius / np.max(np.abs(np.linalg.eigvals(A)))
    return A, rng.standard_normal((order, inputs)), rng.standard_normal((outputs, order)), rng.standard_normal(
        (outputs, inputs)
    )  # fmt: skip


def simulate(A, B, C, D, u, x0):
    """The state-space equations, sample by sample."""
    x, y = np.asarray(x0, float), np.empty((u.shape[0], C.shape[0]))
    for t in range(u.shape[0]):
        y[t] = C @ x + D @ u[t]
        x = A @ x + B @ u[t]
    return y


def is_observable(A, C):
    return (
        np.linalg.cond(np.vstack([C @ np.linalg.matrix_power(A, k) for k in range(A.shape[0])]))
        < 1e3
    )


# --- response


@settings(deadline=None, max_examples=30)
@given(order=st.integers(1, 5), inputs=st.integers(1, 3), outputs=st.integers(1, 3), seed=SEEDS)
def test_response_agrees_with_scipy_and_control(order, inputs, outputs, seed):
    rng = np.random.default_rng(seed)
    A, B, C, D = random_model(rng, order, inputs, outputs, radius=0.98)
    u, x0 = rng.standard_normal((80, inputs)), rng.standard_normal(order)
    y = simulate_response(A, B, C, D, u, x0)
    assert y.shape == (80, outputs)
    np.testing.assert_allclose(y, sps.dlsim((A, B, C, D, 1.0), u, x0=x0)[1], rtol=1e-10, atol=1e-10)
    by_control = control.forced_response(
        control.ss(A, B, C, D, 1.0), inputs=u.T, initial_state=x0, squeeze=False
    )
    np.testing.assert_allclose(y, by_control.outputs.T, rtol=1e-10, atol=1e-10)


# --- exact recovery


@settings(deadline=None, max_examples=60)
@given(
    order=st.integers(1, 4),
    inputs=st.integers(1, 3),
    outputs=st.integers(1, 3),
    mask=st.lists(st.booleans(), min_size=3, max_size=3),
    seed=SEEDS,
)
def test_exact_recovery(order, inputs, outputs, mask, seed):
    rng = np.random.default_rng(seed)
    dynamic = np.array(mask[:inputs])
    A, B, C, D = random_model(rng, order, inputs, outputs)
    assume(is_observable(A, C))
    B[:, ~dynamic] = 0.0
    u, x0, offset = (
        rng.standard_normal((150, inputs)),
        rng.standard_normal(order),
        rng.standard_normal(outputs),
    )
    y = simulate(A, B, C, D, u, x0) + offset
    estimate = estimate_input_matrices(A, C, u, y, dynamic)
    for name, value, truth in (
        ("B", estimate.B, B),
        ("D", estimate.D, D),
        ("x0", estimate.initial_state[0], x0),
        ("offset", estimate.offsets[0], offset),
    ):
        np.testing.assert_allclose(value, truth, atol=1e-8, err_msg=name)
    np.testing.assert_array_equal(estimate.B[:, ~dynamic], 0.0)
    assert estimate.rank == inputs * outputs + order * dynamic.sum() + order + outputs


def test_too_few_samples_are_refused():
    rng = np.random.default_rng(8)
    A, _, C, _ = random_model(rng, 3, 2, 1)
    u, y = rng.standard_normal((11, 2)), rng.standard_normal((11, 1))
    with pytest.raises(
        DataError, match="11 samples cannot determine 12 entries of B, D, x0: record longer"
    ):
        estimate_input_matrices(A, C, u, y)


# --- instruments


PLANT = (
    np.array([[1.5, -0.7], [1.0, 0.0]]),
    np.array([[1.0], [0.0]]),
    np.array([[1.0, 0.5]]),
    np.zeros((1, 1)),
)


def closed_loop(rng, samples, noise):
    """Plant of poles 0.75 ± 0.37j under feedback of its noisy output, the noise strongly coloured."""
    A, B, C, _ = PLANT
    r = rng.standard_normal((samples, 1))
    v = sps.lfilter([1.0], [1.0, -0.9], noise * rng.standard_normal(samples))
    u, y, x = np.empty((samples, 1)), np.empty((samples, 1)), np.zeros(2)
    for t in range(samples):
        y[t] = (C @ x).item() + v[t]
        u[t] = r[t] - 0.25 * y[t]
        x = A @ x + B @ u[t]
    return u, y, r


def test_instruments_remove_the_bias_of_feedback():
    A, B, C, D = PLANT
    truth = np.concatenate([B.ravel(), D.ravel()])
    errors = {
        "least squares": [],
        "noise-free inputs": [],
        "inputs predicted from the reference": [],
    }
    for seed in range(24):
        u, y, r = closed_loop(np.random.default_rng(seed), 4000, noise=1.0)
        clean, _, _ = closed_loop(np.random.default_rng(seed), 4000, noise=0.0)
        # Of the bias, as many parts in 4000 leak through the prediction as it has taps: few, here.
        predicted = predict_from_reference([u - u.mean(axis=0)], [r], leads=0, lags=25)[0]
        for name, instruments in zip(errors, (None, clean, predicted), strict=True):
            estimate = estimate_input_matrices(A, C, u, y, predicted=instruments)
            errors[name].append(np.concatenate([estimate.B.ravel(), estimate.D.ravel()]) - truth)
    errors = {name: np.array(values) for name, values in errors.items()}
    mean = {name: values.mean(axis=0) for name, values in errors.items()}
    deviation = {name: values.std(axis=0, ddof=1) / np.sqrt(24) for name, values in errors.items()}
    significance = {name: np.abs(mean[name]) / deviation[name] for name in errors}
    # B and D of least squares are off by many standard errors, those with instruments within their scatter.
    assert np.max(significance["least squares"]) > 50
    for name in ("noise-free inputs", "inputs predicted from the reference"):
        assert np.max(significance[name]) < 3, name
        assert np.max(np.abs(mean[name])) < 0.02 * np.max(np.abs(mean["least squares"])), name


@pytest.mark.parametrize(("leads", "lags"), [(2, 1), (5, 4)])
def test_prediction_by_a_response_with_leads(leads, lags):
    rng = np.random.default_rng(10)
    r = rng.standard_normal((500, 2))
    taps = rng.standard_normal(
        (4, 2, 3)
    )  # two leads, the present, one lag; two references; three signals
    u = sum(np.roll(r, shift, axis=0) @ taps[k] for k, shift in enumerate((-2, -1, 0, 1)))
    offset = np.array([1.0, -2.0, 3.0])  # which no lag of the reference explains
    predicted = predict_from_reference([u + offset], [r], leads, lags)[0]
    difference = (u - predicted)[5:-5]
    np.testing.assert_allclose(
        difference, np.broadcast_to(difference[0], difference.shape), atol=1e-9
    )


# --- sizes


@pytest.mark.parametrize(
    ("name", "shape"),
    [("A", (2, 3)), ("C", (1, 3)), ("D", (1, 2)), ("u", (5, 2)), ("x0", (3,))],
)
def test_sizes_that_do_not_agree_are_refused(name, shape):
    names = ("A", "B", "C", "D", "u", "x0")
    shapes = dict(zip(names, [(2, 2), (2, 1), (1, 2), (1, 1), (5, 1), (2,)], strict=True))
    arrays = [np.ones(size) for size in (shapes | {name: shape}).values()]
    with pytest.raises(ValueError, match=re.escape(str(shape)) + ".* they must be"):
        simulate_response(*arrays)


def test_one_input_may_be_one_dimensional():
    u = np.random.default_rng(0).standard_normal(20)
    np.testing.assert_array_equal(
        simulate_response(*PLANT, u), simulate_response(*PLANT, u[:, None])
    )
