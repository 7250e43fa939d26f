"""The joint, the load and the recorder, discretised exactly and run by a compiled kernel.

Between two integration steps everything but the rectifier is linear, and the rectifier acts on velocity that is at
least one recorded sample old. So the loop is a linear system with known inputs over a recorded sample: command and
noise (constant), voluntary torque (linear over the sample) and rectified delayed velocity (linear over each
integration step). The matrix exponential integrates it exactly, anti-aliasing filter included; only the linear
interpolation of the rectified velocity is approximate, with an error of the order of (ω / integration rate)² / 12.

Stiffness, viscosity and reflex gain that vary are constant over each recorded sample. The gain multiplies the rectified
velocity. The matrices of a sample are analytic functions of stiffness and viscosity, and a sample is short, so a
polynomial of low degree through a few values of both gives them to eight digits or more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np

from ankleloop.kernels import kernel
from ankleloop.signals.discretisation import companion, lowpass_denominator, step_matrices
from ankleloop.signals.fused import fuse
from ankleloop.simulation.filters import antialias_denominator
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.simulation.trajectories import Trajectories, parameter_ranges

__all__ = ["Loop", "build_loop", "run_loop"]

WIDTH = 16  # sums that the compiled kernel makes side by side for one trial
LANES = 16  # trials that it runs side by side
FEWEST = 6  # trials: fewer take less time one after the other
ACCURACY = 1e-8  # of the largest entry of a row: error of the polynomials for stiffness and viscosity
HIGHEST_DEGREE = 6
# Inputs of the continuous model; the drive of the reflex is the rectified delayed velocity.
COMMAND, NOISE, VOLUNTARY, DRIVE = range(4)


@dataclass(frozen=True)
class Loop:
    """The loop over one recorded sample: x⁺ = P x + G w, velocities = VP x + VG w, recorded = C x + D w.

    w holds command, noise, voluntary torque at the start and at the end of the sample, and the rectified velocity at
    the start and after each integration step.

    Parameters
    ----------
    P, G : ndarray, shape (n, n), (n, 5 + steps)
        State after the sample.
    VP, VG : ndarray, shape (steps, n), (steps, 5 + steps)
        Velocity after each integration step.
    C, D : ndarray, shape (3, n), (3, 5 + steps)
        Recorded position, intrinsic and reflex torque; D is zero behind an anti-aliasing filter.
    changes : ndarray, shape (terms, rows, columns), or None
        Changes of the entries of `matrix` in proportion to products of powers of x and y, the deviations of stiffness
        and viscosity from the middle of their ranges as shares of half of them; None where both are constant.
    powers : tuple of (int, int)
        Powers of x and y in each term.
    ranges : ndarray, shape (2, 2)
        Middle and half of the ranges of stiffness and viscosity.
    """

    P: np.ndarray
    G: np.ndarray
    VP: np.ndarray
    VG: np.ndarray
    C: np.ndarray
    D: np.ndarray
    changes: np.ndarray | None = None
    powers: tuple[tuple[int, int], ...] = ()
    ranges: np.ndarray | None = None

    @property
    def matrix(self) -> np.ndarray:
        """The matrix that takes (x, w) to (x⁺, velocities, recorded)."""
        return np.block([[self.P, self.G], [self.VP, self.VG], [self.C, self.D]])

    def factors(self, stiffness: np.ndarray, viscosity: np.ndarray) -> np.ndarray:
        """Factor of each of the changes, shape (N, terms), for stiffness and viscosity over N samples."""
        if self.changes is None or self.ranges is None:
            return np.empty((stiffness.size, 0))
        x, y = (
            (value - middle) / (half or 1.0)
            for value, (middle, half) in zip((stiffness, viscosity), self.ranges, strict=True)
        )
        return np.stack([x**i * y**j for i, j in self.powers], axis=1)


class _ContinuousModel(NamedTuple):
    """The linear part of the loop: its matrices A and B, its velocity, and what is recorded of it, C x + D u."""

    A: np.ndarray
    B: np.ndarray
    velocity: np.ndarray
    C: np.ndarray
    D: np.ndarray


def _continuous_model(settings: SimulationSettings, stiffness: float, viscosity: float) -> _ContinuousModel:
    As, bs, _ = companion(lowpass_denominator(2 * np.pi * settings.actuator_frequency, settings.actuator_damping))
    Aq, bq, _ = companion(lowpass_denominator(settings.omega_n, settings.zeta, settings.pole))
    # States: servo, displacement of the load and its rate, reflex torque.
    servo, reflex = slice(0, 2), slice(4, 4 + len(Aq))
    n = reflex.stop
    A, B = np.zeros((n, n)), np.zeros((n, 4))

    A[servo, servo], B[servo, COMMAND] = As, bs[:, 0]
    A[reflex, reflex], B[reflex, DRIVE] = Aq, settings.reflex_gain * bq[:, 0]
    position, velocity, reflex_torque = np.zeros((3, n))
    position[[0, 2]] = velocity[[1, 3]] = 1, -1
    reflex_torque[reflex.start] = 1
    if settings.closed_loop:
        # Torque acts on acceleration at once: I_L·l̈ = TQ − B_L·l̇ − K_L·l with TQ holding I·(θ̈ − l̈), solved for l̈.
        row = stiffness * position + viscosity * velocity + settings.inertia * A[1] + reflex_torque
        row[2] -= settings.load_stiffness
        row[3] -= settings.load_viscosity
        inputs = settings.inertia * B[1]
        inputs[[NOISE, VOLUNTARY]] += 1
        A[2, 3] = 1
        A[3] = row / (settings.load_inertia + settings.inertia)
        B[3] = inputs / (settings.load_inertia + settings.inertia)
    if settings.antialias_cutoff is not None and not _varying_range(settings)[:, 1].any():
        denominator = antialias_denominator(settings.antialias_cutoff)
        return _add_filters(A, B, velocity, (position, reflex_torque), denominator, settings)
    intrinsic = stiffness * position + viscosity * velocity + settings.inertia * (A[1] - A[3])
    D = np.zeros((3, 4))
    D[1] = settings.inertia * (B[1] - B[3])  # command and noise act on the acceleration at once
    model = _ContinuousModel(A, B, velocity, np.vstack([position, intrinsic, reflex_torque]), D)
    return model if settings.antialias_cutoff is None else _filter_outputs(model, settings.antialias_cutoff)


def _filter_outputs(model: _ContinuousModel, cutoff: float) -> _ContinuousModel:
    """The model with an anti-aliasing filter behind each output: it does not commute with a stiffness that varies."""
    Af, bf, _ = companion(antialias_denominator(cutoff))
    outputs, order, n = len(model.C), len(Af), len(model.A)
    A = np.pad(model.A, (0, outputs * order))
    A[n:, :n], A[n:, n:] = np.kron(model.C, bf), np.kron(np.eye(outputs), Af)
    B = np.vstack([model.B, np.kron(model.D, bf)])
    C = np.zeros((outputs, len(A)))
    C[np.arange(outputs), n + order * np.arange(outputs)] = 1
    return _ContinuousModel(A, B, np.pad(model.velocity, (0, outputs * order)), C, np.zeros_like(model.D))


def _add_filters(
    A: np.ndarray,
    B: np.ndarray,
    velocity: np.ndarray,
    signals: Sequence[np.ndarray],
    denominator: np.ndarray,
    settings: SimulationSettings,
) -> _ContinuousModel:
    """The model with an anti-aliasing filter behind each of two signals, position and reflex torque."""
    Af, bf, _ = companion(denominator)
    n, order = len(A), len(Af)
    motion, reflex = slice(n, n + order), slice(n + order, n + 2 * order)
    A, B = np.pad(A, (0, 2 * order)), np.pad(B, ((0, 2 * order), (0, 0)))
    for states, signal in zip((motion, reflex), signals, strict=True):
        A[states, states] = Af
        A[states, :n] += bf * signal
    # The filter commutes with differentiation: its states give the filtered P, Ṗ and P̈, hence the intrinsic torque.
    C = np.zeros((3, len(A)))
    C[0, motion.start] = 1
    C[1, motion][:3] = settings.stiffness, settings.viscosity, settings.inertia
    C[2, reflex.start] = 1
    return _ContinuousModel(A, B, np.pad(velocity, (0, 2 * order)), C, np.zeros((3, B.shape[1])))


def build_loop(settings: SimulationSettings) -> Loop:
    """Discretise the loop over one recorded sample.

    Parameters
    ----------
    settings : SimulationSettings
        Settings of the simulation.

    Returns
    -------
    Loop
    """
    ranges = _varying_range(settings)
    if settings.variation is not None:
        largest = parameter_ranges(settings)["gain"][1]
        settings = settings.model_copy(update={"reflex_gain": largest})
    if not ranges[:, 1].any():
        return _discretise(settings, ranges[:, 0])
    for degree in range(2, HIGHEST_DEGREE + 1):
        loop = _interpolate(settings, ranges, degree)
        if degree == HIGHEST_DEGREE or _interpolation_error(loop, settings) < ACCURACY:
            break
    return loop


def _varying_range(settings: SimulationSettings) -> np.ndarray:
    """Middle and half of the ranges of stiffness and viscosity, shape (2, 2)."""
    ranges = parameter_ranges(settings)
    low, high = np.array([ranges["stiffness"], ranges["viscosity"]]).T
    return np.column_stack([0.5 * (low + high), 0.5 * (high - low)])


def _interpolate(settings: SimulationSettings, ranges: np.ndarray, degree: int) -> Loop:
    """The loop with the polynomials of a degree through Chebyshev points of stiffness and viscosity."""
    nodes = [np.cos(np.pi * np.arange(degree + 1) / degree) if half > 0 else np.zeros(1) for _, half in ranges]
    points = list(product(*nodes))
    powers = [(i, j) for i in range(nodes[0].size) for j in range(nodes[1].size)]
    samples = np.array([_discretise(settings, ranges[:, 0] + ranges[:, 1] * point).matrix for point in points])
    vandermonde = np.array([[x**i * y**j for i, j in powers] for x, y in points])
    terms = np.tensordot(np.linalg.inv(vandermonde), samples, 1)
    middle = _discretise(settings, ranges[:, 0])
    counted = [k for k, (i, j) in enumerate(powers) if 0 < i + j <= degree]
    return replace(middle, changes=terms[counted], powers=tuple(powers[k] for k in counted), ranges=ranges)


def _interpolation_error(loop: Loop, settings: SimulationSettings) -> float:
    """Largest error of the polynomials away from their points, over the largest entry of each row."""
    assert loop.ranges is not None
    assert loop.changes is not None
    error = 0.0
    for point in product((-0.8, 0.35), (-0.45, 0.85)):
        values = loop.ranges[:, 0] + loop.ranges[:, 1] * point
        matrix = _discretise(settings, values).matrix
        factors = loop.factors(*values[:, None])[0]
        difference = loop.matrix + np.tensordot(factors, loop.changes, 1) - matrix
        error = max(error, float(np.max(np.abs(difference) / np.abs(matrix).max(axis=1, keepdims=True))))
    return error


def _discretise(settings: SimulationSettings, values: np.ndarray) -> Loop:
    """The loop over one recorded sample, for a stiffness and a viscosity."""
    steps = round(settings.integration_rate / settings.recording_rate)
    A, B, velocity, C, direct = _continuous_model(settings, *values)
    F, G0, G1 = step_matrices(A, B, 1.0 / settings.integration_rate)
    n = A.shape[0]
    P, G = np.eye(n), np.zeros((n, 4 + steps + 1))
    VP, VG = np.zeros((steps, n)), np.zeros((steps, G.shape[1]))
    for j in range(steps):
        P, G = F @ P, F @ G
        G[:, 0] += G0[:, COMMAND] + G1[:, COMMAND]
        G[:, 1] += G0[:, NOISE] + G1[:, NOISE]
        for gain, fraction in ((G0[:, VOLUNTARY], j / steps), (G1[:, VOLUNTARY], (j + 1) / steps)):
            G[:, 2] += (1 - fraction) * gain
            G[:, 3] += fraction * gain
        G[:, 4 + j] += G0[:, DRIVE]
        G[:, 5 + j] += G1[:, DRIVE]
        VP[j], VG[j] = velocity @ P, velocity @ G
    D = np.zeros((len(C), G.shape[1]))
    D[:, [0, 1, 2, 4]] = direct  # at the start of the sample
    return Loop(P, G, VP, VG, C, D)


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

    Parameters
    ----------
    loop : Loop
        The loop from `build_loop`.
    settings : SimulationSettings
        The settings it was built from.
    command, noise, voluntary : ndarray, shape (N,) or (trials, N)
        Command [rad] and noise [N·m], constant over each recorded sample; voluntary torque [N·m], linear over it.
    variation : sequence of Trajectories
        K, B and G in the middle of each recorded sample, of each trial or of all trials alike, where `variation` of the
        settings is set.

    Returns
    -------
    record : ndarray, shape (3, N) or (3, trials, N)
        Position [rad], intrinsic torque [N·m] and reflex torque [N·m] as the recorder samples them.
    divergence : int
        Sample at which the position of a trial passes its limit, or -1.
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
