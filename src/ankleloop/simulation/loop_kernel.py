"""The discretised loop, run by a compiled kernel: one trial at a time, or several side by side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ankleloop.kernels import kernel
from ankleloop.signals.fused import fuse
from ankleloop.simulation.loop import Loop
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.simulation.trajectories import Trajectories, parameter_ranges

__all__ = ["run_loop"]

WIDTH = 16  # sums that the compiled kernel makes side by side for one trial
LANES = 16  # trials that it runs side by side
FEWEST = 6  # trials: fewer take less time one after the other


@kernel()
def _multiply(columns, z, out):
    """Product of a matrix with one vector, all of its sums side by side."""
    rows = np.uint64(out.size)
    out[:] = 0.0
    for i in range(0, z.size, 4):
        a, b, c, d = z[i], z[i + 1], z[i + 2], z[i + 3]
        at = np.uint64(i) * rows
        first, second = columns[at:], columns[at + rows :]
        third, fourth = columns[at + np.uint64(2) * rows :], columns[at + np.uint64(3) * rows :]
        for j in range(rows):
            out[j] = fuse(d, fourth[j], fuse(c, third[j], fuse(b, second[j], fuse(a, first[j], out[j]))))


@kernel()
def _multiply_lanes(blocks, z, out):
    """Product of a matrix with the vectors of several trials side by side, four rows and columns at a time.

    It adds in the same order as `_multiply` does, and so gives the same bits.
    """
    n, size = np.uint64(LANES), np.uint64(16)
    at = np.uint64(0)
    for first in range(np.uint64(0), np.uint64(out.size), np.uint64(4) * n):
        second, third, fourth = first + n, first + np.uint64(2) * n, first + np.uint64(3) * n
        for lane in range(np.uint64(4) * n):
            out[first + lane] = 0.0
        for j in range(np.uint64(0), np.uint64(z.size), np.uint64(4) * n):
            m = blocks[at : at + size]
            at += size
            # The numbers of a block stay in registers over all trials.
            a0, a1, a2, a3, b0, b1, b2, b3 = m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7]
            c0, c1, c2, c3, d0, d1, d2, d3 = m[8], m[9], m[10], m[11], m[12], m[13], m[14], m[15]
            for lane in range(n):
                k = j + lane
                p, q, r, s = z[k], z[k + n], z[k + np.uint64(2) * n], z[k + np.uint64(3) * n]
                i0, i1, i2, i3 = first + lane, second + lane, third + lane, fourth + lane
                out[i0] = fuse(s, a3, fuse(r, a2, fuse(q, a1, fuse(p, a0, out[i0]))))
                out[i1] = fuse(s, b3, fuse(r, b2, fuse(q, b1, fuse(p, b0, out[i1]))))
                out[i2] = fuse(s, c3, fuse(r, c2, fuse(q, c1, fuse(p, c0, out[i2]))))
                out[i3] = fuse(s, d3, fuse(r, d2, fuse(q, d1, fuse(p, d0, out[i3]))))


@kernel()
def _run(numbers, variation, sizes, external, delay, limits, lanes, record, place):
    """One matrix product for each recorded sample: next state, velocities within the sample, recorded signals.

    `numbers` are those of the matrix, in the order of the product; `variation` changes of them, the factors of these
    and of the drive of the reflex at each sample, or nothing; `sizes` those of state, inputs, steps, outputs and
    of the vectors of the product; `external` command, noise and voluntary torque of at most `lanes` trials, which
    `record` has from `place` on; `delay` whole steps and the rest of one; `limits` threshold and largest position.
    """
    n, inputs, steps, outputs, width, height = sizes
    (whole, fraction), (threshold, limit), (changes, factors, gains) = delay, limits, variation
    trials, frames = external[0].shape
    # Drive of the reflex at the last integration steps, in a ring that ends with a copy of its first entry; zero before
    # the run begins.
    ring, start = (whole // steps + 2) * steps, 0
    drive, velocity = np.zeros((ring + 1) * lanes), np.zeros(lanes)
    z, out, matrix = np.zeros(width * lanes), np.zeros(height * lanes), numbers.copy()
    for k in range(frames):
        _fill_inputs(z[n * lanes :], external, k, inputs, lanes)
        z[(n + inputs) * lanes : (n + inputs + steps + 1) * lanes] = drive[start * lanes : (start + steps + 1) * lanes]
        if gains.size > 0:
            z[(n + inputs) * lanes : (n + inputs + steps + 1) * lanes] *= gains[k]
        if changes.shape[0] > 0:
            _vary(numbers, changes, factors[k], matrix)
        if lanes == 1:
            _multiply(matrix, z, out)
        else:
            _multiply_lanes(matrix, z, out)
        for trial in range(trials):
            for i in range(outputs):
                record[i, place + trial, k] = out[(n + steps + i) * lanes + trial]
            if not abs(record[0, place + trial, k]) <= limit:
                return k
        z[: n * lanes] = out[: n * lanes]
        for j in range(steps):
            at = (start + whole + j + 1) % ring
            _rectify(out[(n + j) * lanes : (n + j + 1) * lanes], velocity, fraction, threshold, drive[at * lanes :])
        drive[ring * lanes :] = drive[:lanes]
        start = (start + steps) % ring
    return -1


@kernel()
def _vary(numbers, changes, factors, matrix):
    """The matrix of a sample: the one in the middle of the ranges, with its changes."""
    matrix[:] = numbers
    for term in range(factors.size):
        factor, change = factors[term], changes[term]
        for i in range(matrix.size):
            matrix[i] = fuse(factor, change[i], matrix[i])


@kernel()
def _fill_inputs(z, external, k, inputs, lanes):
    """Inputs of a sample from outside: the command, and where there are disturbances noise and voluntary torque."""
    command, noise, voluntary = external
    trials, frames = command.shape
    for trial in range(trials):
        z[trial] = command[trial, k]
        if inputs > 1:
            z[lanes + trial], z[2 * lanes + trial] = noise[trial, k], voluntary[trial, k]
            z[3 * lanes + trial] = voluntary[trial, min(k + 1, frames - 1)]


@kernel()
def _rectify(now, previous, fraction, threshold, drive):
    """Drive of the reflex from the velocities at two steps between which the delay ends; the last become previous."""
    for lane in range(now.size):
        velocity = fuse(fraction, previous[lane], (1.0 - fraction) * now[lane])
        drive[lane] = max(0.0, velocity - threshold)
        previous[lane] = now[lane]


def run_loop(
    loop: Loop,
    settings: SimulationSettings,
    command: np.ndarray,
    noise: np.ndarray,
    voluntary: np.ndarray,
    variation: Sequence[Trajectories] = (),
) -> tuple[np.ndarray, int]:
    """Run the loop from rest.

    Shapes: command, noise, voluntary (N,); returns record (3, N).
    """
    steps_of_delay = settings.delay * settings.integration_rate
    whole = int(np.floor(steps_of_delay + 1e-9))
    fraction = max(0.0, steps_of_delay - whole)
    external = [np.ascontiguousarray(np.atleast_2d(signal), dtype=float) for signal in (command, noise, voluntary)]
    trials, frames = external[0].shape
    factors = [_variation_factors(loop, settings, frames, part) for part in (variation or (None,))]
    limits = settings.reflex_threshold, settings.position_limit
    product = _Product(loop, disturbed=bool(external[1].any() or external[2].any()))
    record, divergence, place = np.empty((product.sizes[3], trials, frames)), -1, 0
    while place < trials and divergence < 0:
        # Trials side by side have one matrix.
        lanes = LANES if trials - place >= FEWEST and len(factors) == 1 else 1
        signals = tuple(signal[place : place + lanes] for signal in external)
        numbers, changes, heights = product.arrange(lanes)
        sizes = *product.sizes, *heights
        terms = changes, *factors[min(place, len(factors) - 1)]
        divergence = _run(numbers, terms, sizes, signals, (whole, fraction), limits, lanes, record, place)
        place += lanes
    return record.reshape(len(record), *np.shape(command)), divergence


def _variation_factors(
    loop: Loop, settings: SimulationSettings, frames: int, variation: Trajectories | None
) -> tuple[np.ndarray, np.ndarray]:
    """Factors of the changes of the matrix and of the drive of the reflex; of the latter none if it is constant."""
    if variation is not None:
        largest = parameter_ranges(settings)["gain"][1]
        gains = variation.gain / largest if largest > 0 else variation.gain
        return loop.factors(variation.stiffness, variation.viscosity), gains
    if loop.changes is None:
        return np.empty((0, 0)), np.empty(0)
    time = (np.arange(frames) + 0.5) / settings.recording_rate - settings.settling
    drift = np.clip(time / settings.duration - 0.5, -0.5, 0.5) * settings.stiffness_drift
    return loop.factors(settings.stiffness * (1.0 + drift), np.full(frames, settings.viscosity)), np.empty(0)


class _Product:
    """The matrix product of the kernel; without noise and voluntary torque it has fewer columns.

    `sizes` are those of state, external inputs, steps and outputs.
    """

    def __init__(self, loop: Loop, *, disturbed: bool) -> None:
        n, inputs = loop.P.shape[0], 4 if disturbed else 1
        self.sizes = n, inputs, loop.VP.shape[0], loop.C.shape[0]
        matrices = loop.matrix[None] if loop.changes is None else np.stack([loop.matrix, *loop.changes])
        self.matrices = np.delete(matrices, slice(n + inputs, n + 4), axis=2)

    def arrange(self, lanes: int) -> tuple[np.ndarray, np.ndarray, tuple[int, int]]:
        """Numbers and their changes in the order in which the kernel takes them, and the sizes of its vectors."""
        count, rows, columns = self.matrices.shape
        padding = -rows % (WIDTH if lanes == 1 else 4), -columns % 4
        matrices = np.pad(self.matrices, ((0, 0), (0, padding[0]), (0, padding[1])))
        rows, columns = matrices.shape[1:]
        if lanes == 1:
            matrices = matrices.transpose(0, 2, 1)
        else:
            matrices = matrices.reshape(count, rows // 4, 4, columns // 4, 4).transpose(0, 1, 3, 2, 4)
        numbers = np.ascontiguousarray(matrices).reshape(count, -1)
        return numbers[0], numbers[1:], (columns, rows)
