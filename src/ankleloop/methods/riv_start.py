"""Start of refined instrumental variables: the best of a grid of dynamics."""

from __future__ import annotations

import numpy as np

from ankleloop.joint.dynamics import ReflexDynamics
from ankleloop.methods.riv_equations import MOTION, RivEquations, RivParameters

__all__ = ["best_of_grid"]

DELAYS = np.arange(0.02, 0.121, 0.01)  # s: candidates for the start of an unknown delay


def best_of_grid(equations: RivEquations) -> RivParameters:
    """Best of a grid of dynamics for the predicted position: a fit to the torque that the reference explains."""
    nominal, s = equations.regressors.delay, equations.band.s
    shifts = DELAYS - nominal if equations.estimate_delay else np.zeros(1)
    grid = [(dynamics, shift) for dynamics in ReflexDynamics.grid(equations.order) for shift in shifts]
    filters = np.array([dynamics.response(s)[0] for dynamics, _ in grid[:: len(shifts)]])
    delays = np.exp(-np.outer(shifts, s))
    filters = (filters[:, None] * delays).reshape(len(grid), -1)
    linear, best = _fit_grid(equations, filters, np.ones(s.size))
    if equations.weighting == "noise":
        motion, drive = np.split(equations.predicted, [MOTION])
        residual = equations.torque - linear[:MOTION] @ motion - filters[best] * (linear[MOTION:] @ drive)
        linear, best = _fit_grid(equations, filters, equations.smooth_power(residual))
    return RivParameters(linear, *grid[best])


def _fit_grid(equations: RivEquations, filters: np.ndarray, noise: np.ndarray) -> tuple[np.ndarray, int]:
    """Linear parameters of the best of some filters; they are fitted for all of the filters in one pass."""
    torque, (motion, drive) = equations.torque, np.split(equations.predicted, [MOTION])
    k, size = len(drive), len(filters)
    weighted = motion.conj() / noise
    normal = np.empty((size, MOTION + k, MOTION + k))
    normal[:, :MOTION, :MOTION] = np.real(weighted @ motion.T)
    cross = np.real(filters @ (weighted[:, None] * drive).reshape(MOTION * k, -1).T).reshape(-1, MOTION, k)
    normal[:, :MOTION, MOTION:], normal[:, MOTION:, :MOTION] = cross, np.swapaxes(cross, 1, 2)
    products = np.real(drive.conj()[:, None] * drive / noise).reshape(k * k, -1)
    normal[:, MOTION:, MOTION:] = (np.abs(filters) ** 2 @ products.T).reshape(-1, k, k)
    right = np.empty((size, MOTION + k))
    right[:, :MOTION] = np.real(weighted @ torque)
    right[:, MOTION:] = np.real(filters @ (drive * torque.conj() / noise).T)
    scale = 1.0 / np.sqrt(np.einsum("gii->gi", normal))
    scaled = normal * scale[:, :, None] * scale[:, None] + 1e-12 * np.eye(MOTION + k)
    linear = scale * np.linalg.solve(scaled, (scale * right)[..., None])[..., 0]
    best = int(np.argmax(np.sum(right * linear, axis=1)))  # explained energy
    return linear[best], best
