"""What a solution of `riv-tv` is worth: covariance, bands, whether anything varies, and what the model may lack."""

from __future__ import annotations

import numpy as np
from scipy import special
from scipy.fft import irfft

from ankleloop.methods.riv.alternatives import Alternative, compute_shifts
from ankleloop.methods.riv.covariance import Covariance
from ankleloop.methods.riv.equations import solve_scaled
from ankleloop.methods.riv_tv.equations import MEASURED, PREDICTED
from ankleloop.methods.riv_tv.search import TimeVaryingSolution

INTEGRATION = 2001  # places at which squares of splines are summed
IDENTIFIED = 0.03  # of the mean information about a parameter: less is not identified
EFFECTS = ("lag", "high-pass", "friction", "compression", "direction", "delay")
UNKNOWNS = {"lag": "torque_lag", "delay": "delay"}


def estimate_covariance(solution: TimeVaryingSolution) -> Covariance:
    r"""Covariance of the unknowns about the true ones, smoothing included.

    .. math:: A^{-1} (M + s^2 S_\lambda) A^{-T}, \quad A = Z^T X + S_\lambda,

    with M the sum over cycles of the outer products of their contributions to the left side of the equations, which
    holds whatever the noise does within a cycle; the second term is what the penalties may have smoothed away, for
    trajectories as rough as they say (Nychka 1988). Weights from the noise are estimates themselves
    (`ankleloop.methods.riv.covariance.asymptotic_covariance`).

    References
    ----------
    D. Nychka, "Bayesian confidence intervals for smoothing splines", Journal of the American Statistical Association
    83(404), 1134-1143, 1988.
    """
    e, system, course = solution.equations, solution.system, solution.equations.inputs.course
    residual = system.residual(solution.parameters.linear)
    starts = np.searchsorted(course.segment, np.arange(course.segments))
    scores = np.add.reduceat(system.instruments * residual, starts, axis=1)
    matrix = system.normal + solution.penalty
    half = solve_scaled(matrix, scores @ scores.T + solution.variance * solution.penalty)
    covariance = solve_scaled(matrix, half.T)
    factor = (1.0 + 2.0 * e.smoothing_variance) * course.segments / (course.segments - 1.0)
    quantile = float(special.stdtrit(course.segments - 1, 0.975))
    return Covariance(factor * 0.5 * (covariance + covariance.T), quantile, {"intervals": "robust"})


def deviations(covariance: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Standard deviations of sums of parameters.

    Shapes: covariance (parameters, parameters), weights (..., parameters); returns (...).
    """
    return np.sqrt(np.maximum(np.sum(weights @ covariance * weights, axis=-1), 0.0))


def find_trajectories(
    solution: TimeVaryingSolution, covariance: Covariance, places: np.ndarray
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Trajectories of what varies with the ends of their bands, nan where the record does not show them; excitation.

    The excitation is the information of the record about a trajectory over its mean, for splines of equal size.

    Shapes: places (places,); returns (places,).
    """
    bases, information = solution.equations.bases, np.diag(solution.system.information)
    values: dict[str, np.ndarray] = {}
    excitation = {}
    for name, splines, block in zip(bases.names, bases.all, bases.blocks, strict=False):
        weights = splines(places)
        density = information[block] / np.mean(splines(np.linspace(0.0, 1.0, INTEGRATION)) ** 2, axis=0)
        excitation[name] = weights @ (density / max(float(np.mean(density)), np.finfo(float).tiny))
        curve = weights @ solution.parameters.linear[block]
        curve[excitation[name] < IDENTIFIED] = np.nan
        margin = covariance.quantile * deviations(covariance.matrix[block, block], weights)
        margin *= 1.0 if solution.converged else np.nan
        values |= {name: curve, f"{name}_low": curve - margin, f"{name}_high": curve + margin}
    return values, excitation


def freedom(solution: TimeVaryingSolution) -> dict[str, float]:
    """Effective number of parameters of each trajectory."""
    bases, information = solution.equations.bases, solution.system.information
    hat = np.diag(solve_scaled(information + solution.penalty, information))
    return {name: float(np.sum(hat[block])) for name, block in zip(bases.names, bases.blocks, strict=False)}


def variation_p(solution: TimeVaryingSolution) -> dict[str, float]:
    """Probability of a variation at least as large as the one that was seen, if K, B and G were constant.

    A score test: the equations are solved for constant parameters, with the weights and the dynamics of the solution,
    and the left sides of those for the contrasts of the splines are compared with their covariance, which the spectrum
    of the residual gives.
    """
    e, system = solution.equations, solution.system
    coloured = e.colour(system.instruments, system.residual(solution.parameters.linear))
    # The spectrum is an estimate, by which left sides scatter more.
    scatter = solution.variance * (1.0 + e.band.smoothing_variance(e.resolution)) * (coloured @ coloured.T)
    # The first direction of each block is its constant, the others are its contrasts.
    rotation, contrasts = np.eye(len(scatter)), {}
    for name, block in zip("KBG", e.bases.blocks, strict=False):
        size = block.stop - block.start
        rotation[block, block] = np.linalg.svd(np.ones((1, size)))[2]
        contrasts[name] = np.arange(block.start + 1, block.stop)
    contrasts["all"] = np.concatenate(list(contrasts.values()))
    normal, scatter = rotation @ system.normal @ rotation.T, rotation @ scatter @ rotation.T
    side, values = rotation @ system.side, {}
    for name, tested in contrasts.items():
        free = np.setdiff1d(np.arange(len(side)), tested)
        rows = np.eye(len(side))[tested]
        rows[:, free] = -normal[np.ix_(tested, free)] @ solve_scaled(normal[np.ix_(free, free)], np.eye(free.size))
        statistic = (rows @ side) @ solve_scaled(rows @ scatter @ rows.T, rows @ side)
        values[name] = float(special.chdtrc(tested.size, statistic))
    return values


def find_alternatives(solution: TimeVaryingSolution) -> list[Alternative]:
    """Effects with their scores, and how far the means of K, B, I and G move with one step towards each of them."""
    e, system, linear = solution.equations, solution.system, solution.parameters.linear
    residual = system.residual(linear)
    inverse = solve_scaled(system.normal + solution.penalty, np.eye(len(system.normal)))
    whiten = e.noise_whitener(e.noise(solution.parameters))
    scale = np.sqrt(solution.variance * (1.0 + e.smoothing_variance))
    alternatives = []
    for effect in EFFECTS:
        if UNKNOWNS.get(effect) in solution.parameters.delays:
            continue
        regressor, instrument = (whiten(_row(effect, solution, side)) for side in (MEASURED, PREDICTED))
        instrument = instrument - (instrument @ system.regressors.T) @ inverse @ system.instruments
        left = instrument @ residual
        score = left / (scale * np.linalg.norm(e.colour(instrument, residual)))
        step = left / (instrument @ regressor)
        moved = -step * (inverse @ (system.instruments @ regressor))
        shifts = compute_shifts(e.means(linear), e.means(linear + moved[: linear.size]))
        value = e.delay + solution.parameters.shift + step if effect == "delay" else step
        alternatives.append(Alternative(effect, float(value), float(score), shifts))
    return alternatives


def _row(effect: str, solution: TimeVaryingSolution, side: int) -> np.ndarray:
    """Transform of the derivative of the torque with respect to an effect, by measured or by predicted inputs."""
    e, parameters = solution.equations, solution.parameters
    inputs, s = e.inputs, np.where(e.inside, e.inputs.s, 1.0)
    torque = e.lead(parameters) if side == MEASURED else e.predict_torque(parameters, side)
    if effect == "lag":
        return -s * torque
    if effect == "high-pass":
        return -torque / s
    if effect == "compression":
        return -inputs.spectra(irfft(torque, inputs.size)[: inputs.grid.samples] ** 3)
    velocity, response = e.motions[side].signals[1], parameters.responses(inputs.s)[0]
    if effect == "friction":
        return inputs.spectra(np.sign(velocity))
    if effect == "delay":
        return -s * response * (parameters.linear[e.bases.blocks[2]] @ e.drive[side])
    late = np.exp(-inputs.s * e.delay)
    return response * (inputs.spectra(e.motions[side].drive(e.delay)) - late * inputs.spectra(velocity))
