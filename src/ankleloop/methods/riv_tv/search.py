"""Solution of the equations of `riv-tv`: rounds of linear solutions, smoothing, dynamics and weights."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ankleloop.joint.dynamics import ReflexDynamics, respond
from ankleloop.methods.riv.equations import DELAY_LIMITS, Parameters, fit_grid, solve_scaled
from ankleloop.methods.riv_tv.equations import PREDICTED, TimeVaryingEquations, WhitenedSystem
from ankleloop.methods.riv_tv.inputs import MEAN_SPLINES
from ankleloop.signals.spectra import smooth

MOST_ROUNDS = 30
LARGEST_STEPS = {"omega_n": 0.3, "zeta": 0.3, "pole": 0.3, "delay": 0.008, "torque_lag": 0.004}
CONVERGED = 0.02  # of its standard error: largest step of a parameter of the dynamics
SMOOTHING_STEPS = 5  # of the penalties in one round
LARGEST_PENALTY, SMALLEST_PENALTY = 1e8, 1e-8  # in units of the information over the penalty
RENEWED = 1e-4  # s: change of the delay for which inputs are made anew


@dataclass(frozen=True, eq=False)
class TimeVaryingSolution:
    """Parameters that solve the equations, and the system at them."""

    equations: TimeVaryingEquations  # the equations
    parameters: Parameters  # their solution
    system: WhitenedSystem  # whitened system with its regressors at the solution
    penalty: np.ndarray  # shape (unknowns, unknowns): penalties with their weights
    penalties: np.ndarray  # shape (4,): weights of the penalties of K, B, G and I
    variance: float  # variance of the whitened noise at a frequency of the band
    spectrum: np.ndarray  # spectrum of the noise that the weights are the inverse of
    rounds: int  # number of rounds
    converged: bool  # whether the dynamics of the reflex moved no more


def solve_time_varying(
    equations: TimeVaryingEquations, order: int, delays: tuple[str, ...], lag: float
) -> TimeVaryingSolution:
    """Solve the equations, from the best of a grid of dynamics for constant parameters.

    A round solves the linear equations with weights and instruments of the point where it begins, chooses the
    penalties (`choose_penalties`), makes a step of the dynamics and of the delays, and renews the weights.
    """
    linear, dynamics = _fit_constants(equations, order)
    parameters = Parameters(linear, dynamics, lag=lag, delays=delays)
    converged, penalties = False, np.zeros(0)
    for count in range(1, MOST_ROUNDS + 1):
        noise = equations.noise(parameters)
        system = equations.system(parameters, equations.noise_whitener(noise))
        solution, penalties, variance = choose_penalties(equations, system, penalties)
        if converged:
            parameters = replace(parameters, linear=solution[: equations.bases.size])
            break
        parameters, converged = _step(equations, parameters, system, solution, variance)
        if abs(parameters.shift) > RENEWED:
            equations.set_delay(equations.delay + parameters.shift)
            parameters = replace(parameters, shift=0.0)
        converged = converged and count > 2
    penalty, spectrum = equations.bases.penalty(penalties, len(system.normal)), equations.spectrum(noise)
    return TimeVaryingSolution(equations, parameters, system, penalty, penalties, variance, spectrum, count, converged)


def _fit_constants(equations: TimeVaryingEquations, order: int) -> tuple[np.ndarray, ReflexDynamics]:
    """Linear parameters that are constant, by the predicted inputs, and the best dynamics of a grid."""
    inside, (k, b, g, i) = equations.inside, equations.bases.blocks
    motion = [equations.motion[PREDICTED][block].sum(axis=0) for block in (k, b, i)]
    inputs = np.stack([*motion, equations.drive[PREDICTED].sum(axis=0)])[:, inside]
    target = equations.torque[inside]
    s, noise, grid = equations.inputs.s[inside], np.ones(target.size), ReflexDynamics.grid(order)
    filters, width = respond(grid, s), equations.resolution * equations.inputs.size / equations.inputs.rate
    for _ in range(2):
        values, best, residual = fit_grid(inputs, target, filters, noise)
        noise = smooth(np.abs(residual) ** 2, width)
        noise = np.maximum(noise, 1e-10 * noise.max())
    linear = np.empty(equations.bases.size)
    linear[k], linear[b], linear[i], linear[g] = values
    return linear, grid[best]


def choose_penalties(
    equations: TimeVaryingEquations, system: WhitenedSystem, penalties: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    r"""Penalties by restricted likelihood, and the solution with them (Wood and Fasiolo 2017).

    .. math:: \lambda \leftarrow c s^2 \frac{rank(S) - \lambda\, tr(V S) / s^2}{\theta^T S \theta}, \quad
              V = s^2 (Z^T Z + S_\lambda)^{-1}

    The factor c is 1 for noise weights; for flat ones it is the variance of the noise where the regressors of the
    parameter have their power, over its mean: low frequencies show K and G, and flat weights leave the noise large
    there. Without penalties, as in the first round, they begin by weighing as much as the data.

    Shapes: penalties (4,); returns solution (unknowns,), penalties (4,).
    """
    bases, unknowns, course = equations.bases, len(system.normal), equations.inputs.course
    parts, information = list(zip(bases.all, bases.blocks, strict=True)), np.diag(system.information)
    typical = np.array([np.sum(information[block]) / max(np.trace(splines.penalty), 1.0) for splines, block in parts])
    penalties, factors = penalties if penalties.size else typical, np.ones(len(parts))
    freedom = (system.torque.size - (course.equal_cycles or MEAN_SPLINES)) * equations.share - unknowns
    for step in range(SMOOTHING_STEPS):
        penalty = bases.penalty(penalties, unknowns)
        solution = solve_scaled(system.normal + penalty, system.side)
        residual = system.torque - solution @ system.regressors
        variance = float(residual @ residual / max(freedom, 1.0))
        if step == 0 and equations.weighting == "flat":
            instruments = system.instruments[: bases.size]
            coloured = equations.colour(instruments, system.residual(solution[: bases.size]))
            factors = np.array([np.sum(coloured[block] ** 2) / np.sum(instruments[block] ** 2) for _, block in parts])
        inverse = solve_scaled(system.information + penalty, np.eye(unknowns))
        rough = np.array([solution[block] @ splines.penalty @ solution[block] for splines, block in parts])
        traces = np.array([np.trace(inverse[block, block] @ splines.penalty) for splines, block in parts])
        ranks = np.array([splines.rank for splines in bases.all])
        values = factors * variance * np.maximum(ranks - penalties * traces, 1e-10) / np.maximum(rough, 1e-300)
        penalties = np.where(ranks > 0, np.clip(values, SMALLEST_PENALTY * typical, LARGEST_PENALTY * typical), 0.0)
    return solution, penalties, variance


def _step(
    equations: TimeVaryingEquations,
    parameters: Parameters,
    system: WhitenedSystem,
    solution: np.ndarray,
    variance: float,
) -> tuple[Parameters, bool]:
    """Parameters after a round, and whether the dynamics have not moved."""
    size = parameters.linear.size
    # The columns of the dynamics are those of the linear parameters where the round begins.
    step, largest = solution[size:], np.array([LARGEST_STEPS[name] for name in parameters.unknowns])
    inverse = solve_scaled(system.information, np.eye(len(system.information)))
    errors = np.sqrt(np.maximum(variance * np.diag(inverse)[size:], 0.0))
    converged = np.max(np.abs(step) / np.maximum(errors, 1e-300)) < CONVERGED or np.max(np.abs(step) / largest) < 1e-5
    limited = np.concatenate([solution[:size] - parameters.linear, np.clip(step, -largest, largest)])
    parameters = parameters.add(limited)
    if "delay" in parameters.delays:
        low, high = (limit - equations.delay for limit in DELAY_LIMITS)
        parameters = replace(parameters, shift=float(np.clip(parameters.shift, low, high)))
    return parameters, bool(converged)
