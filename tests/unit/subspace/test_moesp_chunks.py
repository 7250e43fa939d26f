import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ankleloop.errors import DataError
from ankleloop.subspace import moesp, moesp_chunks


def simulate_data(samples=1500, seed=0, noise=0.1, alike=1.0):
    rng = np.random.default_rng(seed)
    r = rng.standard_normal((samples, 1))
    u = (
        np.hstack([r + 0.5 * np.roll(r, 1), 0.3 * r])
        + 0.2 * rng.standard_normal((samples, 2))
        + 4.0
    )
    u[:, 1] = alike * u[:, 1] + (1.0 - alike) * u[:, 0]
    y, x = np.empty((samples, 1)), np.zeros(2)
    for t in range(samples):
        y[t] = x.sum() + u[t] @ [0.5, -2.0]
        x = np.array([0.8, -0.4]) * x + u[t]
    return u, y + noise * rng.standard_normal(y.shape), r


def split(u, y, r, length):
    return lambda: (
        (u[k : k + length], y[k : k + length], None if r is None else r[k : k + length])
        for k in range(0, len(u), length)
    )


@settings(deadline=None, max_examples=15)
@given(
    length=st.integers(1, 1600),
    instruments=st.sampled_from(["none", "past-input", "past-reference"]),
)
def test_the_estimate_is_that_of_the_record_in_memory(length, instruments):
    u, y, r = simulate_data(400)
    expected = moesp(u, y, 6, 2, instruments, reference=r)
    estimate = moesp_chunks(split(u, y, r, length), 6, 2, instruments)
    poles = [np.sort(model.diagnostics["poles"]) for model in (expected, estimate)]
    np.testing.assert_allclose(*poles, rtol=1e-7)
    np.testing.assert_allclose(estimate.matrices.D, expected.matrices.D, rtol=1e-6)
    np.testing.assert_allclose(
        estimate.singular_values, expected.singular_values, rtol=1e-6, atol=1e-9
    )
    np.testing.assert_allclose(
        estimate.matrices.C @ estimate.initial_state,
        expected.matrices.C @ expected.initial_state,
        rtol=1e-5,
        atol=1e-7,
    )
    for name in ("rank", "instrument_rank", "instrument_rows", "regression_rank"):
        assert estimate.diagnostics[name] == expected.diagnostics[name]


@pytest.mark.parametrize("length", [7, 90, 1500])
def test_factorisation_in_chunks(length):
    """Inner products of inputs that are nearly alike are not accurate enough."""
    u, y, _ = simulate_data(noise=0.0, alike=1e-6)
    expected = moesp(u, y, 8, 2, "past-input-output")
    estimate = moesp_chunks(split(u, y, None, length), 8, 2, "past-input-output")
    assert expected.diagnostics["compression"] == estimate.diagnostics["compression"] == "qr"
    np.testing.assert_allclose(np.sort(estimate.diagnostics["poles"]), [-0.4, 0.8], atol=1e-9)
    np.testing.assert_allclose(estimate.matrices.D, [[0.5, -2.0]], atol=1e-8)


def test_only_some_inputs_drive_the_state():
    u, y, r = simulate_data()
    mask = np.array([True, False])
    expected = moesp(u, y, 8, 2, "past-reference", reference=r, dynamic=mask)
    estimate = moesp_chunks(split(u, y, r, 333), 8, 2, "past-reference", dynamic=mask)
    np.testing.assert_allclose(estimate.matrices.D, expected.matrices.D, rtol=1e-7)
    assert not estimate.matrices.B[:, 1].any()


def test_the_error_names_faulty_chunks():
    u, y, r = simulate_data(300)
    u[211, 1] = np.nan
    with pytest.raises(DataError, match="input 1 is not finite at sample 211"):
        moesp_chunks(split(u, y, r, 50), 6, 2, "past-reference")
    u[:, 1] = 3.0
    with pytest.raises(DataError, match="input 1 is constant"):
        moesp_chunks(split(u, y, r, 50), 6, 2, "past-reference")
    with pytest.raises(DataError, match="has no chunks"):
        moesp_chunks(lambda: iter(()), 6, 2)
    u, y, r = simulate_data(40)
    with pytest.raises(DataError, match="shorter than its Hankel window"):
        moesp_chunks(split(u, y, r, 10), 12, 2, "past-reference")
