"""The joint, the load and the recorder, discretised exactly and run by a compiled kernel.

Between two integration steps everything but the rectifier is linear, and the rectifier acts on velocity that is at
least one recorded sample old. So the loop is a linear system with known inputs over a recorded sample: command and
noise (constant), voluntary torque (linear over the sample) and rectified delayed velocity (linear over each
integration step). The matrix exponential integrates it exactly, anti-aliasing filter included; only the linear
interpolation of the rectified velocity is approximate, with an error of the order of (ω / integration rate)² / 12.
"""

from __future__ import annotations

from dataclasses import dataclass

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
    """The loop over one recorded sample: x⁺ = P x + G w, velocities = VP x + VG w, recorded = C x.

    w holds command, noise, voluntary torque at the start and at the end of the sample, and the rectified velocity at
    the start and after each integration step.

    Parameters
    ----------
    P, G : ndarray, shape (n, n), (n, 5 + steps)
        State after the sample.
    VP, VG : ndarray, shape (steps, n), (steps, 5 + steps)
        Velocity after each integration step.
    C : ndarray, shape (3, n)
        Recorded position, intrinsic and reflex torque.
    """

    P: np.ndarray
    G: np.ndarray
    VP: np.ndarray
    VG: np.ndarray
    C: np.ndarray

    @property
    def columns(self) -> np.ndarray:
        """Columns of the matrix that takes (x, w) to (x⁺, velocities, recorded), padded with zeros for the kernel."""
        C = np.hstack([self.C, np.zeros((len(self.C), self.G.shape[1]))])
        matrix = np.vstack([np.hstack([self.P, self.G]), np.hstack([self.VP, self.VG]), C])
        return np.ascontiguousarray(np.pad(matrix, ((0, -matrix.shape[0] % WIDTH), (0, -matrix.shape[1] % 4))).T)


def _continuous_model(settings: SimulationSettings) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """State-space matrices A and B of the linear part, row of the velocity, rows of the recorded signals."""
    As, bs, _ = companion(lowpass_denominator(2 * np.pi * settings.actuator_frequency, settings.actuator_damping))
    Aq, bq, _ = companion(lowpass_denominator(settings.omega_n, settings.zeta, settings.pole))
    Af, bf, _ = companion(antialias_denominator(settings.antialias_cutoff))
    # States: servo, displacement of the load and its rate, reflex torque, filtered position and reflex torque.
    servo, reflex = slice(0, 2), slice(4, 4 + len(Aq))
    filtered_position = slice(reflex.stop, reflex.stop + len(Af))
    filtered_reflex = slice(filtered_position.stop, filtered_position.stop + len(Af))
    n = filtered_reflex.stop
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
    for states, signal in ((filtered_position, position), (filtered_reflex, reflex_torque)):
        A[states, states] = Af
        A[states] += bf * signal

    # The filter commutes with differentiation: its states give the filtered P, Ṗ and P̈, hence the intrinsic torque.
    outputs = np.zeros((3, n))
    outputs[0, filtered_position.start] = 1
    outputs[1, filtered_position][:3] = settings.stiffness, settings.viscosity, settings.inertia
    outputs[2, filtered_reflex.start] = 1
    return A, B, velocity, outputs


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
    steps = round(settings.integration_rate / settings.recording_rate)
    A, B, velocity, outputs = _continuous_model(settings)
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
    return Loop(P, G, VP, VG, outputs)


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
def _run(columns, n, steps, outputs, command, noise, voluntary, whole, fraction, limit):
    """One matrix product for each recorded sample: next state, velocities within the sample, recorded signals.

    The product adds four columns of the matrix at a time, so that all its sums stay in registers.
    """
    trials, frames = command.shape
    record = np.empty((outputs, trials, frames))
    # Drive of the reflex at each integration step; zero before the run begins.
    drive = np.empty(whole + frames * steps + 1)
    z, out = np.empty(columns.shape[0]), np.empty(columns.shape[1])
    for trial in range(trials):
        z[:], drive[: whole + 1], velocity = 0.0, 0.0, 0.0
        for k in range(frames):
            z[n], z[n + 1], z[n + 2] = command[trial, k], noise[trial, k], voluntary[trial, k]
            z[n + 3] = voluntary[trial, min(k + 1, frames - 1)]
            for j in range(steps + 1):
                z[n + 4 + j] = drive[k * steps + j]
            _multiply(columns, z, out)
            for i in range(outputs):
                record[i, trial, k] = out[n + steps + i]
            if not abs(record[0, trial, k]) <= limit:
                return record, k
            for i in range(n):
                z[i] = out[i]
            for j in range(steps):
                step, previous, velocity = whole + k * steps + j + 1, velocity, out[n + j]
                drive[step] = max(0.0, (1.0 - fraction) * velocity + fraction * previous)
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
        Position [rad], intrinsic torque [N·m] and reflex torque [N·m] behind the anti-aliasing filter.
    divergence : int
        Sample at which the position of a trial passes its limit, or -1.
    """
    steps_of_delay = settings.delay * settings.integration_rate
    whole = int(np.floor(steps_of_delay + 1e-9))
    fraction = max(0.0, steps_of_delay - whole)
    shape = np.shape(command)
    command, noise, voluntary = (
        np.ascontiguousarray(np.atleast_2d(signal), dtype=float) for signal in (command, noise, voluntary)
    )
    sizes = loop.P.shape[0], loop.VP.shape[0], loop.C.shape[0]
    record, divergence = _run(loop.columns, *sizes, command, noise, voluntary, whole, fraction, settings.position_limit)
    return record.reshape(len(record), *shape), divergence
