"""The joint, the load and the recorder, discretised exactly and run by a compiled kernel.

Between two integration steps everything but the rectifier is linear, and the rectifier acts on velocity that is at
least one recorded sample old. So the loop is a linear system with known inputs over a recorded sample: command and
noise (constant), voluntary torque (linear over the sample) and rectified delayed velocity (linear over each
integration step). The matrix exponential integrates it exactly, anti-aliasing filter included; only the linear
interpolation of the rectified velocity is approximate, with an error of the order of (ω / integration rate)² / 12.

A stiffness that drifts is constant over each recorded sample. The matrices of a sample are analytic functions of it,
and a sample is short, so a parabola through three values gives them to rounding.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numba import njit

from ankleloop.signals.discretisation import companion, lowpass_denominator, step_matrices
from ankleloop.simulation.filters import antialias_denominator
from ankleloop.simulation.settings import SimulationSettings

__all__ = ["Loop", "build_loop", "run_loop"]

WIDTH = 16  # sums that the compiled kernel makes side by side
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
    changes : ndarray, shape (2, columns, rows), or (0, columns, rows)
        Changes of the entries of `columns` in proportion to x and to x², where x is the change of the stiffness as a
        share of half of its drift over the record; none without drift.
    """

    P: np.ndarray
    G: np.ndarray
    VP: np.ndarray
    VG: np.ndarray
    C: np.ndarray
    D: np.ndarray
    changes: np.ndarray | None = None

    @property
    def columns(self) -> np.ndarray:
        """Columns of the matrix that takes (x, w) to (x⁺, velocities, recorded), padded with zeros for the kernel."""
        pairs = (self.P, self.G), (self.VP, self.VG), (self.C, self.D)
        matrix = np.vstack([np.hstack(pair) for pair in pairs])
        return np.ascontiguousarray(np.pad(matrix, ((0, -matrix.shape[0] % WIDTH), (0, -matrix.shape[1] % 4))).T)


class _ContinuousModel(NamedTuple):
    """The linear part of the loop: its matrices A and B, its velocity, and what is recorded of it, C x + D u."""

    A: np.ndarray
    B: np.ndarray
    velocity: np.ndarray
    C: np.ndarray
    D: np.ndarray


def _continuous_model(settings: SimulationSettings) -> _ContinuousModel:
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
        row = settings.stiffness * position + settings.viscosity * velocity + settings.inertia * A[1] + reflex_torque
        row[2] -= settings.load_stiffness
        row[3] -= settings.load_viscosity
        inputs = settings.inertia * B[1]
        inputs[[NOISE, VOLUNTARY]] += 1
        A[2, 3] = 1
        A[3] = row / (settings.load_inertia + settings.inertia)
        B[3] = inputs / (settings.load_inertia + settings.inertia)
    if settings.antialias_cutoff is not None and settings.stiffness_drift == 0:
        denominator = antialias_denominator(settings.antialias_cutoff)
        return _add_filters(A, B, velocity, (position, reflex_torque), denominator, settings)
    intrinsic = settings.stiffness * position + settings.viscosity * velocity + settings.inertia * (A[1] - A[3])
    D = np.zeros((3, 4))
    D[1] = settings.inertia * (B[1] - B[3])  # command and noise act on the acceleration at once
    model = _ContinuousModel(A, B, velocity, np.vstack([position, intrinsic, reflex_torque]), D)
    return model if settings.antialias_cutoff is None else _filter_outputs(model, settings.antialias_cutoff)


def _filter_outputs(model: _ContinuousModel, cutoff: float) -> _ContinuousModel:
    """The model with an anti-aliasing filter behind each output: it does not commute with a stiffness that drifts."""
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
    middle = _discretise(settings)
    if settings.stiffness_drift == 0:
        return middle
    low, high = (
        _discretise(settings.model_copy(update={"stiffness": settings.stiffness * (1 + change)})).columns
        for change in (-0.5 * settings.stiffness_drift, 0.5 * settings.stiffness_drift)
    )
    changes = np.array([0.5 * (high - low), 0.5 * (high + low) - middle.columns])
    return replace(middle, changes=changes)


def _discretise(settings: SimulationSettings) -> Loop:
    """The loop over one recorded sample, for the stiffness of the settings."""
    steps = round(settings.integration_rate / settings.recording_rate)
    A, B, velocity, C, direct = _continuous_model(settings)
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


# Contraction lets the compiler use fused multiply-adds; sums are not reordered.
@njit(cache=True, fastmath={"contract"})
def _multiply(columns, z, out):
    out[:] = 0.0
    for i in range(0, z.size, 4):
        a, b, c, d = z[i], z[i + 1], z[i + 2], z[i + 3]
        first, second, third, fourth = columns[i], columns[i + 1], columns[i + 2], columns[i + 3]
        for j in range(out.size):
            out[j] += a * first[j] + b * second[j] + c * third[j] + d * fourth[j]


@njit(cache=True, fastmath={"contract"})
def _run(columns, changes, drift, sizes, external, delay, threshold, limit):
    """One matrix product for each recorded sample: next state, velocities within the sample, recorded signals.

    The product adds four columns of the matrix at a time, so that all its sums stay in registers. `sizes` are those of
    state, steps and outputs; `external` command, noise and voluntary torque; `delay` whole steps and the rest of one.
    """
    n, steps, outputs = sizes
    command, noise, voluntary = external
    whole, fraction = delay
    trials, frames = command.shape
    record = np.empty((outputs, trials, frames))
    # Drive of the reflex at each integration step; zero before the run begins.
    drive = np.empty(whole + frames * steps + 1)
    z, out = np.empty(columns.shape[0]), np.empty(columns.shape[1])
    matrix = columns.copy()
    for trial in range(trials):
        z[:], drive[: whole + 1], velocity = 0.0, 0.0, 0.0
        for k in range(frames):
            z[n], z[n + 1], z[n + 2] = command[trial, k], noise[trial, k], voluntary[trial, k]
            z[n + 3] = voluntary[trial, min(k + 1, frames - 1)]
            for j in range(steps + 1):
                z[n + 4 + j] = drive[k * steps + j]
            if changes.shape[0] > 0:
                matrix[:] = columns + drift[k] * (changes[0] + drift[k] * changes[1])
            _multiply(matrix, z, out)
            for i in range(outputs):
                record[i, trial, k] = out[n + steps + i]
            if not abs(record[0, trial, k]) <= limit:
                return record, k
            for i in range(n):
                z[i] = out[i]
            for j in range(steps):
                step, previous, velocity = whole + k * steps + j + 1, velocity, out[n + j]
                drive[step] = max(0.0, (1.0 - fraction) * velocity + fraction * previous - threshold)
    return record, -1


def run_loop(
    loop: Loop, settings: SimulationSettings, command: np.ndarray, noise: np.ndarray, voluntary: np.ndarray
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
    shape = np.shape(command)
    external = tuple(np.ascontiguousarray(np.atleast_2d(signal), dtype=float) for signal in (command, noise, voluntary))
    sizes = loop.P.shape[0], loop.VP.shape[0], loop.C.shape[0]
    columns = loop.columns
    changes = np.empty((0, *columns.shape)) if loop.changes is None else loop.changes
    time = (np.arange(external[0].shape[1]) + 0.5) / settings.recording_rate - settings.settling
    drift = np.clip(2.0 * time / settings.duration - 1.0, -1.0, 1.0)
    limits = settings.reflex_threshold, settings.position_limit
    record, divergence = _run(columns, changes, drift, sizes, external, (whole, fraction), *limits)
    return record.reshape(len(record), *shape), divergence
