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
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np

from ankleloop.errors import UnstableLoopError
from ankleloop.kernels import kernel
from ankleloop.signals.statespace import companion, lowpass_denominator, step_matrices
from ankleloop.simulation.filters import ANTIALIAS_ORDER, bessel_denominator
from ankleloop.simulation.settings import LOAD_SETTINGS, SimulationSettings
from ankleloop.simulation.trajectories import Trajectories, parameter_ranges

# Of the polynomials for stiffness and viscosity: over their whole range the error is that of rounding.
DEGREE = 3
VECTOR_SIZE = 8  # doubles: rows of whole vectors take a fourth less time
# Inputs of the continuous model; the drive of the reflex is the rectified delayed velocity, times the share of the gain
# in its largest value.
COMMAND, NOISE, VOLUNTARY, DRIVE = range(4)
STABILITY_SETTINGS = (*LOAD_SETTINGS, "reflex_gain", "delay", "stiffness", "viscosity")
RECORDED_SIGNALS = 3  # position, intrinsic and reflex torque


@dataclass(frozen=True, eq=False)
class Loop:
    """The loop over one recorded sample: `matrix` takes (x, w) to (x⁺, velocities, recorded).

    w holds command, noise, voluntary torque at the start and at the end of the sample, the drive at the start and after
    each integration step, and zeros that fill up a vector; the velocities are those after each integration step.
    """

    # Shape (rows, columns), for stiffness and viscosity in the middle of their ranges.
    matrix: np.ndarray
    ranges: np.ndarray  # shape (2, 2): middle and half of the ranges of stiffness and viscosity
    # Shape (terms, rows, columns): changes of the matrix in proportion to products of powers of x and y, the deviations
    # of stiffness and viscosity from the middle of their ranges as shares of half of them; no terms for constant ones.
    changes: np.ndarray
    powers: Sequence[tuple[int, ...]] = ()  # powers of x and y in each term

    def factors(self, stiffness: np.ndarray, viscosity: np.ndarray) -> np.ndarray:
        """Factor of each of the changes, shape (N, terms), for stiffness and viscosity over N samples."""
        if not self.powers:
            return np.empty((stiffness.size, 0))
        middle, half = self.ranges.T
        values = np.column_stack([stiffness, viscosity])
        shares = (values - middle) / np.where(half > 0, half, 1.0)
        return _monomials(shares, self.powers)


def _monomials(points: np.ndarray, powers: Sequence[tuple[int, ...]]) -> np.ndarray:
    """Products of powers of x and y.

    Shapes: points (N, 2); returns (N, terms).
    """
    x, y = points.T
    return np.stack([x**i * y**j for i, j in powers], axis=1)


class _ContinuousModel(NamedTuple):
    """The linear part of the loop, ẋ = A x + B u, recorded = C x + D u."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray


def _equations_of_motion(
    settings: SimulationSettings, stiffness: float, viscosity: float
) -> _ContinuousModel:
    """States: servo and its rate, displacement of the load and its rate, reflex torque and its derivatives."""
    servo = lowpass_denominator(2 * np.pi * settings.actuator_frequency, settings.actuator_damping)
    A_servo, B_servo, _ = companion(servo)
    A_reflex, B_reflex, _ = companion(
        lowpass_denominator(settings.omega_n, settings.zeta, settings.pole)
    )
    reflex = slice(4, 4 + len(A_reflex))
    inertia = settings.inertia
    A = np.zeros((reflex.stop, reflex.stop))
    B = np.zeros((reflex.stop, 4))
    A[:2, :2] = A_servo
    B[:2, COMMAND] = B_servo[:, 0]
    A[reflex, reflex] = A_reflex
    largest_gain = parameter_ranges(settings)[2, 1]
    B[reflex, DRIVE] = largest_gain * B_reflex[:, 0]

    position, velocity, reflex_torque = np.zeros((RECORDED_SIGNALS, reflex.stop))
    position[[0, 2]] = 1, -1
    velocity[[1, 3]] = 1, -1
    reflex_torque[reflex.start] = 1
    viscoelastic = stiffness * position + viscosity * velocity
    if settings.closed_loop:
        # Torque acts on acceleration at once: I_L·l̈ = TQ − B_L·l̇ − K_L·l with TQ holding I·(θ̈ − l̈), solved for l̈.
        drive = viscoelastic + inertia * A[1] + reflex_torque
        drive[2] -= settings.load_stiffness
        drive[3] -= settings.load_viscosity
        inputs = inertia * B[1]
        inputs[[NOISE, VOLUNTARY]] += 1
        total_inertia = settings.load_inertia + inertia
        A[2, 3] = 1
        A[3] = drive / total_inertia
        B[3] = inputs / total_inertia
    intrinsic = viscoelastic + inertia * (A[1] - A[3])
    D = np.zeros((RECORDED_SIGNALS, 4))
    D[1] = inertia * (B[1] - B[3])  # command and noise act on the acceleration at once
    return _ContinuousModel(A, B, np.vstack([position, intrinsic, reflex_torque]), D)


def _continuous_model(
    settings: SimulationSettings, stiffness: float, viscosity: float
) -> _ContinuousModel:
    """The equations of motion, with the anti-aliasing filters behind what is recorded."""
    model = _equations_of_motion(settings, stiffness, viscosity)
    cutoff = settings.antialias_cutoff
    return model if cutoff is None else _filter_outputs(model, cutoff)


def _filter_outputs(model: _ContinuousModel, cutoff: float) -> _ContinuousModel:
    """The model with an anti-aliasing filter behind each output."""
    A_filter, B_filter, _ = companion(bessel_denominator(ANTIALIAS_ORDER, 2 * np.pi * cutoff))
    outputs = len(model.C)
    states = len(model.A)
    A = np.pad(model.A, (0, outputs * ANTIALIAS_ORDER))
    A[states:, :states] = np.kron(model.C, B_filter)
    A[states:, states:] = np.kron(np.eye(outputs), A_filter)
    B = np.vstack([model.B, np.kron(model.D, B_filter)])
    C = np.zeros((outputs, len(A)))
    rows = np.arange(outputs)
    C[rows, states + ANTIALIAS_ORDER * rows] = 1
    return _ContinuousModel(A, B, C, np.zeros_like(model.D))


@lru_cache(maxsize=4)
def build_loop(settings: SimulationSettings) -> Loop:
    """Discretise the loop over one recorded sample.

    Where stiffness and viscosity vary, polynomials go through Chebyshev points of them.
    """
    ranges = _varying_range(settings)
    matrix = _discretise(settings, ranges[:, 0])
    constant = Loop(matrix, ranges, np.empty((0, *matrix.shape)))
    if not ranges[:, 1].any():
        return constant
    return _fit_polynomials(settings, constant)


def _varying_range(settings: SimulationSettings) -> np.ndarray:
    """Middle and half of the ranges of stiffness and viscosity, shape (2, 2)."""
    low, high = parameter_ranges(settings)[:2].T
    return np.column_stack([0.5 * (low + high), 0.5 * (high - low)])


def _fit_polynomials(settings: SimulationSettings, constant: Loop) -> Loop:
    """The loop with polynomials through Chebyshev points of stiffness and viscosity."""
    middle, half = constant.ranges.T
    chebyshev = np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)
    nodes = [chebyshev if size > 0 else np.zeros(1) for size in half]
    powers = list(product(*(range(places.size) for places in nodes)))
    points = np.array(list(product(*nodes)))
    matrices = [_discretise(settings, values) for values in middle + half * points]
    inverse = np.linalg.inv(_monomials(points, powers))
    terms = np.tensordot(inverse, np.array(matrices), 1)
    low_degree = [k for k, exponents in enumerate(powers) if 0 < sum(exponents) <= DEGREE]
    return replace(constant, changes=terms[low_degree], powers=[powers[k] for k in low_degree])


def _discretise(settings: SimulationSettings, values: np.ndarray) -> np.ndarray:
    """Matrix of the loop over one recorded sample, for a stiffness and a viscosity."""
    A, B, C, D = _continuous_model(settings, *values)
    F, before, after = step_matrices(A, B, 1.0 / settings.integration_rate)
    steps = round(settings.integration_rate / settings.recording_rate)
    states = len(A)
    columns = -(-(states + steps + 5) // VECTOR_SIZE) * VECTOR_SIZE
    inputs = columns - states
    state = np.eye(states, columns)
    velocities = []
    selections = (_select_inputs(step, steps, inputs) for step in range(steps + 1))
    for start, end in pairwise(selections):
        state = F @ state
        state[:, states:] += before @ start + after @ end
        velocities.append(state[1] - state[3])
    recorded = np.hstack([C, D @ _select_inputs(0, steps, inputs)])  # at the start of the sample
    return np.vstack([state, *velocities, recorded])


def _select_inputs(step: int, steps: int, inputs: int) -> np.ndarray:
    """Inputs of the continuous model after some of the integration steps, from w; shape (4, inputs)."""
    share = step / steps
    selection = np.zeros((4, inputs))
    selection[[COMMAND, NOISE, DRIVE], [0, 1, 4 + step]] = 1.0
    selection[VOLUNTARY, 2:4] = 1.0 - share, share
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
    samples = command.size
    steps, whole, fraction = delay
    threshold, limit = limits
    rows, columns = matrix.shape
    states = rows - steps - len(record)
    drives = states + 4  # place of the drives in (x, w)
    # Drive of the reflex from the present step to the end of the delay, in a ring; zero before the run begins.
    ring = np.zeros(whole + steps + 2)
    first = 0
    velocity = 0.0
    z = np.zeros(columns)
    out = np.zeros(rows)
    present = matrix.copy()
    for k in range(samples):
        z[states] = command[k]
        z[states + 1] = noise[k]
        z[states + 2] = voluntary[k]
        z[states + 3] = voluntary[min(k + 1, samples - 1)]
        for j in range(steps + 1):
            place = first + j
            if place >= ring.size:  # a remainder would take longer
                place -= ring.size
            z[drives + j] = gains[k] * ring[place]
        for i in range(rows if len(changes) > 0 else 0):
            for j in range(columns):
                present[i, j] = matrix[i, j]
            for term in range(len(changes)):
                factor = factors[k, term]
                for j in range(columns):
                    present[i, j] += factor * changes[term, i, j]
        for i in range(rows):
            total = 0.0
            row = present[i]
            for j in range(columns):
                total += row[j] * z[j]
            out[i] = total
        for i in range(len(record)):
            record[i, k] = out[states + steps + i]
        if not abs(record[0, k]) <= limit:
            return k
        for i in range(states):
            z[i] = out[i]
        for j in range(steps):
            now = out[states + j]
            # The delay ends between two steps.
            delayed = fraction * velocity + (1.0 - fraction) * now
            ring[(first + j + 1 + whole) % ring.size] = max(0.0, delayed - threshold)
            velocity = now
        first = (first + steps) % ring.size
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
    steps = round(settings.integration_rate / settings.recording_rate)
    delay = settings.delay * settings.integration_rate
    whole = int(np.floor(delay + 1e-9))
    largest_gain = parameter_ranges(settings)[2, 1] or 1.0
    record = np.empty((RECORDED_SIGNALS, command.size))
    divergence = _run(
        loop.matrix,
        loop.changes,
        loop.factors(joint.stiffness, joint.viscosity),
        joint.gain / largest_gain,
        command,
        noise,
        voluntary,
        (steps, whole, max(0.0, delay - whole)),
        (settings.reflex_threshold, settings.position_limit),
        record,
    )
    if divergence >= 0:
        seconds = divergence / settings.recording_rate
        parameters = ", ".join(
            f"{name}={getattr(settings, name):g} {settings.unit(name)}"
            for name in STABILITY_SETTINGS
        )
        raise UnstableLoopError(
            f"the closed loop is unstable: the position passes ±{settings.position_limit:g} rad after {seconds:.3g} s. "
            f"Parameters: {parameters}. Take a heavier or more damped load, or a lower reflex gain."
        )
    return record
