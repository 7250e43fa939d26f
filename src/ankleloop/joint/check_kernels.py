"""Compiled passes of the checks of data: each reads its samples once or twice and takes no memory of their length."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import njit

from ankleloop.kernels import kernel

__all__ = [
    "correlate_reference",
    "displace_products",
    "has_directions",
    "multiply_deviations",
    "regress_last",
    "scan_samples",
    "spread_from_first",
    "unexplained_share",
]

LANES = 64  # samples at a time
COLUMNS = 256  # of a Hankel matrix that a bound takes
TINY = np.finfo(float).tiny


@njit
def _middle(peaks):
    """Largest of some numbers, and the median of those above zero; the numbers are sorted in place."""
    for i in range(1, peaks.size):
        k, value = i, peaks[i]
        while k > 0 and peaks[k - 1] > value:
            peaks[k] = peaks[k - 1]
            k -= 1
        peaks[k] = value
    first = 0
    while first < peaks.size and not peaks[first] > 0.0:
        first += 1
    if first == peaks.size:
        return 0.0, 0.0
    low, high = (first + peaks.size - 1) // 2, (first + peaks.size) // 2
    return peaks[-1], 0.5 * (peaks[low] + peaks[high])


@kernel()
def scan_samples(x, reach, parts):
    """Largest product of the changes before and after a sample, and how many samples repeat the last one.

    The product is positive at a peak. Maxima over lanes first, whose number the compiler knows: so it takes several
    samples at a time.

    Shapes: x (N,).
    """
    peaks, lanes, repeated = np.zeros(parts), np.empty(LANES), 0
    inner = max(x.size - 2 * reach, 0)
    for part in range(parts):
        start, stop = part * inner // parts, (part + 1) * inner // parts
        lanes[:] = 0.0
        whole = start
        while whole + LANES <= stop:
            before, here = x[whole : whole + LANES], x[whole + reach : whole + reach + LANES]
            after, next_one = x[whole + 2 * reach : whole + 2 * reach + LANES], x[whole + 1 : whole + 1 + LANES]
            for k in range(LANES):
                product = (here[k] - before[k]) * (here[k] - after[k])
                lanes[k] = product if product > lanes[k] else lanes[k]
                repeated += next_one[k] == before[k]
            whole += LANES
        for k in range(whole, stop):
            product = (x[k + reach] - x[k]) * (x[k + reach] - x[k + 2 * reach])
            lanes[0] = max(lanes[0], product)
            repeated += x[k + 1] == x[k]
        peaks[part] = lanes.max()
    return *_middle(peaks), repeated


@kernel()
def spread_from_first(x, step):
    """Mean square of every few samples less the first one.

    Shapes: x (N,).
    """
    total, count = 0.0, 0
    for k in range(0, x.size, step):
        total += (x[k] - x[0]) ** 2
        count += 1
    return total / count


# Sums may be reordered, so that the compiler adds several terms at a time.
@njit(fastmath={"contract", "reassoc"})
def _multiply(x, x_mean, y, y_mean):
    """Inner product of two signals less their means."""
    total = 0.0
    for k in range(x.size):
        total += (x[k] - x_mean) * (y[k] - y_mean)
    return total


@njit(fastmath={"contract", "reassoc"})
def _average(x):
    total = 0.0
    for k in range(x.size):
        total += x[k]
    return total / x.size


@kernel()
def multiply_deviations(signals):
    """Inner products of signals, each less its mean.

    Shapes: signals (N,); returns means (signals,), products (signals, signals).
    """
    means, products = np.empty(len(signals)), np.empty((len(signals), len(signals)))
    for i in range(len(signals)):
        means[i] = _average(signals[i])
        for j in range(i + 1):
            products[i, j] = products[j, i] = _multiply(signals[i], means[i], signals[j], means[j])
    return means, products


@kernel()
def correlate_reference(reference, signals, means, lead, lag):
    """Inner products of a reference with signals, each less its mean.

    Shapes: reference (N,), signals (N,), means (signals,); returns products (signals,).
    """
    mean, count = _average(reference), reference.size - lead - lag
    products, largest = np.empty(len(signals)), 0.0
    for i in range(len(signals)):
        products[i] = _multiply(reference, mean, signals[i], means[i])
    window = reference[lead : lead + count]
    for start in range(lead + lag + 1):
        product = _multiply(window, mean, signals[0][start : start + count], means[0])
        largest = max(largest, abs(product))
    return _multiply(reference, mean, reference, mean), products, largest


@kernel(error_model="numpy")
def regress_last(products, dependent):
    """Least squares of the last signal on the others, from their products, by Cholesky's method.

    Shapes: products (n + 1, n + 1); returns coefficients (n,).
    """
    n, determinant, explained = len(products) - 1, 1.0, 0.0
    factor, values, scale = np.zeros((n, n)), np.empty(n), np.empty(n)
    for i in range(n):
        scale[i] = 1.0 / sqrt(max(abs(products[i, i]), TINY))
        total = 0.0
        for j in range(i + 1):
            total = products[i, j] * scale[i] * scale[j]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            if j < i:
                factor[i, j] = total / factor[j, j]
        determinant *= total
        if not determinant > dependent:
            return values, -1.0
        factor[i, i] = sqrt(total)
        values[i] = products[i, n] * scale[i]
        for k in range(i):
            values[i] -= factor[i, k] * values[k]
        values[i] /= factor[i, i]
        explained += values[i] ** 2
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            values[i] -= factor[k, i] * values[k]
        values[i] /= factor[i, i]
    return scale * values, explained / products[n, n]


@kernel()
def displace_products(first, x):
    """Products of all rows of a Hankel matrix with each other, from those of its first block row.

    As in `ankleloop.subspace.hankel_gram`, whose overhead and means are left out.

    Shapes: first (channels, rows), x (N * channels,); returns (rows, rows).
    """
    channels, rows = first.shape
    beyond = x.size - rows + channels  # from a number of the first column to that which follows on the last column
    products = np.empty((rows, rows))
    products[:channels] = first
    products[:, :channels] = first.T
    for i in range(rows - channels):
        for j in range(i, rows - channels):
            value = products[i, j] + x[i + beyond] * x[j + beyond] - x[i] * x[j]
            products[i + channels, j + channels] = value
            products[j + channels, i + channels] = value
    return products


@kernel(error_model="numpy", fastmath={"contract"})
def has_directions(x, rows, directions, least):
    """Whether some eigenvalues of H Hᵀ are certainly above a value, where H is the Hankel matrix of a signal.

    More columns only add to the eigenvalues, and those of some rows are not above those of all of them (Cauchy's
    interlacing theorem). So it is enough that the products of a few columns and of as many evenly spread rows are
    positive definite after the value is taken from their diagonal, which Cholesky's method shows.

    Shapes: x (N,).
    """
    columns = min(x.size - rows + 1, COLUMNS)
    first = np.zeros((1, rows))
    for t in range(columns):
        here, following = x[t], x[t : t + rows]
        for k in range(rows):
            first[0, k] += here * following[k]
    products = displace_products(first, x[: columns + rows - 1])
    factor = np.empty((directions, directions))
    for i in range(directions):
        for j in range(i + 1):
            total = products[i * rows // directions, j * rows // directions]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            if j < i:
                factor[i, j] = total / factor[j, j]
        if not total > least:
            return False
        factor[i, i] = sqrt(total - least)
    return True


@kernel(error_model="numpy", fastmath={"contract"})
def _explain(gram, products):
    """Energy that signals explain, from their products with each other and with what is explained; both change."""
    size, explained = len(gram), 0.0
    for i in range(size):
        pivot = gram[i, i]
        if not pivot > TINY:  # of a constant signal
            continue
        explained += products[i] ** 2 / pivot
        for k in range(i + 1, size):
            factor, row, target_row = gram[i, k] / pivot, gram[i], gram[k]
            products[k] -= factor * products[i]
            for j in range(k, size):
                target_row[j] -= factor * row[j]
    return explained


@kernel(error_model="numpy", fastmath={"contract"})
def unexplained_share(signals, y, ridge):
    """Share of the variance of a signal that shifts of others leave, each less its mean, by Cholesky's method.

    Shapes: signals (N + shifts - 1, channels), y (N,).
    """
    rows, channels = y.size, signals.shape[1]
    size = (len(signals) - rows + 1) * channels
    target = y - _average(y)
    energy = _multiply(target, 0.0, target, 0.0)
    if not energy > TINY:
        return 1.0
    centred, power = np.empty_like(signals), np.empty(channels)
    for c in range(channels):
        deviations = signals[:, c] - _average(signals[:, c])
        centred[:, c], power[c] = deviations, _multiply(deviations, 0.0, deviations, 0.0) / len(signals)
    flat = centred.ravel()
    first, products, sums = np.zeros((channels, size)), np.zeros(size), np.zeros(size)
    for t in range(rows):
        following = flat[t * channels : t * channels + size]
        for k in range(size):
            products[k] += target[t] * following[k]
            sums[k] += following[k]
        for c in range(channels):
            here, row = following[c], first[c]
            for k in range(size):
                row[k] += here * following[k]
    gram = displace_products(first, flat)
    for i in range(size):
        gram[i] -= sums[i] / rows * sums
        gram[i, i] += ridge * rows * power[i % channels]
    return 1.0 - _explain(gram, products) / energy
