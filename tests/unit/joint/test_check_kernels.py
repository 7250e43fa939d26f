"""Compiled passes of the checks of data against plain computations."""

import numpy as np
import pytest

from ankleloop.joint.check_kernels import (
    correlate_reference,
    displace_products,
    has_directions,
    multiply_deviations,
    regress_last,
    scan_samples,
    spread_from_first,
    unexplained_share,
)


@pytest.mark.parametrize("size", [3, 7, 64, 65, 200, 1000])
@pytest.mark.parametrize("reach", [1, 3])
@pytest.mark.parametrize("rest", [0.0, 0.3, 1.0])
def test_the_scan_is_a_plain_loop(size, reach, rest):
    x = np.round(np.random.default_rng(size).standard_normal(size), 1)
    x[int((1 - rest) * size) :] = 0.4
    inner = max(size - 2 * reach, 0)
    products = [(x[k] - x[k - reach]) * (x[k] - x[k + reach]) for k in range(reach, size - reach)]
    peaks = [max([0.0, *products[part * inner // 5 : (part + 1) * inner // 5]]) for part in range(5)]
    peaks = [peak for peak in peaks if peak > 0] or [0.0]
    repeated = sum(x[k + 1] == x[k] for k in range(inner))
    assert scan_samples(x, reach, 5) == (max(peaks), pytest.approx(np.median(peaks), rel=1e-15), repeated)


def test_products_of_deviations_are_covariances():
    signals = np.random.default_rng(1).normal([[1.0], [1e3], [-5.0], [0.0]], 1.0, (4, 501))
    means, products = multiply_deviations(tuple(signals))
    np.testing.assert_allclose(means, signals.mean(axis=1), rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(products, 501 * np.cov(signals, bias=True), rtol=1e-10, atol=1e-10)


def test_products_with_the_reference_are_those_of_shifts():
    rng = np.random.default_rng(2)
    reference, position, torque = rng.normal([[3.0], [1.0], [-2.0]], 1.0, (3, 400))
    r, p, q = reference - reference.mean(), position - position.mean(), torque - torque.mean()
    means = np.array([position.mean(), torque.mean()])
    energy, products, largest = correlate_reference(reference, (position, torque), means, 2, 10)
    assert energy == pytest.approx(r @ r)
    np.testing.assert_allclose(products, [r @ p, r @ q], rtol=1e-10)
    assert largest == pytest.approx(max(abs(r[2:390] @ p[k : k + 388]) for k in range(13)))


def test_least_squares_of_the_last_signal():
    x = np.random.default_rng(3).standard_normal((4, 300)) * [[1e-3], [1.0], [1e4], [1.0]]
    x[3] += 2e3 * x[0] - x[1]
    values, explained = regress_last(x @ x.T, 1e-12)
    expected, rest, *_ = np.linalg.lstsq(x[:3].T, x[3], rcond=None)
    np.testing.assert_allclose(values, expected, rtol=1e-9)
    assert explained == pytest.approx(1.0 - rest[0] / (x[3] @ x[3]))
    x[2] = 2.0 * x[1]
    assert regress_last(x @ x.T, 1e-12)[1] == -1.0


def test_the_spread_is_that_of_every_few_samples():
    x = np.random.default_rng(4).standard_normal(103)
    assert spread_from_first(x, 10) == pytest.approx(np.mean((x[::10] - x[0]) ** 2))


@pytest.mark.parametrize("size", [40, 300, 3000])
@pytest.mark.parametrize("share", [0.2, 0.5, 0.76, 1.0])
def test_directions_are_never_more_than_the_eigenvalues_show(size, share):
    """A bound from below: it is never true without them, and true where they are far above the value."""
    rng = np.random.default_rng(size)
    spectrum = np.fft.rfft(rng.standard_normal(size))
    x = np.fft.irfft(spectrum * (np.arange(spectrum.size) <= share * spectrum.size), size)
    rows = np.lib.stride_tricks.sliding_window_view(x, 32)
    values = np.linalg.eigvalsh(rows.T @ rows)[::-1]
    np.testing.assert_allclose(
        displace_products(np.correlate(x, x[: size - 31], mode="valid")[None], x), rows.T @ rows, atol=1e-9 * size
    )
    for directions in (5, 16, 24, 32):
        for least in 10.0 ** np.arange(-10, 5):
            assert not has_directions(x, 32, directions, least) or values[directions - 1] > least
    assert has_directions(x, 32, 5, 1e-3 * values[5])


@pytest.mark.parametrize("channels", [1, 2, 3])
def test_products_of_several_signals_are_those_of_their_hankel_matrix(channels):
    x = np.random.default_rng(channels).standard_normal((60, channels))
    hankel = np.lib.stride_tricks.sliding_window_view(x.ravel(), 7 * channels)[::channels].T
    products = hankel @ hankel.T
    np.testing.assert_allclose(displace_products(products[:channels].copy(), x.ravel()), products, atol=1e-12)


@pytest.mark.parametrize("channels", [1, 2, 3])
@pytest.mark.parametrize("scale", [1.0, 1e6])
def test_what_shifts_leave_is_what_least_squares_leave(channels, scale):
    rng = np.random.default_rng(channels)
    x, shifts = 3.0 + rng.standard_normal((220, channels)) * scale ** np.arange(channels), 6
    lagged = np.concatenate([np.lib.stride_tricks.sliding_window_view(signal, 215) for signal in x.T])
    y = rng.standard_normal(lagged.shape[1]) + lagged[2] + 0.5 * lagged[-1] / scale ** (channels - 1) + 7.0
    regressors, target = (lagged - lagged.mean(axis=1, keepdims=True)).T, y - y.mean()
    solution = np.linalg.lstsq(regressors / regressors.std(axis=0), target, rcond=None)[0]
    rest = target - regressors / regressors.std(axis=0) @ solution
    assert len(lagged) == shifts * channels
    assert unexplained_share(x, y, 0.0) == pytest.approx(rest @ rest / (target @ target), rel=1e-9)
    # The ridge is that of signals of unit variance.
    gram = regressors.T @ regressors / np.outer(x.std(axis=0).repeat(shifts), x.std(axis=0).repeat(shifts))
    right = regressors.T @ target / x.std(axis=0).repeat(shifts)
    explained = right @ np.linalg.solve(gram + 0.1 * len(target) * np.eye(len(gram)), right)
    assert unexplained_share(x, y, 0.1) == pytest.approx(1.0 - explained / (target @ target), rel=1e-9)


def test_constant_signals_explain_nothing():
    rng = np.random.default_rng(0)
    x, y, constant = rng.standard_normal((105, 1)), rng.standard_normal(100), np.full((105, 1), 2.0)
    assert unexplained_share(constant, y, 1e-6) == 1.0
    assert unexplained_share(x, np.full(100, 2.0), 1e-6) == 1.0
    assert unexplained_share(np.hstack([x, constant]), y, 1e-6) == pytest.approx(unexplained_share(x, y, 1e-6))
