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

from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np

from ankleloop.errors import UnstableLoopError
from ankleloop.kernels import kernel
from ankleloop.signals.statespace import companion, lowpass_denominator, step_matrices
from ankleloop.simulation.filters import ANTIALIAS_ORDER, bessel_denominator
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.simulation.trajectories import Trajectories, parameter_ranges

ACCURACY = (
    1e-8  # of the largest entry of a row: error of the polynomials for stiffness and viscosity
)
HIGHEST_DEGREE = 6
VECTOR = 8  # doubles: rows of whole vectors take a fourth less time
# Inputs of the continuous model; the drive of the reflex is the rectified delayed velocity, times the share of the gain
# in its largest value.
COMMAND, NOISE, VOLUNTARY, DRIVE = range(4)
# Settings that decide whether the loop is stable.
DECISIVE = (
    "load_inertia",
    "load_viscosity",
    "load_stiffness",
    "reflex_gain",
    "delay",
    "stiffness",
    "viscosity",
)
RECORDED = 3  # position, intrinsic and reflex torque


@dataclass(frozen=True, eq=False)
class Loop:
    """The loop over one recorded sample: `matrix` takes (x, w) to (x⁺, velocities, recorded).

    w holds command, noise, voluntary torque at the start and at the end of the sample, the drive at the start and after
    each integration step, and zeros that fill up a vector; the velocities are those after each integration step.
    """

    matrix: (
        np.ndarray
    )  # shape (rows, columns), for stiffness and viscosity in the middle of their ranges
    ranges: np.ndarray  # shape (2, 2): middle and half of the ranges of stiffness and viscosity
    # Shape (terms, rows, columns): changes of the matrix in proportion to products of powers of x and y, the deviations
    # of stiffness and viscosity from the middle of their ranges as shares of half of them; no terms for constant ones.
    changes: np.ndarray
    powers: tuple[tuple[int, int], ...] = ()  # powers of x and y in each term

    def factors(self, stiffness: np.ndarray, viscosity: np.ndarray) -> np.ndarray:
        """Factor of each of the changes, shape (N, terms), for stiffness and viscosity over N samples."""
        factors = np.empty((stiffness.size, len(self.powers)))
        if self.powers:
            (middle_x, half_x), (middle_y, half_y) = self.ranges
            x, y = (
                (stiffness - middle_x) / (half_x or 1.0),
                (viscosity - middle_y) / (half_y or 1.0),
            )
            factors[:] = np.stack([x**i * y**j for i, j in self.powers], axis=1)
        return factors


class _ContinuousModel(NamedTuple):
    """The linear part of the loop, ẋ = A x + B u, recorded = C x + D u."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray


def _continuous_model(
    settings: SimulationSettings, stiffness: float, viscosity: float
) -> _ContinuousModel:
    """States: servo, displacement of the load and its rate, reflex torque, filters."""
    As, bs, _ = companion(
        lowpass_denominator(2 * np.pi * settings.actuator_frequency, settings.actuator_damping)
    )
    Aq, bq, _ = companion(lowpass_denominator(settings.omega_n, settings.zeta, settings.pole))
    servo, reflex = slice(0, 2), slice(4, 4 + len(Aq))
    n = reflex.stop
    A, B = np.zeros((n, n)), np.zeros((n, 4))

    A[servo, servo], B[servo, COMMAND] = As, bs[:, 0]
    A[reflex, reflex], B[reflex, DRIVE] = Aq, parameter_ranges(settings)[2, 1] * bq[:, 0]
    position, velocity, reflex_torque = np.zeros((RECORDED, n))
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
    intrinsic = stiffness * position + viscosity * velocity + settings.inertia * (A[1] - A[3])
    D = np.zeros((RECORDED, 4))
    D[1] = settings.inertia * (B[1] - B[3])  # command and noise act on the acceleration at once
    model = _ContinuousModel(A, B, np.vstack([position, intrinsic, reflex_torque]), D)
    if settings.antialias_cutoff is None:
        return model
    if _varying_range(settings)[:, 1].any():
        return _filter_outputs(model, settings.antialias_cutoff)
    # The filter commutes with differentiation: its states give the filtered P, Ṗ and P̈, hence the intrinsic torque. It
    # does not commute with a stiffness that varies.
    filtered = _filter_outputs(
        model._replace(C=model.C[[0, 2]], D=model.D[[0, 2]]), settings.antialias_cutoff
    )
    intrinsic = np.zeros(len(filtered.A))
    intrinsic[n : n + 3] = stiffness, viscosity, settings.inertia
    return filtered._replace(C=np.insert(filtered.C, 1, intrinsic, axis=0), D=np.zeros_like(D))


def _filter_outputs(model: _ContinuousModel, cutoff: float) -> _ContinuousModel:
    """The model with an anti-aliasing filter behind each output."""
    Af, bf, _ = companion(bessel_denominator(ANTIALIAS_ORDER, 2 * np.pi * cutoff))
    outputs, order, n = len(model.C), len(Af), len(model.A)
    A = np.pad(model.A, (0, outputs * order))
    A[n:, :n], A[n:, n:] = np.kron(model.C, bf), np.kron(np.eye(outputs), Af)
    B = np.vstack([model.B, np.kron(model.D, bf)])
    C = np.zeros((outputs, len(A)))
    C[np.arange(outputs), n + order * np.arange(outputs)] = 1
    return _ContinuousModel(A, B, C, np.zeros_like(model.D))


@lru_cache(maxsize=4)
def build_loop(settings: SimulationSettings) -> Loop:
    """Discretise the loop over one recorded sample.

    Where stiffness and viscosity vary, polynomials go through Chebyshev points of them; their degree rises until the
    error away from these points is small.
    """
    ranges = _varying_range(settings)
    middle, half = ranges.T
    matrix = _discretise(settings, middle)
    loop = Loop(matrix, ranges, np.empty((0, *matrix.shape)))
    for degree in range(2, HIGHEST_DEGREE + 1) if half.any() else ():
        nodes = [
            np.cos(np.pi * np.arange(degree + 1) / degree) if size > 0 else np.zeros(1)
            for size in half
        ]
        points = list(product(*nodes))
        powers = [(i, j) for i in range(nodes[0].size) for j in range(nodes[1].size)]
        samples = np.array([_discretise(settings, middle + half * point) for point in points])
        vandermonde = np.array([[x**i * y**j for i, j in powers] for x, y in points])
        terms = np.tensordot(np.linalg.inv(vandermonde), samples, 1)
        counted = [k for k, (i, j) in enumerate(powers) if 0 < i + j <= degree]
        loop = Loop(matrix, ranges, terms[counted], tuple(powers[k] for k in counted))
        if _interpolation_error(loop, settings) < ACCURACY:
            break
    return loop


def _varying_range(settings: SimulationSettings) -> np.ndarray:
    """Middle and half of the ranges of stiffness and viscosity, shape (2, 2)."""
    low, high = parameter_ranges(settings)[:2].T
    return np.column_stack([0.5 * (low + high), 0.5 * (high - low)])


def _interpolation_error(loop: Loop, settings: SimulationSettings) -> float:
    """Largest error of the polynomials away from their points, over the largest entry of each row."""
    middle, half = loop.ranges.T
    errors = []
    for point in product((-0.8, 0.35), (-0.45, 0.85)):
        values = middle + half * point
        matrix = _discretise(settings, values)
        difference = (
            loop.matrix + np.tensordot(loop.factors(*values[:, None])[0], loop.changes, 1) - matrix
        )
        errors.append(np.max(np.abs(difference) / np.abs(matrix).max(axis=1, keepdims=True)))
    return float(max(errors))


def _discretise(settings: SimulationSettings, values: np.ndarray) -> np.ndarray:
    """Matrix of the loop over one recorded sample, for a stiffness and a viscosity."""
    steps = round(settings.integration_rate / settings.recording_rate)
    A, B, C, D = _continuous_model(settings, *values)
    F, before, after = step_matrices(A, B, 1.0 / settings.integration_rate)
    n = len(A)
    inputs = -(-(n + steps + 5) // VECTOR) * VECTOR - n
    state, velocities = np.eye(n, n + inputs), []
    for step in range(steps):
        state = F @ state
        state[:, n:] += before @ _select_inputs(step, steps, inputs) + after @ _select_inputs(
            step + 1, steps, inputs
        )
        velocities.append(state[1] - state[3])
    recorded = np.hstack([C, D @ _select_inputs(0, steps, inputs)])  # at the start of the sample
    return np.vstack([state, *velocities, recorded])


def _select_inputs(step: int, steps: int, inputs: int) -> np.ndarray:
    """Inputs of the continuous model after some of the integration steps, from w; shape (4, inputs)."""
    selection = np.zeros((4, inputs))
    selection[[COMMAND, NOISE, DRIVE], [0, 1, 4 + step]] = 1.0
    selection[VOLUNTARY, 2:4] = 1.0 - step / steps, step / steps
    return selection


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
        z[n], z[n + 1], z[n + 2], z[n + 3] = (
            command[k],
            noise[k],
            voluntary[k],
            voluntary[min(k + 1, frames - 1)],
        )
        for j in range(steps + 1):
            at = start + j
            z[n + inputs + j] = gains[k] * ring[at if at < ring.size else at - ring.size]
        for i in range(rows if len(changes) > 0 else 0):
            for j in range(columns):
                present[i, j] = matrix[i, j]
            for term in range(len(changes)):
                factor = factors[k, term]
                for j in range(columns):
                    present[i, j] += factor * changes[term, i, j]
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
            delayed = (
                fraction * velocity + (1.0 - fraction) * now
            )  # the delay ends between two steps
            at = (start + j + 1 + whole) % ring.size
            ring[at] = max(0.0, delayed - threshold)
            velocity = now
        start = (start + steps) % ring.size
    return -1


def run_loop(
    settings: SimulationSettings,
    joint: Trajectories,
    command: np.ndarray,
    noise: np.ndarray,
    voluntary: np.ndarray,
) -> np.ndarray:
    """Run the loop from rest: recorded position, intrinsic and reflex torque; a loop that diverges is an error.

    Shapes: joint in the middle of each sample, command, noise, voluntary (N,); returns (3, N).
    """
    loop = build_loop(settings)
    steps_of_delay = settings.delay * settings.integration_rate
    whole = int(np.floor(steps_of_delay + 1e-9))
    delay = (
        round(settings.integration_rate / settings.recording_rate),
        whole,
        max(0.0, steps_of_delay - whole),
    )
    limits = settings.reflex_threshold, settings.position_limit
    factors = loop.factors(joint.stiffness, joint.viscosity)
    gains = joint.gain / (parameter_ranges(settings)[2, 1] or 1.0)
    record = np.empty((RECORDED, command.size))
    divergence = _run(
        loop.matrix, loop.changes, factors, gains, command, noise, voluntary, delay, limits, record
    )
    if divergence >= 0:
        parameters = (
            f"{name}={getattr(settings, name):g} {settings.unit(name)}" for name in DECISIVE
        )
        raise UnstableLoopError(
            f"the closed loop is unstable: the position passes ±{settings.position_limit:g} rad after "
            f"{divergence / settings.recording_rate:.3g} s. Parameters: {', '.join(parameters)}. "
            "Take a heavier or more damped load, or a lower reflex gain."
        )
    return record
