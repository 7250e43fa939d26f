"""The joint, the load and the recorder, discretised exactly and run by a compiled kernel.

Between two integration steps everything but the rectifier is linear, and the rectifier acts on velocity that is at
least one recorded sample old. So the loop is a linear system with known inputs over a recorded sample: command and
noise (held), voluntary torque (linear over the sample) and rectified delayed velocity (linear over each integration
step). The matrix exponential integrates it exactly, anti-aliasing filter included; only the linear interpolation of
the rectified velocity is approximate, with an error of the order of (ω / integration rate)² / 12.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit

from ankleloop.signals.discretisation import step_matrices
from ankleloop.simulation.filters import ANTIALIAS_ORDER, bessel_denominator, companion

__all__ = ["Loop", "build_loop", "run_loop"]

WIDTH = 16  # sums that the compiled kernel makes side by side
# Inputs of the continuous model.
COMMAND, NOISE, VOLUNTARY, RECTIFIED = range(4)


@dataclass(frozen=True)
class Loop:
    """The loop over one recorded sample: x⁺ = P x + G w, velocities = VP x + VG w, recorded = C x.

    w holds command, noise, voluntary torque at the start and at the end of the sample, and the rectified velocity at
    the start and after each integration step.
    """

    P: np.ndarray
    G: np.ndarray
    VP: np.ndarray
    VG: np.ndarray
    C: np.ndarray

    @property
    def columns(self):
        """Columns of the matrix that takes (x, w) to (x⁺, velocities, recorded), padded with zeros for the kernel."""
        C = np.hstack([self.C, np.zeros((len(self.C), self.G.shape[1]))])
        matrix = np.vstack([np.hstack([self.P, self.G]), np.hstack([self.VP, self.VG]), C])
        return np.ascontiguousarray(np.pad(matrix, ((0, -matrix.shape[0] % WIDTH), (0, -matrix.shape[1] % 4))).T)


def _continuous_model(simulation):
    """State-space matrices (A, B) of the linear part, and output rows by name."""
    joint, reflex, load = simulation.intrinsic, simulation.reflex, simulation.load
    ws, zs = 2 * np.pi * simulation.actuator.actuator_frequency, simulation.actuator.actuator_damping
    denominator = np.array([1.0, 2 * reflex.zeta * reflex.omega_n, reflex.omega_n**2])
    if reflex.pole is not None:
        denominator = np.polymul(denominator, [1.0, reflex.pole])
    Aq, bq = companion(denominator)
    Af, bf = companion(bessel_denominator(ANTIALIAS_ORDER, 2 * np.pi * simulation.recorder.antialias_cutoff))
    nq, nf = Aq.shape[0], Af.shape[0]
    servo = slice(0, 2)  # followed by the give of the load, 2 and 3
    q, fp, fr = slice(4, 4 + nq), slice(4 + nq, 4 + nq + nf), slice(4 + nq + nf, 4 + nq + 2 * nf)
    n = fr.stop
    A, B = np.zeros((n, n)), np.zeros((n, 4))

    A[servo, servo] = [[0, 1], [-(ws**2), -2 * zs * ws]]
    B[1, COMMAND] = ws**2
    A[q, q] = Aq
    B[q, RECTIFIED] = reflex.reflex_gain * bq
    position, velocity, reflex_torque = np.zeros((3, n))
    position[[0, 2]] = velocity[[1, 3]] = 1, -1
    reflex_torque[q.start] = 1
    if simulation.run.closed_loop:
        # Torque acts on acceleration at once: I_L·l̈ = TQ − B_L·l̇ − K_L·l with TQ holding I·(θ̈ − l̈), solved for l̈.
        row = joint.stiffness * position + joint.viscosity * velocity + joint.inertia * A[1] + reflex_torque
        row[2] -= load.load_stiffness
        row[3] -= load.load_viscosity
        column = joint.inertia * B[1]
        column[[NOISE, VOLUNTARY]] += 1
        A[2, 3] = 1
        A[3] = row / (load.load_inertia + joint.inertia)
        B[3] = column / (load.load_inertia + joint.inertia)
    A[fp, fp], A[fr, fr] = Af, Af
    A[fp] += np.outer(bf, position)
    A[fr] += np.outer(bf, reflex_torque)

    # The filter commutes with differentiation: its states give the filtered P, Ṗ and P̈, hence the intrinsic torque.
    recorded = np.zeros((3, n))
    recorded[0, fp.start] = 1
    recorded[1, fp.start : fp.start + 3] = joint.stiffness, joint.viscosity, joint.inertia
    recorded[2, fr.start] = 1
    return A, B, velocity, recorded


def build_loop(simulation):
    """Discretise the loop over one recorded sample.

    Parameters
    ----------
    simulation : Simulation
        The parameters.

    Returns
    -------
    Loop
    """
    steps = round(simulation.run.integration_rate / simulation.recorder.recording_rate)
    A, B, velocity, recorded = _continuous_model(simulation)
    F, G0, G1 = step_matrices(A, B, 1.0 / simulation.run.integration_rate)
    n = A.shape[0]
    P, G = np.eye(n), np.zeros((n, 4 + steps + 1))
    VP, VG = np.zeros((steps, n)), np.zeros((steps, G.shape[1]))
    for j in range(steps):
        P, G = F @ P, F @ G
        G[:, 0] += G0[:, COMMAND] + G1[:, COMMAND]
        G[:, 1] += G0[:, NOISE] + G1[:, NOISE]
        for gain, at in ((G0[:, VOLUNTARY], j / steps), (G1[:, VOLUNTARY], (j + 1) / steps)):
            G[:, 2] += (1 - at) * gain
            G[:, 3] += at * gain
        G[:, 4 + j] += G0[:, RECTIFIED]
        G[:, 5 + j] += G1[:, RECTIFIED]
        VP[j], VG[j] = velocity @ P, velocity @ G
    return Loop(P, G, VP, VG, recorded)


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
    """One matrix product for each recorded sample: next state, velocities within the sample and what is recorded.

    The matrix comes by its columns, four of which are added at a time: all sums stand side by side in registers.
    """
    trials, frames = command.shape
    recorded = np.empty((outputs, trials, frames))
    # What the reflex sees at each integration step; it is at rest before the run began.
    rectified = np.empty(whole + frames * steps + 1)
    z, out = np.empty(columns.shape[0]), np.empty(columns.shape[1])
    for trial in range(trials):
        z[:], rectified[: whole + 1], velocity = 0.0, 0.0, 0.0
        for k in range(frames):
            z[n], z[n + 1], z[n + 2] = command[trial, k], noise[trial, k], voluntary[trial, k]
            z[n + 3] = voluntary[trial, min(k + 1, frames - 1)]
            for j in range(steps + 1):
                z[n + 4 + j] = rectified[k * steps + j]
            _multiply(columns, z, out)
            for i in range(outputs):
                recorded[i, trial, k] = out[n + steps + i]
            if not abs(recorded[0, trial, k]) <= limit:
                return recorded, k
            for i in range(n):
                z[i] = out[i]
            for j in range(steps):
                at, before, velocity = whole + k * steps + j + 1, velocity, out[n + j]
                rectified[at] = max(0.0, (1.0 - fraction) * velocity + fraction * before)
    return recorded, -1


def run_loop(loop, simulation, command, noise, voluntary):
    """Run the loop from rest.

    Parameters
    ----------
    loop : Loop
        The loop from `build_loop`.
    simulation : Simulation
        The parameters it was built from.
    command, noise, voluntary : ndarray, shape (N,) or (trials, N)
        Command [rad] and noise [N·m], held over each recorded sample; voluntary torque [N·m], linear between them.

    Returns
    -------
    recorded : ndarray, shape (3, N) or (3, trials, N)
        Position [rad], intrinsic torque [N·m] and reflex torque [N·m] behind the anti-aliasing filter.
    diverged : int
        Sample at which the position of a trial left its limit, or -1.
    """
    steps_of_delay = simulation.reflex.delay * simulation.run.integration_rate
    whole = int(np.floor(steps_of_delay + 1e-9))
    fraction = max(0.0, steps_of_delay - whole)
    shape = np.shape(command)
    inputs = (np.ascontiguousarray(np.atleast_2d(u), dtype=float) for u in (command, noise, voluntary))
    sizes = loop.P.shape[0], loop.VP.shape[0], loop.C.shape[0]
    recorded, diverged = _run(loop.columns, *sizes, *inputs, whole, fraction, simulation.run.position_limit)
    return recorded.reshape(len(recorded), *shape), diverged
