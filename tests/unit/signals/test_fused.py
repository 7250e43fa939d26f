"""The fused multiply-add against exact fractions."""

from fractions import Fraction

import numpy as np
import pytest

from ankleloop.kernels import kernel
from ankleloop.signals.fused import fuse


@kernel()
def fuse_all(a, b, c):
    out = np.empty(a.size)
    for k in range(a.size):
        out[k] = fuse(a[k], b[k], c[k])
    return out


def round_once(a, b, c):
    return float(Fraction(a) * Fraction(b) + Fraction(c))


def test_it_is_the_exact_result_rounded_once():
    rng = np.random.default_rng(0)
    a, b = rng.standard_normal((2, 500)) * 10.0 ** rng.integers(-20, 20, (2, 500))
    # The sum nearly cancels in half of the numbers, where rounding the product first leaves no digit.
    c = np.where(np.arange(500) % 2, -a * b, rng.standard_normal(500))
    exact = [round_once(*numbers) for numbers in zip(a.tolist(), b.tolist(), c.tolist(), strict=True)]
    assert fuse_all(a, b, c).tolist() == exact
    assert np.count_nonzero(a * b + c != exact) > 200


@pytest.mark.parametrize(
    ("numbers", "result"),
    [((np.inf, 1.0, 0.0), np.inf), ((np.inf, 0.0, 0.0), np.nan), ((1e200, 1e200, -1e300), np.inf), ((0, 5, -2), -2)],
)
def test_infinities_and_zeros(numbers, result):
    arrays = [np.array([float(number)]) for number in numbers]
    np.testing.assert_array_equal(fuse_all(*arrays), [result])
