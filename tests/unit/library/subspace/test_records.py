"""Merged records: nothing reaches across their seams."""

import numpy as np
import pytest

from ankleloop import DataError
from ankleloop.subspace import moesp, simulate_response

A = np.array([[0.75, -0.37], [0.37, 0.75]])
B = np.array([[1.0, 0.3], [-0.5, 0.8]])
C = np.array([[1.0, 0.5]])
D = np.array([[0.2, -1.0]])


def simulate_records(lengths, noise=0.0, seed=0):
    """Records of one system, with different initial states and offsets."""
    rng = np.random.default_rng(seed)
    starts = 5.0 * rng.standard_normal((len(lengths), 2))
    inputs = [rng.standard_normal((n, 2)) + 3.0 * rng.standard_normal(2) for n in lengths]
    outputs = [
        simulate_response(A, B, C, D, u, x0) + noise * rng.standard_normal((len(u), 1))
        for u, x0 in zip(inputs, starts, strict=True)
    ]
    return inputs, outputs, starts


@pytest.mark.parametrize("instruments", ["none", "past-input", "past-input-output"])
def test_short_records_are_merged_exactly(instruments):
    u, y, _ = simulate_records([90, 60, 140, 75, 200])
    estimate = moesp(u, y, 6, 2, instruments)
    np.testing.assert_allclose(
        np.sort_complex(estimate.model.poles()), np.sort_complex(np.linalg.eigvals(A)), atol=1e-9
    )
    np.testing.assert_allclose(estimate.model.D, D, atol=1e-8)
    assert estimate.initial_state.shape == (5, 2)


def test_records_in_closed_loop_with_a_reference():
    rng = np.random.default_rng(3)
    u, y, r = [], [], []
    for n in (400, 300, 500):
        reference, noise = rng.standard_normal(n), 0.05 * rng.standard_normal(n)
        x, inputs, outputs = np.zeros(2), np.empty((n, 1)), np.empty((n, 1))
        for t in range(n):
            outputs[t] = C @ x + noise[t]
            inputs[t] = reference[t] - 0.2 * outputs[t]
            x = A @ x + B[:, 0] * inputs[t]
        u, y, r = [*u, inputs], [*y, outputs], [*r, reference]
    estimate = moesp(
        u,
        y,
        6,
        2,
        "past-reference",
        "correlation",
        r,
        instrument_rows=20,
        input_matrices="instruments",
    )
    np.testing.assert_allclose(
        np.sort_complex(estimate.model.poles()), np.sort_complex(np.linalg.eigvals(A)), atol=0.02
    )
    assert estimate.diagnostics["instrument_rows"] == 20


def test_records_too_short_for_a_column_are_skipped():
    u, y, _ = simulate_records([150, 5, 150])
    estimate = moesp(u, y, 6, 2)
    np.testing.assert_allclose(
        np.sort_complex(estimate.model.poles()), np.sort_complex(np.linalg.eigvals(A)), atol=1e-9
    )


def test_the_error_names_records_that_do_not_agree():
    u, y, _ = simulate_records([100, 80])
    with pytest.raises(DataError, match="2 records of inputs, 1 of the output"):
        moesp(u, y[:1], 6, 2)
    with pytest.raises(DataError, match="80 samples of inputs, 79 of the output in record 1"):
        moesp(u, [y[0], y[1][:-1]], 6, 2)
    with pytest.raises(DataError, match=r"the record of 9 \+ 8 samples is shorter"):
        moesp([u[0][:9], u[1][:8]], [y[0][:9], y[1][:8]], 6, 2)
    y[1][7] = np.nan
    with pytest.raises(DataError, match="output 0 is not finite at sample 7 of record 1"):
        moesp(u, y, 6, 2)
