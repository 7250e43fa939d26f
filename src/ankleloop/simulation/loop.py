"""The joint, the load and the recorder, discretised exactly.

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
from functools import lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np

from ankleloop.kernels import kernel
from ankleloop.signals.statespace import companion, lowpass_denominator, step_matrices
from ankleloop.simulation.filters import antialias_denominator
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.simulation.trajectories import Trajectories, parameter_ranges

ACCURACY = 1e-8  # of the largest entry of a row: error of the polynomials for stiffness and viscosity
HIGHEST_DEGREE = 6
VECTOR = 8  # doubles
# Inputs of the continuous model; the drive of the reflex is the rectified delayed velocity.
COMMAND, NOISE, VOLUNTARY, DRIVE = range(4)


@dataclass(frozen=True)
class Loop:
    """The loop over one recorded sample: x⁺ = P x + G w, velocities = VP x + VG w, recorded = C x + D w.

    w holds command, noise, voluntary torque at the start and at the end of the sample, and the rectified velocity at
    the start and after each integration step.
    """

    P: np.ndarray  # shape (n, n): state after the sample
    G: np.ndarray  # shape (n, 5 + steps): the same by w
    VP: np.ndarray  # shape (steps, n): velocity after each integration step
    VG: np.ndarray  # shape (steps, 5 + steps): the same by w
    C: np.ndarray  # shape (3, n): recorded position, intrinsic and reflex torque
    D: np.ndarray  # shape (3, 5 + steps): the same by w; zero behind an anti-aliasing filter
    # Shape (terms, rows, columns): changes of the entries of `matrix` in proportion to products of powers of x and y,
    # the deviations of stiffness and viscosity from the middle of their ranges as shares of half of them; None where
    # both are constant.
    changes: np.ndarray | None = None
    powers: tuple[tuple[int, int], ...] = ()  # powers of x and y in each term
    ranges: np.ndarray | None = None  # shape (2, 2): middle and half of the ranges of stiffness and viscosity

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
        joint = (stiffness, viscosity, settings.inertia)
        return _add_filters(A, B, velocity, (position, reflex_torque), denominator, joint)
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
    joint: tuple[float, float, float],
) -> _ContinuousModel:
    """The model of a joint with K, B and I, with an anti-aliasing filter behind position and reflex torque."""
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
    C[1, motion][:3] = joint
    C[2, reflex.start] = 1
    return _ContinuousModel(A, B, np.pad(velocity, (0, 2 * order)), C, np.zeros((3, B.shape[1])))


@lru_cache(maxsize=4)
def build_loop(settings: SimulationSettings) -> Loop:
    """Discretise the loop over one recorded sample."""
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


@kernel(fastmath={"contract", "reassoc"})
def _run(matrix, changes, factors, gains, command, noise, voluntary, delay, limits, record):  # noqa: C901
    """One matrix product for each recorded sample: next state, velocities within the sample, recorded signals.

    The result is the number of the sample at which the position passes its limit, or -1.

    Shapes: matrix (rows, columns), changes (terms, rows, columns), factors (N, terms), gains of the drive (N,),
    command, noise, voluntary (N,), delay (steps of a sample, whole steps, rest of one), limits (threshold, position),
    record (3, N).
    """
    # Numbers are copied one by one: numba takes seconds to compile what copies arrays.
    frames, inputs = command.size, 4
    steps, whole, fraction = delay
    threshold, limit = limits
    rows, columns = matrix.shape
    n = rows - steps - len(record)
    # Drive of the reflex from the present step to the end of the delay, in a ring; zero before the run begins.
    ring, start, velocity = np.zeros(whole + steps + 2), 0, 0.0
    z, out, present = np.zeros(columns), np.zeros(rows), matrix.copy()
    for k in range(frames):
        z[n], z[n + 1], z[n + 2], z[n + 3] = command[k], noise[k], voluntary[k], voluntary[min(k + 1, frames - 1)]
        for j in range(steps + 1):
            at = start + j
            z[n + inputs + j] = gains[k] * ring[at if at < ring.size else at - ring.size]
        for i in range(rows if len(changes) > 0 else 0):
            for j in range(columns):
                present[i, j] = matrix[i, j]
                for term in range(len(changes)):
                    present[i, j] += factors[k, term] * changes[term, i, j]
        for i in range(rows):
            total, row = 0.0, present[i]
            for j in range(columns):
                total += row[j] * z[j]
            out[i] = total
        for i in range(len(record)):
            record[i, k] = out[n + steps + i]
        if not abs(record[0, k]) <= limit:
            return k
        for i in range(n):
            z[i] = out[i]
        for j in range(steps):
            now = out[n + j]
            delayed = fraction * velocity + (1.0 - fraction) * now  # the delay ends between two steps
            at = (start + j + 1 + whole) % ring.size
            ring[at] = max(0.0, delayed - threshold)
            velocity = now
        start = (start + steps) % ring.size
    return -1


def run_loop(
    loop: Loop,
    settings: SimulationSettings,
    command: np.ndarray,
    noise: np.ndarray,
    voluntary: np.ndarray,
    variation: Trajectories | None = None,
) -> tuple[np.ndarray, int]:
    """Run the loop from rest; the number is that of the sample at which the position passes its limit, or -1.

    Shapes: command, noise, voluntary (N,); returns record (3, N).
    """
    steps_of_delay = settings.delay * settings.integration_rate
    whole = int(np.floor(steps_of_delay + 1e-9))
    delay = len(loop.VP), whole, max(0.0, steps_of_delay - whole)
    limits = settings.reflex_threshold, settings.position_limit
    # Rows of whole vectors take a fourth less time.
    columns = (0, -loop.matrix.shape[1] % VECTOR)
    matrix = np.pad(loop.matrix, ((0, 0), columns))
    changes = np.empty((0, *matrix.shape)) if loop.changes is None else np.pad(loop.changes, ((0, 0), (0, 0), columns))
    factors, gains = _variation_factors(loop, settings, command.size, variation)
    record = np.empty((len(loop.C), command.size))
    divergence = _run(matrix, changes, factors, gains, command, noise, voluntary, delay, limits, record)
    return record, divergence


def _variation_factors(
    loop: Loop, settings: SimulationSettings, frames: int, variation: Trajectories | None
) -> tuple[np.ndarray, np.ndarray]:
    """Factors of the changes of the matrix and of the drive of the reflex."""
    if variation is not None:
        largest = parameter_ranges(settings)["gain"][1]
        gains = variation.gain / largest if largest > 0 else variation.gain
        return loop.factors(variation.stiffness, variation.viscosity), gains
    time = (np.arange(frames) + 0.5) / settings.recording_rate - settings.settling
    drift = np.clip(time / settings.duration - 0.5, -0.5, 0.5) * settings.stiffness_drift
    stiffness = settings.stiffness * (1.0 + drift)
    return loop.factors(stiffness, np.full(frames, settings.viscosity)), np.ones(frames)
