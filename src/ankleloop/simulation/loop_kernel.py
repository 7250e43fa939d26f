"""The discretised loop, run by a compiled kernel."""

from __future__ import annotations

import numpy as np

from ankleloop.kernels import kernel
from ankleloop.simulation.loop import Loop
from ankleloop.simulation.settings import SimulationSettings
from ankleloop.simulation.trajectories import Trajectories, parameter_ranges

__all__ = ["run_loop"]


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
    matrix = loop.matrix
    changes = np.empty((0, *matrix.shape)) if loop.changes is None else np.ascontiguousarray(loop.changes)
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
