"""Penalties on the roughness of trajectories: their weights are chosen by restricted likelihood."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ankleloop.methods.riv_tv.equations import TimeVaryingEquations, WhitenedSystem
from ankleloop.methods.riv_tv.repetition import MEAN_SPLINES
from ankleloop.signals.least_squares import invert_scaled, solve_scaled

SMOOTHING_STEPS = 5  # of the penalties in one round
# In units of the information over the penalty:
LARGEST_PENALTY = 1e8
SMALLEST_PENALTY = 1e-8
LEAST_FREEDOM = 1e-10  # degrees of freedom of a trajectory beyond what costs nothing
LEAST_ROUGHNESS = 1e-300


@dataclass(frozen=True, eq=False)
class SmoothSolution:
    """Solution of a whitened system with penalties."""

    values: np.ndarray  # shape (unknowns,)
    penalties: dict[str, float]  # weights of the penalties of K, B, I and G
    variance: float  # of the whitened noise at a frequency of the band


def choose_penalties(
    equations: TimeVaryingEquations, system: WhitenedSystem, start: dict[str, float] | None
) -> SmoothSolution:
    r"""Solution with penalties by restricted likelihood (Wood and Fasiolo 2017).

    .. math:: \lambda \leftarrow c s^2 \frac{rank(S) - \lambda\, tr(V S) / s^2}{\theta^T S \theta}, \quad
              V = s^2 (Z^T Z + S_\lambda)^{-1}

    The factor c is 1 for noise weights; for flat ones it is the variance of the noise where the regressors of the
    parameter have their power, over its mean: low frequencies show K and G, and flat weights leave the noise large
    there. Without penalties to start from, as in the first round, they begin by weighing as much as the data.
    """
    bases = equations.bases
    unknowns = len(system.normal)
    information = np.diag(system.information)
    typical = {
        name: float(np.sum(information[block]) / max(np.trace(bases.splines[name].penalty), 1.0))
        for name, block in bases.blocks.items()
    }
    penalties = typical if start is None else start
    factors = dict.fromkeys(bases.blocks, 1.0)
    repeated = equations.course.equal_cycles or MEAN_SPLINES
    independent = (system.torque.size - repeated) * equations.noise.share
    freedom = max(independent - unknowns, 1.0)
    for number in range(SMOOTHING_STEPS):
        penalty = bases.penalty(penalties, unknowns)
        values = solve_scaled(system.normal + penalty, system.side)
        residual = system.torque - values @ system.regressors
        variance = float(residual @ residual / freedom)
        if number == 0 and equations.options.weighting == "flat":
            factors = _relative_noise(equations, system, values)
        inverse = invert_scaled(system.information + penalty)
        renewed = {}
        for name, block in bases.blocks.items():
            splines = bases.splines[name]
            roughness = values[block] @ splines.penalty @ values[block]
            trace = np.sum(inverse[block, block] * splines.penalty)
            fitted = max(splines.rank - penalties[name] * trace, LEAST_FREEDOM)
            likeliest = factors[name] * variance * fitted / max(roughness, LEAST_ROUGHNESS)
            smallest = SMALLEST_PENALTY * typical[name]
            renewed[name] = min(max(likeliest, smallest), LARGEST_PENALTY * typical[name])
        penalties = renewed
    return SmoothSolution(values, penalties, variance)


def _relative_noise(
    equations: TimeVaryingEquations, system: WhitenedSystem, values: np.ndarray
) -> dict[str, float]:
    """Variance of the noise where the regressors of each parameter have their power, over its mean.

    Shapes: values (unknowns,).
    """
    size = equations.bases.size
    instruments = system.instruments[:size]
    coloured = equations.noise.colour(instruments, system.residual(values[:size]))
    return {
        name: float(np.sum(coloured[block] ** 2) / np.sum(instruments[block] ** 2))
        for name, block in equations.bases.blocks.items()
    }
